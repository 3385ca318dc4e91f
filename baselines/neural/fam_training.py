"""Networks and losses of Flatten Anything (`baselines.neural.fam`)."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import cosine_similarity, l1_loss

from baselines.neural.training import SurfaceTrainer
from parapoint.learned import losses
from parapoint.learned.networks import ACTIVATIONS, Activation, OffsetStack, Stack, SubNetworks
from parapoint.surfaces.surface import FloatArray

NARROW, DEEP = (512, 512), (512, 512, 512)
"""Hidden layers of Cut and Unwrap, of Deform and Wrap."""
EMBEDDING = 64
"""Channels of each embedding."""
REPULSION_NEIGHBOURS, REPULSION_SPACING = 8, 0.25
"""Of the unwrapping loss; ε is the spacing times L(Q) / √N."""


class JoinedStack(torch.nn.Module):
    """Φ([Φ(x); x]): an embedding beside the point itself."""

    def __init__(
        self,
        channels: tuple[int, int],
        hidden: tuple[int, ...],
        activation: Activation,
        generator: torch.Generator,
    ) -> None:
        super().__init__()
        inputs, outputs = channels
        self.embed = Stack(inputs, EMBEDDING, hidden, activation, generator)
        self.join = Stack(EMBEDDING + inputs, outputs, hidden, activation, generator)

    def forward(self, x: Tensor) -> Tensor:
        """(1 + T, N, inputs) points and tangents → (1 + T, N, outputs)."""
        joined: Tensor = self.join(torch.cat([self.embed(x), x], dim=2))
        return joined


class Positions(torch.nn.Module):
    """In the place of Stitch: the positions of positions and normals."""

    def forward(self, x: Tensor) -> Tensor:
        """(1 + T, N, 6) → (1 + T, N, 3)."""
        return x[:, :, :3]


class FAMNetworks(SubNetworks):
    """Deform, Cut, Unwrap, and a Wrap 2→6 that gives positions and normals; there is no Stitch."""

    def __init__(self, generator: torch.Generator) -> None:
        super().__init__()
        activation = ACTIVATIONS["leaky_relu"]
        self.deform = OffsetStack(2, EMBEDDING, DEEP, activation, generator)
        self.wrap = JoinedStack((2, 6), DEEP, activation, generator)
        self.stitch = Positions()
        self.cut = OffsetStack(3, EMBEDDING, NARROW, activation, generator)
        self.unwrap = Stack(3, 2, NARROW, activation, generator)


class FAMTrainer(SurfaceTrainer):
    """The objective of Flatten Anything: wrapping, unwrapping, cycle and distortion."""

    weights: ClassVar[dict[str, float]] = {
        "wrap": 1.0,
        "unwrap": 0.01,
        "cycle": 0.01,
        "distortion": 0.01,
    }

    def new_networks(self, generator: torch.Generator) -> FAMNetworks:
        """See `SurfaceTrainer`."""
        return FAMNetworks(generator)

    def prepared(self, points: FloatArray) -> Tensor:
        """(2, N, 3) points and normals, (1, N, 3) without normals."""
        rows = points[None] if self.normals is None else np.stack([points, self.normals])
        return torch.as_tensor(rows, dtype=torch.float32, device=self.device)

    def terms(self, points: Tensor, grid: Tensor, given: Tensor) -> dict[str, Tensor]:
        """See `Trainer`; `points` are followed by their normals."""
        there, back = self.networks(points[:1], grid)
        first, second = losses.gram_eigenvalues(there.tangents)
        cycle = l1_loss(there.points_cycle, there.points) + l1_loss(back.uv_cycle, back.uv)
        if self.normals is not None:
            made_normals = there.cut_cycle[:, 3:]
            cycle = cycle + (1 - cosine_similarity(made_normals, points[1], dim=1)).mean()
        return {
            "wrap": losses.wrap_loss(back.points, given),
            "unwrap": torch.stack([repulsion(q) for q in (there.uv, back.uv, back.uv_cycle)]).sum(),
            "cycle": cycle,
            "distortion": losses.conformal_loss(first, second),
        }


def repulsion(uv: Tensor) -> Tensor:
    """The unwrapping loss of one set of (N, 2) points."""
    return losses.unwrap_loss(uv, REPULSION_NEIGHBOURS, REPULSION_SPACING)
