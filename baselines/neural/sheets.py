"""What networks share that fold squares onto a surface: the fit, and the way back to the squares.

Such a network maps the plane to space; a parameterization goes the other way. The uv of a point is
its nearest preimage: the nearest of a grid of samples of each sheet, refined by Gauss-Newton steps.
Where several sheets cover the surface each one is a chart, and these are packed. A face of a mesh
lies in the chart of most of its corners; vertices at the border of charts have a uv in each.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np
import torch
from torch import Tensor, nn

from parapoint import clock
from parapoint.learned.losses import EPSILON, nearest
from parapoint.learned.optimizers import AdamW
from parapoint.surfaces.parameterization import TracePoint
from parapoint.surfaces.preparation import shelves
from parapoint.surfaces.surface import FloatArray, IntArray

Sheet = Callable[[Tensor], Tensor]
"""(1 + T, N, 2) places in the square from -1 to 1, and tangents there → (1 + T, N, 3)."""

RATE = 1e-3
"""Learning rate of AdamW at the start; it falls to 0 like a cosine."""
SAMPLES = 96
"""Samples along a side of a sheet among which a preimage is sought."""
NEWTON_STEPS = 6
"""Gauss-Newton steps that refine a preimage."""
BATCH = 4_096
"""Points whose preimages are refined at a time."""


class Sheets(nn.Module):
    """Networks of one or more sheets.

    Attributes:
        sheets: see `Sheet`.
    """

    def __init__(self, sheets: list[nn.Module]) -> None:
        super().__init__()
        self.sheets = nn.ModuleList(sheets)

    def terms(self, given: Tensor, count: int, generator: torch.Generator) -> dict[str, Tensor]:
        """The loss on points (N, 3) of the surface and `count` random places of the sheets."""
        raise NotImplementedError


def fitted(
    networks: nn.Module,
    terms: Callable[[], dict[str, Tensor]],
    iterations: int,
    time_budget: float | None,
) -> Iterator[TracePoint]:
    """Train networks on the sum of the terms, a step at a time, until the steps or the time end."""
    began = clock.worked()
    optimizer = AdamW(list(networks.parameters()))
    for step in range(1, iterations + 1):
        seconds = clock.worked() - began
        progress = max((step - 1) / iterations, seconds / (time_budget or math.inf))
        if progress >= 1:
            return
        found = terms()
        total = torch.stack(list(found.values())).sum()
        total.backward()  # type: ignore[no-untyped-call]
        optimizer.step(RATE * (1 + math.cos(math.pi * progress)) / 2)
        values = {name: term.item() for name, term in found.items()} | {"total": total.item()}
        yield TracePoint(step, clock.worked() - began, values)


def with_axes(uv: Tensor) -> Tensor:
    """(3, N, 2) the places (N, 2) and the two axes as tangents there."""
    axes = torch.eye(2, dtype=uv.dtype)[:, None].expand(2, len(uv), 2)
    return torch.cat([uv[None], axes])


@torch.no_grad()
def preimages(sheet: Sheet, points: Tensor) -> tuple[Tensor, Tensor]:
    """(N, 2) the place in the square whose image is nearest to each point (N, 3), (N,) how near."""
    steps = torch.linspace(-1, 1, SAMPLES)
    grid = torch.cartesian_prod(steps, steps)
    uv = grid[nearest(points, sheet(grid[None])[0], 1)[:, 0]]
    batches = zip(torch.split(uv, BATCH), torch.split(points, BATCH), strict=True)
    parts = [_refined(sheet, *batch) for batch in batches]
    found, distance = (torch.cat(of) for of in zip(*parts, strict=True))
    return found, distance


def _refined(sheet: Sheet, uv: Tensor, points: Tensor) -> tuple[Tensor, Tensor]:
    best = torch.full((len(uv),), math.inf)
    kept = uv
    for _ in range(NEWTON_STEPS):
        made, *tangents = sheet(with_axes(uv))
        away = points - made
        distance = away.norm(dim=1)
        kept = torch.where((distance < best)[:, None], uv, kept)
        best = torch.minimum(distance, best)
        jacobian = torch.stack(tangents, dim=2)
        gram = jacobian.mT @ jacobian + EPSILON * torch.eye(2)
        solved, _ = torch.linalg.solve_ex(gram, jacobian.mT @ away[:, :, None])
        move = solved[:, :, 0].nan_to_num(0, 0, 0)  # where the sheet is folded flat it stays
        uv = (uv + move).clamp(-1, 1)
    return kept, best


def nearest_sheets(
    sheets: Sequence[Sheet], points: Tensor
) -> tuple[IntArray, FloatArray, FloatArray]:
    """(N,) the sheet nearest to each point (N, 3), (N, 2) the place on it, and (N,) how near."""
    found = [preimages(sheet, points) for sheet in sheets]
    distance = torch.stack([of for _, of in found])
    chart = distance.argmin(dim=0)
    uv = torch.stack([of for of, _ in found])[chart, torch.arange(len(points))]
    return chart.numpy(), uv.numpy().astype(np.float64), distance.amin(dim=0).numpy()


def packed(uv: FloatArray, chart: IntArray, area: FloatArray) -> FloatArray:
    """(R, 2) the rows of all charts side by side, each square of a side that fits its area.

    Args:
        uv: (R, 2) in the squares from -1 to 1.
        chart: (R,) the chart of each row.
        area: (K,) share of the surface that each chart covers.
    """
    side = np.sqrt(np.maximum(area, 0))
    corner = np.zeros((len(area), 2))
    used = side > 0
    corner[used] = shelves(np.repeat(side[used][:, None], 2, axis=1))
    return np.asarray(corner[chart] + (uv + 1) / 2 * side[chart][:, None])


def face_charts(chart: IntArray, faces: IntArray) -> IntArray:
    """(F,) the chart of most corners of each face, of the first one where all differ."""
    a, b, c = chart[faces].T
    return np.asarray(np.where(b == c, b, a))


def corner_rows(of_face: IntArray, faces: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """(F, 3) rows of uv for the corners; (R,) the vertex of each row, and (R,) its chart."""
    pairs = np.stack([faces.reshape(-1), np.repeat(of_face, 3)], axis=1)
    rows, corners = np.unique(pairs, axis=0, return_inverse=True)
    return corners.reshape(-1, 3), rows[:, 0], rows[:, 1]


def random_places(count: int, generator: torch.Generator) -> Tensor:
    """(count, 2) random places of the square from -1 to 1."""
    return 2 * torch.rand(count, 2, generator=generator) - 1
