"""Polygons of a file, cut into triangles."""

from __future__ import annotations

import numpy as np

from parapoint.files.content import ranges
from parapoint.surfaces.surface import FloatArray, IntArray


def triangle_rows(vertices: FloatArray, sizes: IntArray, corners: IntArray) -> IntArray:
    """(F, 3) places in `corners` of the triangles of polygons, polygon by polygon.

    A polygon of n corners gives n - 2 triangles, a fan from its first corner; a quad that would
    fold along that diagonal (the two triangles face away from each other) is fanned from its
    second corner, which is right for every planar quad.

    Args:
        vertices: (V, 3) positions, finite.
        sizes: (N,) corners of each polygon, at least 3.
        corners: (sum of sizes,) rows of `vertices`.
    """
    starts = np.cumsum(sizes) - sizes
    turn = np.zeros(len(sizes), dtype=np.int64)
    quads = np.flatnonzero(sizes == 4)
    if len(quads):
        scale = float(np.abs(vertices).max()) or 1.0  # products of huge coordinates overflow
        a, b, c, d = (vertices[corners[starts[quads] + k]] / scale for k in range(4))
        first, second = np.cross(b - a, c - a), np.cross(c - a, d - a)
        turn[quads] = (first * second).sum(axis=1) < 0
    count = sizes - 2
    step = ranges(np.ones_like(count), count)
    place = np.stack([np.zeros_like(step), step, step + 1], axis=1)
    start, shift, size = (np.repeat(values, count)[:, None] for values in (starts, turn, sizes))
    return np.asarray(start + (place + shift) % size)
