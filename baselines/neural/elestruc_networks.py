"""Networks of EleStruc (`baselines.neural.elestruc`); the loss is AtlasNet's."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from baselines.neural.atlasnet_networks import HIDDEN, AtlasNetworks
from baselines.neural.sheets import Sheets
from parapoint.learned.networks import ACTIVATIONS, Stack


class Structure(nn.Module):
    """A square deformed in n dimensions, then adjusted to the surface."""

    def __init__(self, dimension: int, generator: torch.Generator) -> None:
        super().__init__()
        activation = ACTIVATIONS["squareplus"]
        self.deformation = Stack(2, dimension, HIDDEN, activation, generator)
        with torch.no_grad():
            self.deformation.layers[-1].zero_()
        self.adjustment = Stack(dimension, 3, HIDDEN, activation, generator)

    def elementary(self, x: Tensor) -> Tensor:
        """(1 + T, N, 2) places in the square → (1 + T, N, n) on the elementary structure."""
        offset: Tensor = self.deformation(x)
        return offset + nn.functional.pad(x, (0, offset.shape[2] - 2))

    def forward(self, x: Tensor) -> Tensor:
        """(1 + T, N, 2) → (1 + T, N, 3)."""
        made: Tensor = self.adjustment(self.elementary(x))
        return made


class EleStrucNetworks(AtlasNetworks):
    """A structure for each chart; all together are held against the surface."""

    def __init__(self, charts: int, dimension: int, generator: torch.Generator) -> None:
        Sheets.__init__(self, [Structure(dimension, generator) for _ in range(charts)])
