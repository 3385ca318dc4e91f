"""Networks and loss of AtlasNet (`baselines.neural.atlasnet`)."""

from __future__ import annotations

import torch
from torch import Tensor

from baselines.neural.sheets import Sheets, random_places
from parapoint.learned.losses import nearest
from parapoint.learned.networks import ACTIVATIONS, Stack

HIDDEN = (128, 128, 128)


class AtlasNetworks(Sheets):
    """A small network for each square; all together are held against the surface."""

    def __init__(self, charts: int, generator: torch.Generator) -> None:
        activation = ACTIVATIONS["squareplus"]
        super().__init__([Stack(2, 3, HIDDEN, activation, generator) for _ in range(charts)])

    def terms(self, given: Tensor, count: int, generator: torch.Generator) -> dict[str, Tensor]:
        """The Chamfer distance: squared distances to the nearest, both ways."""
        each = -(-count // len(self.sheets))
        made = torch.cat([sheet(random_places(each, generator)[None])[0] for sheet in self.sheets])
        return {"chamfer": chamfer(made, given)}


def chamfer(made: Tensor, given: Tensor) -> Tensor:
    """Mean squared distance of each point to the nearest of the other set, both ways together."""
    there = made - given[nearest(made, given, 1)[:, 0]]
    back = given - made[nearest(given, made, 1)[:, 0]]
    return there.square().sum(1).mean() + back.square().sum(1).mean()
