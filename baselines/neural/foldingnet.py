"""FoldingNet: one square, folded twice."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from baselines.neural.sheet_method import SheetMethod

if TYPE_CHECKING:
    import torch

    from baselines.neural.sheets import Sheets


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
        from baselines.neural.foldingnet_networks import FoldingNetworks, TwoFolds

        return FoldingNetworks([TwoFolds(generator)])
