"""Triangles that lie on one another by the thousand: a sample of the pairs that may overlap.

The hierarchy of boxes is descended level by level. Pairs of nodes are dropped where three tests
prove that nothing in one overlaps anything in the other: their boxes; oriented boxes, which keep
slivers apart that run aslant; and a corner of all triangles of both around which none overlaps.
Where more than `SAMPLE` pairs are left on a level, a sample of them is gone into, each with the
weight of those that it stands for (splitting and Russian roulette; Kahn and Harris, 1951). Half of
the chance goes evenly to all, half by the area that the boxes may have in common, so that neither
numbers of pairs nor their areas hang on rare pairs.
"""

from __future__ import annotations

import numpy as np

from benchmarks.metrics.boxes import Hierarchy, opened
from parapoint.surfaces.surface import BoolArray, FloatArray, IntArray

SAMPLE = 1 << 16
"""Pairs of nodes that are gone into on a level: time and memory stay bounded."""


class Crowd:
    """Pairs of triangles that may overlap, or a sample of them where they are too many.

    Args:
        tree: boxes around counter-clockwise triangles, more than one.
    """

    def __init__(self, tree: Hierarchy) -> None:
        self.tree = tree
        self._random = np.random.default_rng(0)
        corners = _sound_corners(tree.triangles)
        direction = _directions(tree.triangles)
        self._shared: list[IntArray] = []
        self._oriented: list[FloatArray] = []
        for level, boxes in enumerate(tree.levels):
            self._oriented.append(_oriented_boxes(tree.triangles, direction, level))
            self._shared.append(corners)
            if len(corners) < len(boxes):  # the last node has a sibling of no triangles
                corners = self._shared[-1] = np.concatenate([corners, corners[-1:]])
            if len(boxes) > 1:
                left, right = corners[0::2], corners[1::2]
                corners = np.where((left[:, :, None] == right[:, None]).any(axis=2), left, -1)

    def sample(
        self, wanted: BoolArray | None = None
    ) -> tuple[IntArray, IntArray, FloatArray, bool]:
        """Pairs i, j of the triangles as they were given, the weight of each, and whether all.

        Args:
            wanted: (N,) triangles of which each pair has at least one; by default all are.
        """
        tree, whole = self.tree, True
        i = j = np.zeros(1, dtype=np.int64)
        weight = np.ones(1)
        active = None if wanted is None else self._active(wanted)
        for level in range(len(tree.levels) - 1, 0, -1):
            i, j, source = opened(level, i, j)
            kept = tree.overlap(level - 1, i, j)
            if active is not None:
                kept &= active[level - 1][i] | active[level - 1][j]
            i, j, weight = i[kept], j[kept], weight[source[kept]]
            kept = ~self._apart(level - 1, i, j)
            i, j, weight = i[kept], j[kept], weight[kept]
            if len(i) > SAMPLE:
                whole = False
                chance = self._chances(level - 1, i, j, weight)
                # One draw serves all: a pair is kept where the running sum passes an integer.
                passed = np.floor(np.cumsum(chance) + self._random.random())
                kept = np.diff(passed, prepend=0.0) > 0
                i, j, weight = i[kept], j[kept], weight[kept] / chance[kept]
        return tree.order[i], tree.order[j], weight, whole

    def _active(self, wanted: BoolArray) -> list[BoolArray]:
        """For each level, which nodes have a triangle that is wanted."""
        levels = [wanted[self.tree.order]]
        for boxes in self.tree.levels[:-1]:
            below = levels[-1] = np.pad(levels[-1], (0, len(boxes) - len(levels[-1])))
            levels.append(below[0::2] | below[1::2])
        return levels

    def _chances(self, level: int, i: IntArray, j: IntArray, weight: FloatArray) -> FloatArray:
        """(N,) the chance of each pair to be kept, some `SAMPLE` in sum at most."""
        boxes = self.tree.levels[level]
        lower = np.maximum(boxes[i, :2], boxes[j, :2])
        upper = np.minimum(-boxes[i, 2:], -boxes[j, 2:])
        across, sine = 2 * self._oriented[level][5], self._angle(level, i, j)[1]
        with np.errstate(over="ignore", invalid="ignore"):  # 0 / 0 where parallels have no width
            crossing = across[i] * across[j] / np.maximum(sine, np.finfo(np.float64).tiny)
            area = weight * np.fmin(np.prod(upper - lower, axis=1), crossing)
            total = float(area.sum())
        share = weight / weight.sum()
        if 0 < total < np.inf:
            share = (share + area / total) / 2
        return np.asarray(np.minimum(SAMPLE * share, 1.0))

    def _apart(self, level: int, i: IntArray, j: IntArray) -> BoolArray:
        """(N,) whether nothing in node i overlaps anything in node j of a level."""
        shared = self._shared[level]
        a, b = shared.take(i, axis=0), shared.take(j, axis=0)
        apart = np.zeros(len(i), dtype=bool)
        for place in a.T:
            apart |= (place >= 0) & ((place == b[:, 0]) | (place == b[:, 1]) | (place == b[:, 2]))
        apart &= i != j
        x, y, along, across, half_along, half_across = self._oriented[level]
        dx, dy = x[j] - x[i], y[j] - y[i]
        cosine, sine = self._angle(level, i, j)
        for one, other in ((i, j), (j, i)):
            u, v, long, short = along[one], across[one], half_along[one], half_across[one]
            reach = half_along[other] * cosine + half_across[other] * sine
            apart |= np.abs(u * dx + v * dy) > long + reach
            reach = half_along[other] * sine + half_across[other] * cosine
            apart |= np.abs(u * dy - v * dx) > short + reach
        return np.asarray(apart)

    def _angle(self, level: int, i: IntArray, j: IntArray) -> tuple[FloatArray, FloatArray]:
        """(N,) cosine and sine of the acute angle between the axes of two nodes of a level."""
        u, v = self._oriented[level][2:4]
        return np.abs(u[i] * u[j] + v[i] * v[j]), np.abs(u[i] * v[j] - v[i] * u[j])


