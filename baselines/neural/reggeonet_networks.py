"""The embedding of RegGeoNet's anchors (`baselines.neural.reggeonet`)."""

from __future__ import annotations

import numpy as np
import torch
from scipy.spatial import cKDTree
from torch import Tensor, nn

from baselines.neural.sheets import fitted
from parapoint.learned.losses import EPSILON
from parapoint.learned.networks import ACTIVATIONS, Stack
from parapoint.surfaces.parameterization import TracePoint
from parapoint.surfaces.surface import FloatArray

HIDDEN = (128, 128, 128)
NEIGHBOURS = 6
"""Nearest anchors in space that are kept together."""
APART = 1.5
"""Distance in the square below which anchors repel each other, in cells of their grid."""
SMOOTHNESS = 0.3
"""Weight of the squared distances of neighbours beside the repulsion, both in cells."""
RECONSTRUCTION = 1e3
"""Weight of the squared error of anchors that are read back, in radii of the cloud, squared."""


def embedded(
    anchors: FloatArray, iterations: int, time_budget: float | None, *, seed: int
) -> tuple[FloatArray, tuple[TracePoint, ...]]:
    """(A, 2) places of anchors (A, 3) in the square from -1 to 1, and the trace of the training."""
    generator = torch.Generator().manual_seed(seed)
    activation = ACTIVATIONS["squareplus"]
    there = Stack(3, 2, HIDDEN, activation, generator)
    back = Stack(2, 3, HIDDEN, activation, generator)
    given = torch.as_tensor(anchors, dtype=torch.float32)
    count = min(NEIGHBOURS, len(anchors) - 1)
    near = torch.as_tensor(cKDTree(anchors).query(anchors, count + 1)[1].reshape(-1, count + 1))

    def terms() -> dict[str, Tensor]:
        places = torch.tanh(there(given[None])[0])
        read = back(places[None])[0]
        return {
            "repulsion": repulsion(places),
            "smoothness": SMOOTHNESS * smoothness(places, near[:, 1:]),
            "reconstruction": RECONSTRUCTION * (read - given).square().sum(1).mean(),
        }

    trace = tuple(fitted(nn.ModuleList([there, back]), terms, iterations, time_budget))
    with torch.no_grad():
        found = torch.tanh(there(given[None])[0])
    return found.numpy().astype(np.float64), trace


def repulsion(places: Tensor) -> Tensor:
    """Mean, over places (A, 2), of the squares by which others come too near, in cells."""
    square = (places[:, None] - places[None]).square().sum(2) * len(places) / 4
    far_from_itself = APART**2 * torch.eye(len(places))
    apart = (square + far_from_itself).clamp(min=EPSILON).sqrt()
    return (APART - apart).clamp(min=0).square().sum(1).mean()


def smoothness(places: Tensor, near: Tensor) -> Tensor:
    """Mean squared distance of places (A, 2) from those of neighbours (A, k), in cells."""
    if not near.numel():
        return torch.zeros(())
    square = (places[:, None] - places[near]).square().sum(2)
    return square.mean() * len(places) / 4
