"""RegGeoNet: the points of a cloud on a square grid, by anchors and the patches around them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from baselines.neural.grid_method import GridMethod
from baselines.neural.point_grid import arranged, blocks, centres, squared_distances
from parapoint.surfaces.parameterization import TracePoint
from parapoint.surfaces.surface import FloatArray, IntArray

PATCH = 4
"""Cells on the side of a patch, about; more where the grid has more anchors than a step takes."""


@dataclass(frozen=True)
class RegGeoNet(GridMethod):
    """Anchors embedded in the square by a network; around each, its patch on a small grid.

    Q. Zhang, J. Hou, Y. Qian, A. B. Chan, J. Zhang and Y. He 2022, "RegGeoNet: learning regular
    representations for large-scale 3D point clouds". From coarse to fine: anchors, far from one
    another, are embedded in the square by a fully connected network that keeps them apart and
    neighbours together, and go to the cells of a coarse grid; then each one's patch of points is
    flattened by itself onto the small grid that its cell is. The small grids together are the deep
    geometry image. Stand-ins for ours: a second network, which reads anchors back from their
    places, keeps the two sides of a body from mixing; the plane of a patch, turned towards the
    anchors around, is its flattening. A patch knows nothing of the next one: they join with steps.
    """

    def cells(
        self, points: FloatArray, drawn: FloatArray, side: int, seed: int
    ) -> tuple[IntArray, tuple[TracePoint, ...], Mapping[str, object]]:
        """See `GridMethod`."""
        from baselines.neural.reggeonet_networks import embedded

        most = math.isqrt(min(self.subset, len(drawn)))
        coarse = max(1, min(round(side / PATCH), most))
        anchors = farthest(drawn, coarse**2)
        placed, trace = embedded(anchors, self.iterations, self.time_budget, seed=seed)
        grid = np.empty((coarse**2, 3))
        chosen, where = linear_sum_assignment(squared_distances(placed, centres(coarse)))
        grid[where] = anchors[chosen]
        ahead = steps_ahead(grid.reshape(coarse, coarse, 3))
        block = blocks(side, coarse)
        of_cell = block @ [coarse, 1]

        def costs(rows: IntArray, cells: IntArray) -> FloatArray:
            target = centres(side)[cells]
            local = flattened(points[rows], ahead[of_cell[cells[0]]])
            return squared_distances(fitted_to(local, target), target)

        cell = arranged(points, grid[of_cell], block, costs)
        return cell, trace, {"anchors": coarse**2}


def farthest(points: FloatArray, count: int) -> FloatArray:
    """(count, 3) of the points, each the farthest from those before it."""
    chosen = [int(np.linalg.norm(points - points.mean(axis=0), axis=1).argmax())]
    distance = np.full(len(points), np.inf)
    for _ in range(count - 1):
        distance = np.minimum(distance, ((points - points[chosen[-1]]) ** 2).sum(axis=1))
        chosen.append(int(distance.argmax()))
    return points[chosen]


def steps_ahead(grid: FloatArray) -> FloatArray:
    """(A², 2, 3) the way in space from each anchor (A, A, 3) to the next row and column."""
    if len(grid) == 1:
        return np.eye(3)[None, :2]
    return np.stack([np.gradient(grid, axis=axis) for axis in (0, 1)], axis=2).reshape(-1, 2, 3)


def flattened(points: FloatArray, ahead: FloatArray) -> FloatArray:
    """(n, 2) a patch in its plane, turned or mirrored so that its axes run along `ahead` (2, 3)."""
    centred = points - points.mean(axis=0)
    plane = np.linalg.eigh(centred.T @ centred)[1][:, 1:].T
    left, _, right = np.linalg.svd(ahead @ plane.T)  # orthogonal Procrustes
    return np.asarray(centred @ plane.T @ (left @ right).T)


def fitted_to(local: FloatArray, target: FloatArray) -> FloatArray:
    """(n, 2) places, moved and stretched along the axes to fill the box of the target (m, 2)."""
    low, size = local.min(axis=0), np.ptp(local, axis=0)
    unit = (local - low) / np.where(size > 0, size, 1.0)
    return np.asarray(target.min(axis=0) + unit * np.ptp(target, axis=0))
