"""The frame of the methods that place points on a square grid, trained on this one surface."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from baselines.neural.method import NeuralMethod
from baselines.neural.point_grid import centres, jumps, side_for
from parapoint.surfaces.parameterization import Parameterization, PointParameterization, TracePoint
from parapoint.surfaces.sampling import training_points
from parapoint.surfaces.surface import FloatArray, IntArray, Mesh, Surface


@dataclass(frozen=True)
class GridMethod(NeuralMethod):
    """Base class: each point of a cloud, or vertex of a mesh, in a cell of its own.

    The uv of a point is the centre of its cell, so that no two coincide. The faces of a mesh play
    no part: as many vertices, as much of the square.

    Attributes:
        points: points that the networks are trained on, drawn from those that are placed.
        iterations: steps.
        subset: points of a step, at most.
        time_budget: processor time of the training in seconds, at most; the schedule follows the
            time where that ends sooner.
    """

    points: int = 10_000
    iterations: int = 8_000
    subset: int = 576
    time_budget: float | None = None

    packages: ClassVar[tuple[str, ...]] = ("torch", "scipy")
    on_cpu: ClassVar[bool] = True

    def cells(
        self, points: FloatArray, drawn: FloatArray, side: int, seed: int
    ) -> tuple[IntArray, tuple[TracePoint, ...], Mapping[str, object]]:
        """(N,) the cell of each point, the trace of the training, and what else is to report.

        Args:
            points: (N, 3), centred, largest norm about 1.
            drawn: (n, 3) those of them that the networks are trained on.
            side: cells on a side of the grid.
            seed: of all random draws.
        """
        raise NotImplementedError

    def parameterize(
        self, surface: Surface, *, seed: int
    ) -> Parameterization | PointParameterization:
        """The map at the vertices of a mesh or the points of a cloud, in the unit of the surface.

        Raises:
            InputError: fewer than 100 distinct points, or all on a line.
        """
        cloud = training_points(surface, self.points, seed)
        centre = (cloud.min(axis=0) + cloud.max(axis=0)) / 2
        scale = float(np.linalg.norm(cloud - centre, axis=1).max())
        everywhere = (
            surface.vertices[surface.referenced] if isinstance(surface, Mesh) else surface.points
        )
        points = (everywhere - centre) / scale
        count = min(self.points, len(points))
        chosen = np.random.default_rng(seed).choice(len(points), count, replace=False)
        side = side_for(len(points))
        cell, trace, more = self.cells(points, points[np.sort(chosen)], side, seed)
        uv = scale * centres(side)[cell]
        report: dict[str, object] = {
            "points": count,
            "iterations": len(trace),
            "losses": dict(trace[-1].values) if trace else {},
            "side": side,
            "filled_cells": len(points) / side**2,
            "collisions": len(points) - len(np.unique(cell)),
            "jumps": jumps(points, cell, side),
            **more,
        }
        if isinstance(surface, Mesh):
            corners = np.unique(surface.faces, return_inverse=True)[1].reshape(-1, 3)
            return Parameterization(uv, corners, trace, report)
        return PointParameterization(uv, trace, report)
