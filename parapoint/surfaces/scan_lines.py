"""Clouds scanned in lines: points near to one another along a line or ring, lines far apart.

The nearest neighbours of such a point all lie on its own line and say nothing of the surface
beside it. How many it takes until its neighbourhood spreads to both sides is found here, and so is
a part of the points that lie about as close along the lines as the lines do to each other.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from parapoint.surfaces.surface import FloatArray, IntArray

NEAREST = 6
"""Neighbours among which a cloud that is as dense in all directions spreads over its surface."""
TOLD = (6, 11)
"""Numbers of neighbours of which either tells a line: the more do so where lines are noisy."""
RANKS = (8, 11, 15, 20, 27, 36, 48, 64, 86, 115, 154)
"""Numbers of neighbours that are tried where these are all on one line. The last sees the next
line where it lies up to 60 times as far away as the next point."""
FLAT = 0.2
"""Ratio of the two larger standard deviations of a neighbourhood below which it is a line."""
MANY = 0.2
"""Share of points on lines from which a cloud counts as scanned in lines: at most 0.06 on 67
models whose points were drawn evenly."""
LINKED = 0.3
"""Largest distance from point to point along a line, in distances to the next line."""
ALONG = 0.4
"""Least distance between the points that are kept of a line, in distances to the next line."""
AROUND = 24
"""Neighbours that together say how far the next line is."""
STILL = 0.98
"""Lines are thinned again, as the next line is seen better each time, until at least this share of
the points stays."""
OFF = 0.7
"""Largest cosine with the direction of a line at which a neighbour is on another one."""
BATCH = 4_096
"""Points looked at together, which bounds the memory."""


class Lines(NamedTuple):
    """What is left of a cloud scanned in lines, once these are thinned.

    Attributes:
        rows: (n,) rows of the cloud.
        line: (n,) the line or ring of each, from 0; all turns of a helix are one.
        gap: (n,) about how far the next line is; 0 off lines.
    """

    rows: IntArray
    line: IntArray
    gap: FloatArray


def breadth(points: FloatArray) -> IntArray | None:
    """(N,) nearest neighbours that spread over the surface at each of distinct points (N, 3).

    That is NEAREST, and more on lines; 0 where even the most are on one line. None for a cloud that
    is not scanned in lines, or has hardly any points.
    """
    ranks = _ranks(points)
    if len(ranks) < 3:
        return None
    tree = cKDTree(points)
    count = np.full(len(points), NEAREST)
    is_line = np.concatenate([_flat(tree, rows, TOLD).any(axis=1) for rows in _batches(len(count))])
    if is_line.mean() < MANY:
        return None
    lines = np.flatnonzero(is_line)
    for batch in _batches(len(lines)):
        rows = lines[batch]
        spreads = ~_flat(tree, rows, ranks)
        # Noise spreads the nearest few: what counts is beyond a flat one, and twice in succession.
        spreads &= (np.cumsum(~spreads, axis=1) > 0) | spreads.all(axis=1, keepdims=True)
        spreads[:, :-1] &= spreads[:, 1:]
        first = np.argmax(spreads, axis=1)
        count[rows] = np.where(spreads.any(axis=1), np.array(ranks)[first], 0)
    return count


def thinned(points: FloatArray) -> Lines | None:
    """The lines that distinct points (N, 3) are scanned in, thinned; None where they are not.

    What is taken from a line are points much nearer to the next ones on it than the next line is:
    they show no more of the surface, but for noise, whose tiny triangles stand across it.
    """
    count = breadth(points)
    if count is None:
        return None
    gap = _gaps(points, count)
    rows = np.arange(len(points))
    while True:
        kept = _apart(points[rows], gap)
        is_still = len(kept) > STILL * len(rows)
        rows, gap = rows[kept], gap[kept]
        if is_still or (count := breadth(points[rows])) is None:
            break
        gap = np.maximum(gap, _gaps(points[rows], count))
    gap = np.where(gap > 0, _across(points[rows], gap), 0)
    line = _labels(points, gap[cKDTree(points[rows]).query(points)[1]])
    kept = _apart(points[rows], gap)
    return Lines(rows[kept], line[rows[kept]], gap[kept])


def _gaps(points: FloatArray, count: IntArray) -> FloatArray:
    """(N,) about how far the next line is from points (N, 3), given their `breadth`; 0 off lines.

    The upper quartile of AROUND points: noise fools many of them.
    """
    tree = cKDTree(points)
    gap = np.zeros(len(points))
    rank = np.where(count == 0, _ranks(points)[-1], count)
    for number in np.unique(rank[rank > NEAREST]):
        rows = np.flatnonzero(rank == number)
        gap[rows] = tree.query(points[rows], [number + 1])[0][:, 0]
    around = gap[tree.query(points, min(AROUND, len(points)))[1]]
    return np.asarray(np.quantile(around, 0.75, axis=1))


def _across(points: FloatArray, gap: FloatArray) -> FloatArray:
    """(N,) how far the next line is from points (N, 3) of thinned lines, where one can be seen.

    That is the nearest point in a direction off the line's own. Other than the spread of a
    neighbourhood it is not mistaken where a ring bends; where there is none, `gap` (N,) stays.
    """
    distance, near = cKDTree(points).query(points, min(AROUND, len(points)))
    offsets = points[near[:, 1:]] - points[:, None]
    offsets /= np.maximum(distance[:, 1:, None], 1e-300)
    moments = np.einsum("nki,nkj->nij", offsets[:, :2], offsets[:, :2])
    tangent = np.linalg.eigh(moments)[1][:, :, -1]
    is_off = np.abs(np.einsum("nki,ni->nk", offsets, tangent)) < OFF
    first = np.where(is_off, distance[:, 1:], np.inf).min(axis=1)
    return np.where(np.isfinite(first), first, gap)


def _labels(points: FloatArray, gap: FloatArray) -> IntArray:
    """(N,) the line of each point (N, 3): those that are LINKED or nearer hang together."""
    tree, links = cKDTree(points), []
    for rows in _batches(len(points)):
        distance, near = tree.query(points[rows], NEAREST + 1)
        row, rank = np.nonzero(distance < LINKED * gap[rows, None])
        links.append(np.stack([rows[row], near[row, rank]]))
    pairs = np.concatenate(links, axis=1)
    graph = coo_matrix((np.ones(pairs.shape[1], dtype=bool), pairs), (len(points),) * 2)
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def _apart(points: FloatArray, gap: FloatArray) -> IntArray:
    """(n,) rows of points (N, 3) none of which has one within ALONG of its gap (N,)."""
    tree = cKDTree(points)
    is_kept = np.ones(len(points), dtype=bool)
    for rows in _batches(len(points)):
        distance, near = tree.query(points[rows], min(RANKS[-1] + 1, len(points)))
        for row, others, is_close in zip(
            rows, near, distance < ALONG * gap[rows, None], strict=True
        ):
            if is_kept[row]:
                is_kept[others[is_close]] = False
                is_kept[row] = True
    return np.flatnonzero(is_kept)


def _ranks(points: FloatArray) -> list[int]:
    """The RANKS that a cloud has neighbours for."""
    return [rank for rank in RANKS if rank < len(points)]


def _batches(count: int) -> list[IntArray]:
    return np.array_split(np.arange(count), count // BATCH + 1)


def _flat(tree: cKDTree, rows: IntArray, ranks: Sequence[int]) -> np.ndarray:
    """(n, len(ranks)) whether the nearest neighbours of a point, that many, lie along a line."""
    near = tree.query(tree.data[rows], ranks[-1] + 1)[1]
    offsets = tree.data[near] - tree.data[rows][:, None]
    moments = np.cumsum(offsets[:, :, :, None] * offsets[:, :, None, :], axis=1)
    spread = np.linalg.eigvalsh(moments[:, list(ranks)])
    return np.asarray(spread[..., 1] < FLAT**2 * spread[..., 2])
