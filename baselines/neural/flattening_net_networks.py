"""The sheet of Flattening-Net (`baselines.neural.flattening_net`)."""

from __future__ import annotations

import math

import numpy as np
import torch
from scipy.optimize import linear_sum_assignment
from torch import Tensor

from baselines.neural.foldingnet_networks import TwoFolds
from baselines.neural.point_grid import centres, squared_distances
from baselines.neural.sheets import fitted
from parapoint.surfaces.parameterization import TracePoint
from parapoint.surfaces.surface import FloatArray


def folded(
    points: FloatArray,
    side: int,
    subset: int,
    iterations: int,
    time_budget: float | None,
    *,
    seed: int,
) -> tuple[FloatArray, tuple[TracePoint, ...]]:
    """(side², 3) where a sheet that is folded onto points (N, 3) has the cells of a grid; a trace.

    Args:
        points: centred, largest norm about 1.
        side: cells on a side of the grid.
        subset: points of a step, at most.
        iterations: steps at most.
        time_budget: processor time in seconds at most.
        seed: of all random draws.
    """
    generator = torch.Generator().manual_seed(seed)
    sheet = TwoFolds(generator)
    given = torch.as_tensor(points, dtype=torch.float32)
    coarse = math.isqrt(min(subset, len(given)))
    lattice = torch.as_tensor(centres(coarse), dtype=torch.float32)[None]

    def terms() -> dict[str, Tensor]:
        chosen = given[torch.randperm(len(given), generator=generator)[: coarse**2]]
        return {"transport": transport(sheet(lattice)[0], chosen)}

    trace = tuple(fitted(sheet, terms, iterations, time_budget))
    with torch.no_grad():
        parts = [
            sheet(part[None])[0]
            for part in torch.split(torch.as_tensor(centres(side), dtype=torch.float32), 4_096)
        ]
    return torch.cat(parts).numpy().astype(np.float64), trace


def transport(made: Tensor, given: Tensor) -> Tensor:
    """Mean squared distance of points (N, 3) from as many others, assigned at the least cost."""
    cost = squared_distances(made.detach().numpy(), given.numpy())
    rows, columns = (torch.as_tensor(of) for of in linear_sum_assignment(cost))
    return (made[rows] - given[columns]).square().sum(1).mean()
