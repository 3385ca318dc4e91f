"""AtlasNet: a surface papered with squares."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from baselines.neural.sheet_method import SheetMethod, Sheets, random_places
from parapoint.learned.losses import nearest
from parapoint.learned.networks import ACTIVATIONS, Stack
from parapoint.parameters import check_whole

HIDDEN = (128, 128, 128)


class AtlasNetworks(Sheets):
    """A small network for each square; all together are held against the surface."""

    def __init__(self, charts: int, generator: torch.Generator) -> None:
        activation = ACTIVATIONS["squareplus"]
        super().__init__([Stack(2, 3, HIDDEN, activation, generator) for _ in range(charts)])

    def terms(self, given: Tensor, count: int, generator: torch.Generator) -> dict[str, Tensor]:
        """The Chamfer distance: squared distances to the nearest, both ways (equation 3)."""
        each = -(-count // len(self.sheets))
        made = torch.cat([sheet(random_places(each, generator)[None])[0] for sheet in self.sheets])
        return {"chamfer": chamfer(made, given)}


def chamfer(made: Tensor, given: Tensor) -> Tensor:
    """Mean squared distance of each point to the nearest of the other set, both ways together."""
    there = made - given[nearest(made, given, 1)[:, 0]]
    back = given - made[nearest(given, made, 1)[:, 0]]
    return there.square().sum(1).mean() + back.square().sum(1).mean()


@dataclass(frozen=True)
class AtlasNet(SheetMethod):
    """Several squares, each folded onto a part of the surface by a network of its own.

    T. Groueix, M. Fisher, V. G. Kim, B. C. Russell and M. Aubry 2018, "AtlasNet: a papier-mâché
    approach to learning 3D surface generation". Each of K networks maps the square to space; the
    Chamfer distance of all their points to the surface is brought down. Nothing else is asked for:
    sheets may lie on one another, fold, and stretch as they like, and neighbours do not join. Left
    out: the encoder; smaller layers than the paper's, since they learn one shape.

    Attributes:
        charts: squares, 1 to 64.
    """

    charts: int = 4

    def __post_init__(self) -> None:
        super().__post_init__()
        check_whole("charts", self.charts, 1, 64)

    def networks(self, generator: torch.Generator) -> Sheets:
        """See `SheetMethod`."""
        return AtlasNetworks(self.charts, generator)
