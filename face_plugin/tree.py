"""A binary tree over points, and the nearest points of each of them.

Each node halves its points along the longest side of their box, as a k-d tree does (Bentley 1975); so a node is a run
of one order, and its children are the halves of that run.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from face_plugin.compiled import compiled
from face_plugin.threads import in_threads

__all__ = ["STACK", "PointTree"]

LEAF = 8
# Nodes of at most so many points share one walk down the tree.
GROUP = 16
# Deep enough for 2**48 leaves.
STACK = 100
# Equal coordinates are moved apart by up to this share of the extent, before the order of points is chosen.
SPLIT = 1e-9
# Distances are sorted into so many buckets before they are sorted within them: on a sheet few share one.
BUCKETS = 128
# Gaps of Shell's sort, for entries nearly in order.
GAPS = (10, 4, 1)


class PointTree:
    """Binary tree over points.

    Parameters
    ----------
    points : (n, d) float64
        d is 3, or 2 in the plane; a plane is one of space.

    Attributes
    ----------
    order : (n,) intp
        Rows of the points in the order of the tree.
    points : (n, 3) float64
        In that order.
    start, stop, child : (m,) int64
        Of each node: the run of its points, and the first of its two children (-1: none), which follow it.
    groups : (g + 1,) int64
        Bounds of the runs of points that share one walk down the tree.

    Examples
    --------
    >>> tree = PointTree(np.arange(3.0)[:, None] * np.array([[1.0, 0, 0]]))
    >>> distance, row = tree.nearest(2)
    >>> distance.tolist(), row[0].tolist()
    ([[0.0, 1.0], [0.0, 1.0], [0.0, 1.0]], [0, 1])
    """

    def __init__(self, points: NDArray[np.float64]) -> None:
        if points.shape[1] == 2:
            points = np.column_stack([points, np.zeros(len(points))])
        self.order = _compact_order(points)
        self.points = points[self.order]
        self.start, self.stop, self.child = _halves(len(points))
        self.groups = _groups(len(points))
        self._parents = _by_depth(self.child)

    def sums(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Add up (m, c) the values (n, c) of each node's points, which are in the order of the tree."""
        out = np.empty((len(self.start), values.shape[1]))
        # Leaves from their points and parents from their children, as running sums lose what is small beside the rest.
        leaf = np.flatnonzero(self.child < 0)
        leaf = leaf[np.argsort(self.start[leaf])]
        out[leaf] = np.add.reduceat(values, self.start[leaf])
        for parents in reversed(self._parents):
            child = self.child[parents]
            out[parents] = out[child] + out[child + 1]
        return out

    def radii(self, centre: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distance (m,) from a place (m, 3) of each node to the farthest of its points."""
        radius = np.zeros(len(centre))
        for nodes in (np.zeros(1, dtype=np.int64), *(_both(self.child[parents]) for parents in self._parents)):
            size = self.stop[nodes] - self.start[nodes]
            first = np.cumsum(size) - size
            rows = np.arange(size.sum()) + np.repeat(self.start[nodes] - first, size)
            offset = self.points[rows] - np.repeat(centre[nodes], size, axis=0)
            radius[nodes] = np.sqrt(np.maximum.reduceat(np.einsum("nd,nd->n", offset, offset), first))
        return radius

    def nearest(self, count: int) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
        """Find the nearest points of each point, all at once: in half the time of one search for each.

        Parameters
        ----------
        count : int
            How many, k, the point itself among them; at most n.

        Returns
        -------
        distance : (n, k) float64
            Ascending, 0 first.
        row : (n, k) intp
            Of points as they were given; of several as near, the lower one in the order of the tree first.
        """
        n = len(self.points)
        distance, row = np.empty((n, count)), np.empty((n, count), dtype=np.intp)
        # All nodes' boxes at once: of pairs of bounds every second is a node.
        bounds = np.stack([self.start, self.stop], axis=1).ravel()
        padded = np.concatenate([self.points, self.points[-1:]])
        low, high = (of.reduceat(padded, bounds)[::2] for of in (np.minimum, np.maximum))

        def run(groups: slice) -> None:
            rows, keys = np.empty((2, n), dtype=np.int64), np.empty((2, n))
            _nearest(
                groups.start, groups.stop, self.groups, self.points, self.order, self.start, self.stop, self.child, low,
                high, np.empty(STACK, dtype=np.int64), *rows, *keys, np.empty(BUCKETS + 1, dtype=np.int64), GAPS,
                distance, row,
            )  # fmt: skip

        in_threads(run, len(self.groups) - 1, 512 // GROUP)
        return distance, row


def _compact_order(points: NDArray[np.float64]) -> NDArray[np.intp]:
    """Order (n,) of points (n, 3) in which halves of halves lie close together: that of a k-d tree.

    Such nodes are a third as wide as those of a space-filling curve's order, and half as many of them do for a sum.
    """
    # Equal coordinates would be split elsewhere than in the middle.
    apart = np.random.default_rng(0).random(points.shape)
    apart *= SPLIT * float(np.ptp(points)) if points.size else 0.0
    return np.asarray(cKDTree(points + apart, leafsize=LEAF, compact_nodes=False).indices)


def _halves(count: int) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """First and last of each node's run, and its first child, depth by depth."""
    depths = []
    start, stop, nodes = np.zeros(1, np.int64), np.full(1, count), 1
    while len(start):
        split = stop - start > LEAF
        child = np.where(split, nodes + 2 * (np.cumsum(split) - 1), -1)
        depths.append((start, stop, child))
        nodes += 2 * int(split.sum())
        start, stop = start[split], stop[split]
        middle = (start + stop) // 2
        start, stop = np.stack([start, middle], axis=1).ravel(), np.stack([middle, stop], axis=1).ravel()
    return tuple(np.concatenate(of) for of in zip(*depths, strict=True))  # type: ignore[return-value]


def _by_depth(child: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Nodes that have children, depth by depth."""
    depths, nodes = [], np.flatnonzero(child[:1] >= 0)
    while len(nodes):
        depths.append(nodes)
        below = _both(child[nodes])
        nodes = below[child[below] >= 0]
    return depths


def _both(child: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.stack([child, child + 1], axis=1).ravel()


def _groups(count: int) -> NDArray[np.int64]:
    """Bounds of the largest nodes that are no larger than GROUP."""
    bounds = np.array([0, count])
    while np.diff(bounds).max() > GROUP:
        bounds = np.append(np.stack([bounds[:-1], (bounds[:-1] + bounds[1:]) // 2], axis=1).ravel(), count)
    return bounds


@compiled(nogil=True, error_model="numpy")
def _nearest(  # type: ignore[no-untyped-def]
    first, last, groups, points, order, start, stop, child, low, high, stack, near, row_of, squared, key, place_of,
    gaps, distance, row,
):  # fmt: skip
    """Find the nearest points for groups: they share one walk, and what it finds.

    With c the middle of a group, r its radius and D the distance from c to the k-th nearest of any points, no neighbour
    of the group's points is farther than D + 2 r from c: it has k points within D + r.
    """
    n, count = len(points), distance.shape[1]
    for group in range(first, last):
        begin, end = groups[group], groups[group + 1]
        x, y, z = 0.0, 0.0, 0.0
        for i in range(begin, end):
            x, y, z = x + points[i, 0], y + points[i, 1], z + points[i, 2]
        x, y, z = x / (end - begin), y / (end - begin), z / (end - begin)
        reach = 0.0
        for i in range(begin, end):
            reach = max(reach, (points[i, 0] - x) ** 2 + (points[i, 1] - y) ** 2 + (points[i, 2] - z) ** 2)
        reach = 2.0 * np.sqrt(reach)
        # Those on both sides in the order give a first bound, those within that a close one.
        found = 0
        for k in range(max(begin - count, 0), min(end + count, n)):
            near[found] = k
            found += 1
        for narrowing in range(2):
            for k in range(found):
                j = near[k]
                squared[k] = (points[j, 0] - x) ** 2 + (points[j, 1] - y) ** 2 + (points[j, 2] - z) ** 2
            _select(squared, near, found, count)
            farthest = 0.0
            for k in range(count):
                farthest = max(farthest, squared[k])
            bound = (np.sqrt(farthest) + reach) ** 2 * (1.0 + 1e-12)
            if narrowing == 1:
                break
            found, top = 0, 1
            stack[0] = 0
            while top > 0:
                top -= 1
                node = stack[top]
                dx = max(low[node, 0] - x, x - high[node, 0], 0.0)
                dy = max(low[node, 1] - y, y - high[node, 1], 0.0)
                dz = max(low[node, 2] - z, z - high[node, 2], 0.0)
                if dx * dx + dy * dy + dz * dz > bound:
                    continue
                if child[node] >= 0:
                    stack[top] = child[node]
                    stack[top + 1] = child[node] + 1
                    top += 2
                    continue
                for k in range(start[node], stop[node]):
                    near[found] = k
                    found += 1
        kept = 0
        for k in range(found):
            if squared[k] <= bound:
                near[kept] = near[k]
                kept += 1
        for i in range(begin, end):
            # By squared distance into buckets, of which on a sheet each gets as many; those that hold the first k.
            away = (points[i, 0] - x) ** 2 + (points[i, 1] - y) ** 2 + (points[i, 2] - z) ** 2
            scale = BUCKETS / max((np.sqrt(farthest) + np.sqrt(away)) ** 2, 1e-280)
            for k in range(BUCKETS + 1):
                place_of[k] = 0
            for k in range(kept):
                j = near[k]
                squared[k] = (
                    (points[j, 0] - points[i, 0]) ** 2
                    + (points[j, 1] - points[i, 1]) ** 2
                    + (points[j, 2] - points[i, 2]) ** 2
                )
                place_of[int(min(squared[k] * scale, BUCKETS))] += 1
            size, last_of = 0, 0
            while size < count:
                place_of[last_of], size = size, size + place_of[last_of]
                last_of += 1
            for k in range(kept):
                bucket = int(min(squared[k] * scale, BUCKETS))
                if bucket < last_of:
                    place = place_of[bucket]
                    place_of[bucket] += 1
                    row_of[place] = near[k]
                    # First, whatever else is as near.
                    key[place] = squared[k] if near[k] != i else -1.0
            if size > 2 * count:
                _select(key, row_of, size, count)
                size = count
            for gap in gaps:
                for k in range(gap, size):
                    value, j, place = key[k], row_of[k], k
                    while place >= gap and (
                        key[place - gap] > value or (key[place - gap] == value and row_of[place - gap] > j)
                    ):
                        key[place], row_of[place] = key[place - gap], row_of[place - gap]
                        place -= gap
                    key[place], row_of[place] = value, j
            at = order[i]
            for k in range(count):
                distance[at, k] = np.sqrt(max(key[k], 0.0))
                row[at, k] = order[row_of[k]]


@compiled(nogil=True)
def _select(key, row, size, count):  # type: ignore[no-untyped-def]
    """Bring the `count` smallest of so many keys to the front, by Hoare's selection; of equal ones the lower rows."""
    low, high, wanted = 0, size - 1, count - 1
    while low < high:
        pivot, own = key[(low + high) // 2], row[(low + high) // 2]
        a, b = low, high
        while a <= b:
            while key[a] < pivot or (key[a] == pivot and row[a] < own):
                a += 1
            while key[b] > pivot or (key[b] == pivot and row[b] > own):
                b -= 1
            if a <= b:
                key[a], key[b] = key[b], key[a]
                row[a], row[b] = row[b], row[a]
                a += 1
                b -= 1
        if wanted <= b:
            high = b
        elif wanted >= a:
            low = a
        else:
            break
