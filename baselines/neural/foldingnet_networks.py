"""Networks and loss of FoldingNet (`baselines.neural.foldingnet`)."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from baselines.neural.sheets import Sheets, random_places
from parapoint.learned.losses import wrap_loss
from parapoint.learned.networks import ACTIVATIONS, Stack

HIDDEN = (256, 256)


class TwoFolds(nn.Module):
    """The second folding takes what the first has made of the plane, not the plane itself."""

    def __init__(self, generator: torch.Generator) -> None:
        super().__init__()
        activation = ACTIVATIONS["squareplus"]
        self.first = Stack(2, 3, HIDDEN, activation, generator)
        self.second = Stack(3, 3, HIDDEN, activation, generator)

    def forward(self, x: Tensor) -> Tensor:
        """(1 + T, N, 2) → (1 + T, N, 3)."""
        folded: Tensor = self.second(self.first(x))
        return folded


class FoldingNetworks(Sheets):
    """One sheet."""

    def terms(self, given: Tensor, count: int, generator: torch.Generator) -> dict[str, Tensor]:
        """The larger of the mean distances of either set to the other."""
        made = self.sheets[0](random_places(count, generator)[None])[0]
        return {"chamfer": wrap_loss(made, given)}
