"""OBJ centre lines -> strokes with normals and widths, read from the file or estimated."""

from __future__ import annotations

import re
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from face_plugin.ribbons.strokes import Stroke, tangents

_WIDTH = re.compile(r"#.*\bwidth\b[\s:=]*([-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?)(?![\w.])", re.IGNORECASE)
_NEIGHBOURS = 12


def polylines_to_strokes(
    lines: list[str], normals: NDArray[np.floating] | None, width: float | None, problems: list[str]
) -> list[Stroke]:
    """Strokes of an OBJ file of ``v`` and ``l``, as SurfaceBrush writes its centre lines.

    An ``l`` that begins where the last one ended continues its stroke. The width of a station is, in this
    order: the argument; a fourth number of its ``v``; the last comment with ``width`` and a number before its
    ``v``, else before its ``l``; the median distance to the nearest station of another stroke. Normals are
    those of ``vn``, if there are as many as ``v``, else those of planes fitted to the nearest stations.

    Parameters
    ----------
    lines
        The file.
    normals
        (m, 3) of the ``vn``, or None.
    width
        Full width, or None.
    problems
        What is wrong is added to it.

    Raises
    ------
    ValueError
        There is no line, or no way to tell the width.
    """
    centres, widths, chains = _parse(lines, problems)
    chains = _finite(centres, chains, problems)
    if not chains:
        raise ValueError("the file has neither faces (f) nor lines (l): it holds no strokes")
    loose = len(centres) - len(np.unique(np.concatenate(chains)))
    if loose:
        problems.append(f"left out {loose} vertices that no line refers to")
    if width is not None:
        widths[:] = width
    elif not np.isfinite(widths).all() or (widths <= 0).any():
        guess = _spacing(centres, chains)
        missing = ~(np.isfinite(widths) & (widths > 0))
        widths[missing] = guess
        problems.append(f"no width at {missing.sum()} stations: took {guess:.4g}, the distance between strokes")
    if normals is None:
        problems.append("no normals of the brush: took those of planes through the nearest stations")
        normals = _plane_normals(centres, chains)
    return [Stroke(centres[chain], normals[chain].astype(np.float64), widths[chain]) for chain in chains]


def _parse(
    lines: list[str], problems: list[str]
) -> tuple[NDArray[np.float64], NDArray[np.float64], list[NDArray[np.int64]]]:
    """Centres (m, 3), widths (m,) with NaN where the file has none, and the vertices of each stroke."""
    rows: list[list[float]] = []
    widths: list[float] = []
    chains: list[list[int]] = []
    noted = np.nan
    later: dict[int, float] = {}
    astray = 0
    for line in lines:
        comment = _WIDTH.search(line)
        if comment:
            noted = float(comment.group(1))
        words = line.split("#")[0].split()
        if words[:1] == ["v"]:
            rows.append([float(word) for word in words[1:4]])
            # Six numbers would be a colour.
            widths.append(float(words[4]) if len(words) == 5 else noted)
        elif words[:1] == ["l"]:
            chain = vertex_indices(words[1:], len(rows)).tolist()
            if any(k < 0 for k in chain):
                astray += 1
                continue
            later.update(dict.fromkeys(chain, noted))
            if chains and chain and chains[-1][-1] == chain[0]:
                chains[-1].extend(chain[1:])
            elif chain:
                chains.append(chain)
    whole = [np.array(chain, dtype=np.int64) for chain in chains if max(chain) < len(rows)]
    astray += len(chains) - len(whole)
    if astray:
        problems.append(f"left out {astray} lines with an index outside of the {len(rows)} vertices")
    found = np.array(widths, dtype=np.float64)
    for k, value in later.items():
        if k < len(found) and np.isnan(found[k]):
            found[k] = value
    return np.array(rows, dtype=np.float64).reshape(-1, 3), found, whole


def _finite(
    centres: NDArray[np.float64], chains: list[NDArray[np.int64]], problems: list[str]
) -> list[NDArray[np.int64]]:
    """Strokes without the stations that are not finite; what was drawn before and after one is joined."""
    finite = np.asarray(np.isfinite(centres).all(axis=1))
    lost = sum(int((~finite[chain]).sum()) for chain in chains)
    if lost:
        problems.append(f"left out {lost} stations whose position is not finite")
    return [chain[finite[chain]] for chain in chains if finite[chain].any()]


def vertex_indices(words: list[str], seen: int) -> NDArray[np.int64]:
    """Turn corners of an OBJ line after `seen` vertices into indices from 0; -1 where it is not a number."""
    out = np.full(len(words), -1, dtype=np.int64)
    for k, word in enumerate(words):
        try:
            index = int(word.split("/")[0])
        except ValueError:
            continue
        out[k] = index - 1 if index > 0 else seen + index
    return out


def _spacing(centres: NDArray[np.float64], chains: list[NDArray[np.int64]]) -> float:
    """Median distance from a station to the nearest of another stroke."""
    if len(chains) < 2:
        raise ValueError("width: the file has none and a single stroke; give the width of the ribbon")
    trees = [cKDTree(centres[chain]) for chain in chains]
    nearest = []
    for k, chain in enumerate(chains):
        others = [tree.query(centres[chain])[0] for j, tree in enumerate(trees) if j != k]
        nearest.append(np.min(others, axis=0))
    return float(np.median(np.concatenate(nearest)))


def _plane_normals(centres: NDArray[np.float64], chains: list[NDArray[np.int64]]) -> NDArray[np.float64]:
    """Fit planes to the nearest stations of all strokes; normals (m, 3) at right angles to the stroke."""
    used = np.unique(np.concatenate(chains))
    # A vertex of no stroke may be anything, and needs no normal.
    centres = np.where(np.isin(np.arange(len(centres)), used)[:, None], centres, centres[used[0]])
    _, index = cKDTree(centres[used]).query(centres, k=min(_NEIGHBOURS, len(used)))
    near = centres[used][np.atleast_2d(index.reshape(len(centres), -1))]
    near = near - near.mean(axis=1, keepdims=True)
    along = np.zeros_like(centres)
    for chain in chains:
        if len(chain) > 1:
            along[chain] = tangents(centres[chain])
    # Only what lies across the stroke tells its plane; the least of that, apart from the stroke itself, is
    # the normal.
    near = near - np.einsum("nki,ni->nk", near, along)[..., None] * along[:, None, :]
    scatter = np.einsum("nki,nkj->nij", near, near)
    size = np.trace(scatter, axis1=1, axis2=2)[:, None, None]
    scatter = scatter + (size + 1.0) * np.einsum("ni,nj->nij", along, along)
    normals: NDArray[np.float64] = np.linalg.eigh(scatter)[1][:, :, 0]
    for chain in chains:
        for before, here in pairwise(chain):
            if normals[before] @ normals[here] < 0:
                normals[here] *= -1
    return normals
