"""Networks and losses of a chart in the manner of Nuvo (`baselines.neural.nuvo`)."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
import torch
from torch import Tensor, nn

from baselines.neural.training import SurfaceTrainer
from parapoint.learned import losses
from parapoint.learned.networks import LeakyReLU, Stack, SurfaceNetworks
from parapoint.surfaces.normals import tangent_frames
from parapoint.surfaces.surface import FloatArray

HIDDEN = (256,) * 7
OCTAVES = 4
"""Of the positional encoding."""


def encoded(x: Tensor) -> Tensor:
    """(1 + T, N, C) points and tangents → (1 + T, N, C (1 + 2 OCTAVES)): x, sin and cos of octaves.

    Of a point, sin 2^k π x and cos 2^k π x for k = 1 ... OCTAVES; a tangent t is pushed forward.
    """
    point, tangents = x[:1], x[1:]
    rows = [x]
    for octave in range(1, OCTAVES + 1):
        rate = 2**octave * math.pi
        sine, cosine = torch.sin(rate * point), torch.cos(rate * point)
        rows.append(torch.cat([sine, rate * cosine * tangents]))
        rows.append(torch.cat([cosine, -rate * sine * tangents]))
    return torch.cat(rows, dim=2)


class NuvoNetworks(SurfaceNetworks):
    """Texture coordinates t: R³ → [0, 1]² and surface coordinates s: R² → R³ of one chart.

    Attributes:
        sigma: the learned area of the images of unit squares.
    """

    def __init__(self, generator: torch.Generator) -> None:
        super().__init__()
        rectifier, features = LeakyReLU(0.0), 1 + 2 * OCTAVES
        self.texture_stack = Stack(3 * features, 2, HIDDEN, rectifier, generator)
        self.surface_stack = Stack(2 * features, 3, HIDDEN, rectifier, generator)
        self.sigma = nn.Parameter(torch.ones(()))

    def texture(self, x: Tensor) -> Tensor:
        """(1 + T, N, 3) points and tangents → (1 + T, N, 2)."""
        z: Tensor = self.texture_stack(encoded(x))
        uv = torch.sigmoid(z[:1])
        return torch.cat([uv, uv * (1 - uv) * z[1:]])

    def parameterization(self, points: Tensor) -> Tensor:
        """t: (N, 3) → (N, 2)."""
        return self.texture(points[None])[0]

    def surface(self, uv: Tensor) -> Tensor:
        """s: (N, 2) → (N, 3)."""
        points: Tensor = self.surface_stack(encoded(uv[None]))[0]
        return points


class NuvoTrainer(SurfaceTrainer):
    """The terms of Nuvo that one chart leaves (no entropy, no clusters, no texture)."""

    weights: ClassVar[dict[str, float]] = {
        "three_two_three": 1.0,
        "two_three_two": 1.0,
        "surface": 10.0,
        "conformal": 0.4,
        "stretch": 0.1,
    }

    networks: NuvoNetworks

    def new_networks(self, generator: torch.Generator) -> NuvoNetworks:
        """See `SurfaceTrainer`."""
        return NuvoNetworks(generator)

    def prepared(self, points: FloatArray) -> Tensor:
        """(3, N, 3) points and two orthonormal tangents at each."""
        rows = np.concatenate([points[None], tangent_frames(points)])
        return torch.as_tensor(rows, dtype=torch.float32, device=self.device)

    def terms(self, points: Tensor, grid: Tensor, given: Tensor) -> dict[str, Tensor]:
        """See `Trainer`; `points` are followed by their tangents."""
        networks = self.networks
        square = (grid + 1) / 2
        mapped = networks.texture(points)
        made = networks.surface(square)
        a, b = mapped[1], mapped[2]
        lengths = (a.square().sum(1) * b.square().sum(1)).clamp(min=losses.EPSILON)
        area = (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).abs()
        return {
            "three_two_three": squared_distance(networks.surface(mapped[0]), points[0]),
            "two_three_two": squared_distance(networks.parameterization(made), square),
            "surface": squared_distance(given, made[losses.nearest(given, made, 1)[:, 0]])
            + squared_distance(made, given[losses.nearest(made, given, 1)[:, 0]]),
            "conformal": ((a * b).sum(1).square() / lengths).mean(),
            "stretch": (area - networks.sigma).square().mean(),
        }


def squared_distance(first: Tensor, second: Tensor) -> Tensor:
    """Mean squared distance of (N, d) points."""
    return (first - second).square().sum(1).mean()
