"""DiffSR: squares on a surface that neither collapse nor lie on one another."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from baselines.neural.atlasnet import AtlasNet

if TYPE_CHECKING:
    import torch

    from baselines.neural.sheets import Sheets


@dataclass(frozen=True)
class DiffSR(AtlasNet):
    """AtlasNet's squares, with losses on their metric tensor and on the sum of their areas.

    J. Bednarik, S. Parashar, E. Gundogdu, M. Salzmann and P. Fua 2020, "Shape reconstruction by
    learning differentiable surface representations". The networks are smooth, so that their first
    fundamental form (E, F, G) is known exactly; its terms L_E, L_G, L_sk and L_str ask each square
    for an even stretch, no skew and equal stretch along both axes, and L_ol asks all squares
    together for no more than the area of the surface. The terms are fractions of each square's own
    area, so that they hold no square from shrinking; joins between squares are not asked for. Left
    out: the encoder, and the given area: it is estimated from the points, as a cloud has none.
    """

    def networks(self, generator: torch.Generator) -> Sheets:
        """See `SheetMethod`."""
        from baselines.neural.diffsr_networks import DiffSRNetworks

        return DiffSRNetworks(self.charts, generator)
