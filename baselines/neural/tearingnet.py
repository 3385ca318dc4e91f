"""TearingNet: a grid that tears before it is folded."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from baselines.neural.sheet_method import SheetMethod

if TYPE_CHECKING:
    import torch

    from baselines.neural.sheets import Sheets


@dataclass(frozen=True)
class TearingNet(SheetMethod):
    """One grid folded onto the surface, torn where that pulls it apart, and folded again.

    J. Pang, D. Li and D. Tian 2021, "TearingNet: point cloud autoencoder to learn
    topology-friendly representations"; written from the paper's text. A network F folds the grid;
    a network T sees each point of the grid and its fold, and moves it in the plane; F folds the
    moved grid. Edges of the grid that are pulled apart are removed, and a graph filter along those
    that remain smooths the points. The paper measures edges in the moved grid; fitted to one shape,
    F pulls apart what T hardly moves, so that they are measured in space here, after both.

    uv is the place in the grid as it was, not as T moved it: T may move two points to one place, a
    grid cannot. A cell that has lost an edge is torn, and has no points: the surface on both sides
    of a tear lies on both sides of the cell. What tears is decided by a threshold that has no
    gradient, so that nothing asks for few tears, nor for tears where the surface is cut best: two
    balls are torn apart, but a surface in one piece may be covered without a tear, by wrinkles.
    Left out: the encoder, and the paper's training of F before T; T starts as no movement instead.
    """

    def networks(self, generator: torch.Generator) -> Sheets:
        """See `SheetMethod`."""
        from baselines.neural.grids import GridNetworks
        from baselines.neural.tearingnet_networks import TornGrid

        return GridNetworks(TornGrid(generator))
