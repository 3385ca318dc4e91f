"""A binary hierarchy of boxes around triangles, and the pairs whose boxes overlap."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from parapoint.surfaces.surface import BoolArray, FloatArray, IntArray

NODES_AT_ONCE = 1 << 13
"""Pairs of boxes opened at a time: their arrays stay in the processor's cache."""
ALL_FOUR = np.uint32(0x01010101)


class Hierarchy:
    """Boxes over a space-filling order, each level half as many as the one below.

    Args:
        triangles: (N, 3, 2), at least one.

    Attributes:
        triangles: (N, 3, 2) what the boxes are around, in the order of the boxes.
        order: (N,) the place of each of them among the triangles that were given.
        levels: (M, 4) rows (lower, -upper) for each level, from the triangles' own boxes to the
            one around all. The box around two is the minimum of their rows; infinity is no box.
    """

    def __init__(self, triangles: FloatArray) -> None:
        lower, upper = triangles.min(axis=1), triangles.max(axis=1)
        self.order = _morton_order((lower + upper) / 2)
        self.triangles = triangles[self.order]
        self.levels = [np.concatenate([lower, -upper], axis=1)[self.order]]
        while len(self.levels[-1]) > 1:
            boxes = self.levels[-1]
            if len(boxes) % 2:
                boxes = self.levels[-1] = np.concatenate([boxes, np.full((1, 4), np.inf)])
            self.levels.append(np.minimum(boxes[0::2], boxes[1::2]))
        # Boxes a, b overlap if lower_a < upper_b and -upper_a < -lower_b: opposites of b.
        self._opposites = [np.ascontiguousarray(-boxes[:, [2, 3, 0, 1]]) for boxes in self.levels]

    def pairs(self) -> Iterator[tuple[IntArray, IntArray]]:
        """All pairs i != j of boxes with common area, each pair once, in pieces of bounded size.

        The hierarchy is descended for all pairs of a piece at once. At 100k triangles it takes half
        the time of a tree of shapes.
        """
        root = np.zeros(1, dtype=np.int64)
        stack = [(len(self.levels) - 1, root, root)] if len(self.order) > 1 else []
        while stack:
            level, i, j = stack.pop()
            if level == 0:
                yield self.order[i], self.order[j]
            elif len(i) > NODES_AT_ONCE:
                half = len(i) // 2
                stack += [(level, i[half:], j[half:]), (level, i[:half], j[:half])]
            else:
                i, j, _ = opened(level, i, j)
                kept = np.flatnonzero(self.overlap(level - 1, i, j))
                stack.append((level - 1, i.take(kept), j.take(kept)))

    def overlap(self, level: int, i: IntArray, j: IntArray) -> BoolArray:
        """(N,) whether boxes i and j of a level have common area."""
        overlap = self.levels[level].take(i, axis=0) < self._opposites[level].take(j, axis=0)
        # Four truths side by side are one integer, which compares much faster than `all`.
        return np.asarray(overlap.view(np.uint32)[:, 0] == ALL_FOUR)


def opened(level: int, i: IntArray, j: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """The pairs of children of nodes i and j, and which pair each comes from.

    Children of one node with itself: three pairs, or one where they are triangles; of two nodes:
    four.
    """
    left, right, two = 2 * i, 2 * j, np.flatnonzero(i != j)
    every = np.arange(len(i))
    first = np.concatenate([left, left, left + 1, left.take(two) + 1])
    second = np.concatenate([right, right + 1, right + 1, right.take(two)])
    source = np.concatenate([every, every, every, two])
    if level == 1:
        two = np.flatnonzero(first != second)
        first, second, source = first.take(two), second.take(two), source.take(two)
    return first, second, source


def _morton_order(points: FloatArray) -> IntArray:
    """(N,) the points along a Z-curve, so that neighbours in the order are near in the plane."""
    low, side = points.min(axis=0), float(np.ptp(points, axis=0).max())
    cells = ((points - low) * ((2**16 - 1) / side if side > 0 else 0.0)).astype(np.uint32)
    for shift, mask in ((8, 0x00FF00FF), (4, 0x0F0F0F0F), (2, 0x33333333), (1, 0x55555555)):
        cells = (cells | (cells << np.uint32(shift))) & np.uint32(mask)
    order = np.argsort(cells[:, 0] | (cells[:, 1] << np.uint32(1)), kind="stable")
    return np.asarray(order, dtype=np.int64)
