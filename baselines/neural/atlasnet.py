"""AtlasNet: a surface papered with squares."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from baselines.neural.sheet_method import SheetMethod
from parapoint.parameters import check_whole

if TYPE_CHECKING:
    import torch

    from baselines.neural.sheets import Sheets


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
        from baselines.neural.atlasnet_networks import AtlasNetworks

        return AtlasNetworks(self.charts, generator)
