"""Networks of Neural Surface Maps (`baselines.neural.nsm`)."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from parapoint.learned.networks import ACTIVATIONS, Stack

WIDTH, BLOCKS = 128, 4
"""Channels and residual blocks of the surface map."""
REFINED = (64, 64)
"""Hidden layers of the map that refines."""


class SurfaceMap(nn.Module):
    """The neural surface map f: R² → R³, a residual network."""

    def __init__(self, generator: torch.Generator) -> None:
        super().__init__()
        smooth = ACTIVATIONS["squareplus"]
        self.first = Stack(2, WIDTH, (), smooth, generator)
        self.blocks = nn.ModuleList(
            Stack(WIDTH, WIDTH, (WIDTH,), smooth, generator) for _ in range(BLOCKS)
        )
        self.last = Stack(WIDTH, 3, (), smooth, generator)

    def forward(self, x: Tensor) -> Tensor:
        """(1 + T, N, 2) places and tangents → (1 + T, N, 3)."""
        h = self.first(x)
        for block in self.blocks:
            h = h + block(h)
        made: Tensor = self.last(h)
        return made


class Refinement(nn.Module):
    """The map h: R² → R² of the plane to itself; it begins as the identity."""

    def __init__(self, generator: torch.Generator) -> None:
        super().__init__()
        self.offset = Stack(2, 2, REFINED, ACTIVATIONS["squareplus"], generator)
        nn.init.zeros_(list(self.offset.layers)[-1])

    def forward(self, x: Tensor) -> Tensor:
        """(1 + T, N, 2) → (1 + T, N, 2)."""
        moved: Tensor = x + self.offset(x)
        return moved


def jacobians(pushed: Tensor) -> Tensor:
    """(N, C, 2) of what a network made of `with_axes`."""
    return pushed[1:].permute(1, 2, 0)
