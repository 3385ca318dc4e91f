"""The frame of the methods that fold squares onto a surface, fitted to this one surface."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from baselines.neural.method import NeuralMethod
from parapoint.surfaces.parameterization import Parameterization, PointParameterization
from parapoint.surfaces.sampling import training_points
from parapoint.surfaces.surface import FloatArray, Mesh, Surface

if TYPE_CHECKING:
    import torch
    from torch import Tensor

    from baselines.neural.sheets import Sheet, Sheets


@dataclass(frozen=True)
class SheetMethod(NeuralMethod):
    """Base class: networks from the plane to space, and uv by the nearest preimage.

    The encoder of such a method, which tells shapes apart, is left out: the networks are fitted to
    one surface, whose code is then no more than a bias of their first layer.
    """

    points: int = 10_000
    iterations: int = 4_000
    subset: int = 1_024
    time_budget: float | None = None

    on_cpu: ClassVar[bool] = True

    def networks(self, generator: torch.Generator) -> Sheets:
        """Networks to fit, their weights drawn from `generator`."""
        raise NotImplementedError

    def parameterize(
        self, surface: Surface, *, seed: int
    ) -> Parameterization | PointParameterization:
        """The map at the vertices of a mesh or the points of a cloud, in the unit of the surface.

        Raises:
            InputError: fewer than 100 distinct points, or all on a line.
        """
        import torch

        from baselines.neural.sheets import (
            corner_rows,
            face_charts,
            fitted,
            nearest_sheets,
            packed,
            preimages,
        )

        cloud = training_points(surface, self.points, seed)
        centre = (cloud.min(axis=0) + cloud.max(axis=0)) / 2
        scale = float(np.linalg.norm(cloud - centre, axis=1).max())
        generator = torch.Generator().manual_seed(seed)
        networks = self.networks(generator)
        given = torch.as_tensor((cloud - centre) / scale, dtype=torch.float32)

        def terms() -> dict[str, Tensor]:
            chosen = torch.randperm(len(given), generator=generator)[: self.subset]
            return networks.terms(given[chosen], min(self.subset, len(given)), generator)

        trace = tuple(fitted(networks, terms, self.iterations, self.time_budget))
        everywhere = surface.vertices if isinstance(surface, Mesh) else surface.points
        at = torch.as_tensor((everywhere - centre) / scale, dtype=torch.float32)
        sheets: list[Sheet] = list(networks.sheets)
        chart, uv, distance = nearest_sheets(sheets, at)
        report: dict[str, object] = {
            "points": len(cloud),
            "points_of_a_step": min(self.subset, len(given)),
            "iterations": len(trace),
            "losses": dict(trace[-1].values) if trace else {},
            "charts": len(np.unique(chart)),
            "rms_distance": float(np.sqrt((distance**2).mean())),
        }
        if not isinstance(surface, Mesh):
            share = np.bincount(chart, minlength=len(sheets)) / len(chart)
            return PointParameterization(scale * packed(uv, chart, share), trace, report)
        of_face = face_charts(chart, surface.faces)
        corners, vertex, of_row = corner_rows(of_face, surface.faces)
        rows = np.empty((len(vertex), 2))
        for number, sheet in enumerate(sheets):
            mine = of_row == number
            if mine.any():
                rows[mine] = preimages(sheet, at[torch.as_tensor(vertex[mine])])[0].numpy()
        share = np.bincount(of_face, surface.face_areas, len(sheets)) / surface.face_areas.sum()
        placed: FloatArray = scale * packed(rows, of_row, share)
        return Parameterization(placed, corners, trace, report)
