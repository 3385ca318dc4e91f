"""Network of TearingNet (`baselines.neural.tearingnet`)."""

from __future__ import annotations

import torch
from torch import Tensor

from baselines.neural.foldingnet_networks import TwoFolds
from baselines.neural.grids import SIDE, Grid, GridSheet
from parapoint.learned.losses import EPSILON
from parapoint.learned.networks import ACTIVATIONS, Stack

HIDDEN = (128, 128)
STEPS = torch.tensor([[1, 0], [0, 1], [-1, 0], [0, -1]])
"""From a point of the grid to the ends of its edges."""
TEAR = 2.0
"""Length in space beyond which an edge of the folded grid is removed, in medians of all edges."""
SMOOTHING = 0.3
"""μ of the filter I − μ L: how far a point moves towards the mean of its neighbours."""


class TornGrid(GridSheet):
    """F folds, T tears, F folds again, and a filter smooths along the edges that are left."""

    def __init__(self, generator: torch.Generator, side: int = SIDE) -> None:
        super().__init__(Grid.of_steps(STEPS, side))
        self.fold = TwoFolds(generator)
        self.tear = Stack(5, 2, HIDDEN, ACTIVATIONS["squareplus"], generator)
        with torch.no_grad():
            self.tear.layers[-1].zero_()

    def torn(self) -> Tensor:
        """(M, 2) the points of the grid as T moves them."""
        places = self.grid.places
        seen = torch.cat([places, self.fold(places[None])[0]], dim=1)
        offset: Tensor = self.tear(seen[None])[0]
        return places + offset

    def weights(self, folded: Tensor) -> Tensor:
        """(M, 4) the weight exp(−d² / 2) of each edge, d its length in medians; 0 if removed."""
        squared = (folded[:, None] - folded[self.grid.near]).square().sum(2)
        median = squared.detach()[self.grid.is_near].median()
        is_kept = self.grid.is_near & (squared <= TEAR**2 * median)
        return (-squared / (2 * median + EPSILON)).exp() * is_kept

    def nodes(self) -> tuple[Tensor, Tensor]:
        """See `GridSheet`. The filter is I − μ L, L = I − D⁻¹ W; a point alone stays."""
        folded = self.fold(self.torn()[None])[0]
        weights = self.weights(folded)
        degree = weights.sum(dim=1, keepdim=True)
        is_joined = degree > 0
        mean = self.grid.averaged(weights / degree.where(is_joined, 1.0), folded)
        smooth = torch.lerp(folded, mean, SMOOTHING).where(is_joined, folded)
        return smooth, self.whole_cells(weights > 0)

    def whole_cells(self, is_kept: Tensor) -> Tensor:
        """(side - 1, side - 1) the cells that have all of their four edges.

        Args:
            is_kept: (M, 4) whether each point has its edge along each of `STEPS`.
        """
        side = self.grid.side
        ahead, beside = is_kept.reshape(side, side, 4)[:, :, :2].unbind(2)
        return ahead[:-1, :-1] & ahead[:-1, 1:] & beside[:-1, :-1] & beside[1:, :-1]
