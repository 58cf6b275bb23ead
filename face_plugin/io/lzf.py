"""LZF, the compression inside PCD files: only what reading them needs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from face_plugin.compiled import compiled

__all__ = ["decompress"]

# A copy of three bytes of input makes 264 bytes at most.
_MOST_RATIO = 264 / 3


def decompress(packed: NDArray[np.uint8], size: int) -> NDArray[np.uint8]:
    """Unpack to `size` bytes.

    Raises
    ------
    ValueError
        The content is damaged, or could not be as long as claimed.
    """
    if not 0 <= size <= _MOST_RATIO * len(packed) + 1:
        raise ValueError(f"{len(packed)} compressed bytes cannot hold the {size} that are claimed")
    out = np.zeros(size, dtype=np.uint8)
    if _unpack(np.ascontiguousarray(packed), out) != size:
        raise ValueError("damaged compressed content")
    return out


@compiled()
def _unpack(packed: NDArray[np.uint8], out: NDArray[np.uint8]) -> int:  # pragma: no cover
    """Fill `out`; the number of bytes made, or -1 where the input is damaged."""
    at = made = 0
    while at < len(packed):
        control = int(packed[at])
        at += 1
        if control < 32:
            # A run of bytes as they are.
            run = control + 1
            if at + run > len(packed) or made + run > len(out):
                return -1
            out[made : made + run] = packed[at : at + run]
            at += run
            made += run
            continue
        length = control >> 5
        if length == 7:
            if at >= len(packed):
                return -1
            length += int(packed[at])
            at += 1
        if at >= len(packed):
            return -1
        back = made - ((control & 31) << 8) - int(packed[at]) - 1
        at += 1
        length += 2
        if back < 0 or made + length > len(out):
            return -1
        # Byte by byte: a copy may overlap with itself.
        for k in range(length):
            out[made + k] = out[back + k]
        made += length
    return made
