"""The points of a surface in the cells of a square grid, at most one in each.

Cells are numbered row by row. Points are shared out in halves: of the points, each half of the
square gets as many as its share of the cells, those that lie nearer to what it stands for. So a
patch of the square comes down to a block of cells and as many points, which are assigned one to
one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from parapoint.surfaces.sampling import mean_spacing
from parapoint.surfaces.surface import FloatArray, IntArray

JUMP = 4.0
"""Distance in space of points in neighbouring cells that counts as a jump, in mean distances of a
point to the nearest other one."""

Costs = Callable[[IntArray, IntArray], FloatArray]
"""Points (n,) and cells (m,) of a patch → (n, m) what it costs to put each point in each cell."""


def side_for(count: int) -> int:
    """The cells on a side of the smallest square grid that holds so many points."""
    return math.isqrt(count - 1) + 1


def centres(side: int) -> FloatArray:
    """(side², 2) the centres of the cells of the square from -1 to 1."""
    steps = (2 * np.arange(side) + 1) / side - 1
    return np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=-1).reshape(-1, 2)


def blocks(side: int, count: int) -> IntArray:
    """(side², 2) the row and the column of each cell's block, of `count` x `count` blocks."""
    steps = (2 * np.arange(side) + 1) * count // (2 * side)
    return np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=-1).reshape(-1, 2)


def arranged(points: FloatArray, places: FloatArray, block: IntArray, costs: Costs) -> IntArray:
    """(N,) the cell of each point, no two in one.

    Args:
        points: (N, 3), N at most the number of cells.
        places: (C, 3) what each cell stands for in space.
        block: (C, 2) the row and the column of the block that each cell lies in.
        costs: by which the points of a block are assigned to its cells.
    """
    cell = np.empty(len(points), dtype=np.int64)
    for rows, cells in _patches(
        points, places, block, np.arange(len(points)), np.arange(len(block))
    ):
        chosen, where = linear_sum_assignment(costs(rows, cells))
        cell[rows[chosen]] = cells[where]
    return cell


def _patches(
    points: FloatArray, places: FloatArray, block: IntArray, rows: IntArray, cells: IntArray
) -> Iterator[tuple[IntArray, IntArray]]:
    """The points and the cells of each block: both are halved until one block is left."""
    extent = np.ptp(block[cells], axis=0)
    if not extent.any():
        yield rows, cells
        return
    along = block[cells, extent.argmax()]
    is_first = along < (along.min() + along.max() + 1) // 2
    first, second = cells[is_first], cells[~is_first]
    share = round(len(rows) * len(first) / len(cells))
    share = min(max(share, len(rows) - len(second)), len(first))
    near, far = (cKDTree(places[half]).query(points[rows])[0] ** 2 for half in (first, second))
    order = np.argsort(near - far, kind="stable")  # the cheapest way to share out so many
    for half, of_half in ((order[:share], first), (order[share:], second)):
        yield from _patches(points, places, block, rows[np.sort(half)], of_half)


def squared_distances(a: FloatArray, b: FloatArray) -> FloatArray:
    """(n, m) the squared distance of each of a (n, d) from each of b (m, d)."""
    return np.asarray(cdist(a, b, "sqeuclidean"))


def jumps(points: FloatArray, cell: IntArray, side: int) -> float:
    """Share of the pairs of neighbouring filled cells whose points are far apart in space."""
    image = np.full((side * side, 3), np.nan)
    image[cell] = points
    grid = image.reshape(side, side, 3)
    steps = [np.linalg.norm(np.diff(grid, axis=axis), axis=2).reshape(-1) for axis in (0, 1)]
    apart = np.concatenate(steps)
    apart = apart[np.isfinite(apart)]
    return float((apart > JUMP * mean_spacing(points)).mean())
