"""FoldingNet: one square, folded twice."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from baselines.neural.sheet_method import SheetMethod, Sheets, random_places
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
        """The larger of the mean distances of either set to the other (equation 1)."""
        made = self.sheets[0](random_places(count, generator)[None])[0]
        return {"chamfer": wrap_loss(made, given)}


@dataclass(frozen=True)
class FoldingNet(SheetMethod):
    """One square folded onto the surface by two networks, one after another.

    Y. Yang, C. Feng, Y. Shen and D. Tian 2018, "FoldingNet: point cloud auto-encoder via deep grid
    deformation". The first folding maps the square to space, the second moves what came out; the
    greater of the two Chamfer distances is brought down. Only where points lie counts, so that the
    sheet may fold over itself and closes a sphere by wrinkles. Left out: the graph-based encoder.
    """

    def networks(self, generator: torch.Generator) -> Sheets:
        """See `SheetMethod`."""
        return FoldingNetworks([TwoFolds(generator)])
