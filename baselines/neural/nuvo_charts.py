"""The map of several charts in the manner of Nuvo (`baselines.neural.nuvo`)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from baselines.neural.nuvo_charts_training import WEIGHTS, ChartNetworks, chart_terms
from baselines.neural.sheets import corner_rows, packed
from baselines.neural.stepping import trained
from parapoint import clock
from parapoint.surfaces.normals import tangent_frames
from parapoint.surfaces.parameterization import Parameterization, PointParameterization, TracePoint
from parapoint.surfaces.sampling import training_points
from parapoint.surfaces.surface import FloatArray, IntArray, Mesh, Surface

if TYPE_CHECKING:
    from baselines.neural.nuvo import Nuvo

MOST_POINTS = 128
"""Points of a step at most: each of them goes through the networks of all charts."""
RATE = 2e-2
"""Learning rate at the start; it falls to 0."""


def charted(method: Nuvo, surface: Surface, seed: int) -> Parameterization | PointParameterization:
    """The map of `method`, whose charts are more than one.

    Raises:
        InputError: fewer than 100 distinct points, or all on a line.
    """
    began = clock.worked()
    cloud = training_points(surface, method.points, seed)
    centre = (cloud.min(axis=0) + cloud.max(axis=0)) / 2
    scale = float(np.linalg.norm(cloud - centre, axis=1).max())
    inside = (cloud - centre) / scale
    rows = torch.as_tensor(np.concatenate([inside[None], tangent_frames(inside)])).float()
    generator = torch.Generator().manual_seed(seed)
    networks = ChartNetworks(method.charts, generator)
    size = min(method.subset, MOST_POINTS, len(cloud))

    def terms() -> dict[str, Tensor]:
        chosen = torch.randperm(len(cloud), generator=generator)[: 4 * size]
        square = torch.rand(method.charts, -(-size // method.charts), 2, generator=generator)
        found = chart_terms(networks, rows[:, chosen[:size]], square, rows[0, chosen])
        return {name: WEIGHTS[name] * of for name, of in found.items()}

    steps = trained(networks, terms, RATE, method.iterations, method.time_budget)
    trace = tuple(
        TracePoint(number, clock.worked() - began, values) for number, values in enumerate(steps, 1)
    )
    everywhere = surface.vertices if isinstance(surface, Mesh) else surface.points
    places = everywhere
    if isinstance(surface, Mesh):
        places = surface.vertices[surface.faces].mean(axis=1)
    at, decided = (
        torch.as_tensor((of - centre) / scale, dtype=torch.float32) for of in (everywhere, places)
    )
    with torch.no_grad():
        chart = networks.log_probabilities(decided).argmax(dim=1).numpy().astype(np.int64)
    report: dict[str, object] = {
        "points": len(cloud),
        "points_of_a_step": size,
        "iterations": len(trace),
        "weights": WEIGHTS,
        "losses": dict(trace[-1].values) if trace else {},
        "charts": len(np.unique(chart)),
    }

    def placed(vertex: IntArray, of_row: IntArray, area: FloatArray) -> FloatArray:
        uv = np.empty((len(vertex), 2))
        for number in range(method.charts):
            mine = of_row == number
            if mine.any():
                with torch.no_grad():
                    uv[mine] = networks.texture(number, at[torch.as_tensor(vertex[mine])][None])[0]
        share = np.bincount(chart, area, method.charts) / area.sum()
        return scale * packed(2 * uv - 1, of_row, share)

    if not isinstance(surface, Mesh):
        uv = placed(np.arange(len(at)), chart, np.ones(len(at)))
        return PointParameterization(uv, trace, report)
    corners, vertex, of_row = corner_rows(chart, surface.faces)
    return Parameterization(placed(vertex, of_row, surface.face_areas), corners, trace, report)