def _directions(triangles: FloatArray) -> FloatArray:
    """(N, 2) the longest side of each triangle at twice its angle, as long as its square.

    So opposite directions are one, and those of many triangles can be summed.
    """
    sides = np.roll(triangles, -1, axis=1) - triangles
    length = (sides**2).sum(axis=2)
    x, y = sides[np.arange(len(sides)), length.argmax(axis=1)].T
    return np.stack([x**2 - y**2, 2 * x * y], axis=1)


def _oriented_boxes(triangles: FloatArray, direction: FloatArray, level: int) -> FloatArray:
    """(6, M) centre, axis and half lengths along and across it, of the boxes of a level."""
    starts = np.arange(0, len(triangles), 1 << level)
    doubled = np.add.reduceat(direction, starts, axis=0)
    angle = np.arctan2(doubled[:, 1], doubled[:, 0]) / 2
    u, v = np.cos(angle), np.sin(angle)
    node = np.arange(len(triangles)) >> level
    x, y = triangles[:, :, 0], triangles[:, :, 1]
    along = u[node, None] * x + v[node, None] * y
    across = u[node, None] * y - v[node, None] * x
    low_u, low_v = (np.minimum.reduceat(c.min(axis=1), starts) for c in (along, across))
    high_u, high_v = (np.maximum.reduceat(c.max(axis=1), starts) for c in (along, across))
    mid_u, mid_v = (low_u + high_u) / 2, (low_v + high_v) / 2
    boxes = [u * mid_u - v * mid_v, v * mid_u + u * mid_v, u, v]
    boxes += [(high_u - low_u) / 2, (high_v - low_v) / 2]
    return np.pad(np.array(boxes), ((0, 0), (0, 1)), mode="edge")


def _sound_corners(triangles: FloatArray) -> IntArray:
    """(N, 3) the number of each corner's place, or -1 where the triangle may overlap others there.

    Triangles with a corner at one place do not overlap if their sectors around it do not: sorted
    by their first side, each ends before the next begins. Of two that do overlap, the first ends
    too late.
    """
    _, place = np.unique(triangles.reshape(-1, 2), axis=0, return_inverse=True)
    place = place.reshape(-1)
    ahead, behind = (
        (np.roll(triangles, shift, axis=1) - triangles).reshape(-1, 2) for shift in (-1, 1)
    )
    begin, end = (np.arctan2(side[:, 1], side[:, 0]) for side in (ahead, behind))
    end = np.where(end < begin, end + 2 * np.pi, end)
    order = np.lexsort((begin, place))
    at, begin, end = place[order], begin[order], end[order]
    late = (np.roll(at, -1) == at) & (end > np.roll(begin, -1))
    # The first of a place begins again a turn later.
    late |= end - 2 * np.pi > begin[np.searchsorted(at, at)] + 1e-15
    place[order[late]] = -1
    return np.asarray(place.reshape(-1, 3))
