"""Medians of what each point's neighbours have."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from face_plugin.compiled import compiled
from face_plugin.threads import in_threads

__all__ = ["medians"]


def medians(values: NDArray[np.float64], neighbour: NDArray[np.intp]) -> NDArray[np.float64]:
    """Medians (n,) of the finite values (m,) at each point's neighbours (n, k); infinite where there are none.

    Of an even number, the upper of the two in the middle.

    Examples
    --------
    >>> medians(np.array([1.0, 2.0, np.inf, 9.0]), np.array([[0, 1, 3], [2, 2, 2]]))
    array([ 2., inf])
    """
    out = np.empty(len(neighbour))
    values, neighbour = np.ascontiguousarray(values), np.ascontiguousarray(neighbour)
    in_threads(lambda rows: _medians(rows.start, rows.stop, values, neighbour, out), len(neighbour))
    return out


@compiled(nogil=True)
def _medians(first, last, values, neighbour, out):  # type: ignore[no-untyped-def]
    """Find the one in the middle by Hoare's selection: what lies beyond the part that holds it is never sorted."""
    found = np.empty(neighbour.shape[1])
    for i in range(first, last):
        count = 0
        for k in range(neighbour.shape[1]):
            value = values[neighbour[i, k]]
            if value != np.inf:
                found[count] = value
                count += 1
        if count == 0:
            out[i] = np.inf
            continue
        low, high, middle = 0, count - 1, count // 2
        while low < high:
            pivot = found[(low + high) // 2]
            a, b = low, high
            while a <= b:
                while found[a] < pivot:
                    a += 1
                while found[b] > pivot:
                    b -= 1
                if a <= b:
                    found[a], found[b] = found[b], found[a]
                    a += 1
                    b -= 1
            if middle <= b:
                high = b
            elif middle >= a:
                low = a
            else:
                break
        out[i] = found[middle]
