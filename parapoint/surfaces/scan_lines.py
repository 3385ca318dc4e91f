"""Clouds scanned in lines: points near to one another along a line or ring, lines far apart.

The nearest neighbours of such a point all lie on its own line and say nothing of the surface
beside it. How many it takes until its neighbourhood spreads to both sides is found here.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from parapoint.surfaces.surface import FloatArray, IntArray

NEAREST = 6
"""Neighbours among which a cloud that is as dense in all directions spreads over its surface."""
RANKS = (8, 11, 15, 20, 27, 36, 48, 64, 86, 115, 154)
"""Numbers of neighbours that are tried where these are all on one line. The last sees the next
line where it lies up to 60 times as far away as the next point."""
FLAT = 0.2
"""Ratio of the two larger standard deviations of a neighbourhood below which it is a line."""
MANY = 0.2
"""Share of points on lines from which a cloud counts as scanned in lines: at most 0.06 on 67
models whose points were drawn evenly."""
BATCH = 4_096
"""Points looked at together, which bounds the memory."""


def breadth(points: FloatArray) -> IntArray | None:
    """(N,) nearest neighbours that spread over the surface at each of distinct points (N, 3).

    That is NEAREST, and more on lines; 0 where even the most are on one line. None for a cloud that
    is not scanned in lines, or has fewer points than neighbours.
    """
    if len(points) <= RANKS[-1]:
        return None
    tree = cKDTree(points)
    count = np.full(len(points), NEAREST)
    is_line = np.concatenate([_flat(tree, rows, (NEAREST,))[:, 0] for rows in _batches(len(count))])
    if is_line.mean() < MANY:
        return None
    lines = np.flatnonzero(is_line)
    for batch in _batches(len(lines)):
        rows = lines[batch]
        flat = _flat(tree, rows, RANKS)
        first = np.argmin(flat, axis=1)
        count[rows] = np.where(flat.all(axis=1), 0, np.array(RANKS)[first])
    return count


def _batches(count: int) -> list[IntArray]:
    return np.array_split(np.arange(count), count // BATCH + 1)


def _flat(tree: cKDTree, rows: IntArray, ranks: tuple[int, ...]) -> np.ndarray:
    """(n, len(ranks)) whether the nearest neighbours of a point, that many, lie along a line."""
    near = tree.query(tree.data[rows], ranks[-1] + 1)[1]
    offsets = tree.data[near] - tree.data[rows][:, None]
    moments = np.cumsum(offsets[:, :, :, None] * offsets[:, :, None, :], axis=1)
    spread = np.linalg.eigvalsh(moments[:, list(ranks)])
    return np.asarray(spread[..., 1] < FLAT**2 * spread[..., 2])
