"""GTIF: a folded grid whose points are filtered along a graph that is inferred."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from baselines.neural.sheet_method import SheetMethod

if TYPE_CHECKING:
    import torch

    from baselines.neural.sheets import Sheets


@dataclass(frozen=True)
class GTIF(SheetMethod):
    """One grid, folded onto the surface, then refined by a learned filter of a learned graph.

    S. Chen, C. Duan, Y. Yang, D. Li, C. Feng and D. Tian 2020, "Deep unsupervised learning of 3D
    point clouds via graph topology inference and filtering". A network folds a grid of points S;
    a graph joins each with others near it in the grid, by weights A that are inferred from where
    both lie in the grid and in space; the filter h(A) S, a polynomial of low order in A, refines
    the points. Between the points the surface is interpolated. Our reading of the inference: two
    points are joined the more, the nearer a network embeds them; weights of a point sum to 1.
    A filter cannot tear: as FoldingNet's, the sheet may fold over itself and closes a sphere by
    wrinkles, and what is finer than its grid is lost. Left out: the encoder.
    """

    def networks(self, generator: torch.Generator) -> Sheets:
        """See `SheetMethod`."""
        from baselines.neural.grids import GridNetworks
        from baselines.neural.gtif_networks import FilteredGrid

        return GridNetworks(FilteredGrid(generator))
