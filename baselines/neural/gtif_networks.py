"""Network of GTIF (`baselines.neural.gtif`)."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from baselines.neural.foldingnet_networks import TwoFolds
from baselines.neural.grids import SIDE, Grid, GridSheet
from parapoint.learned.networks import ACTIVATIONS, Stack

REACH = 2
"""Steps along an axis of the grid between points that the graph may join."""
ORDER = 2
"""Highest power of the adjacency in the filter."""
CHANNELS = 16
"""Dimensions in which points are embedded that are joined by nearness there."""
HIDDEN = (64,)


class FilteredGrid(GridSheet):
    """A grid folded by FoldingNet's networks, and its points filtered along the inferred graph."""

    def __init__(self, generator: torch.Generator, side: int = SIDE) -> None:
        super().__init__(Grid.of_reach(REACH, side))
        self.fold = TwoFolds(generator)
        self.embedding = Stack(5, CHANNELS, HIDDEN, ACTIVATIONS["squareplus"], generator)
        self.filter = nn.Parameter(torch.full((ORDER,), 1 / (ORDER + 1)))

    def adjacency(self, folded: Tensor) -> Tensor:
        """(M, K) the weight of each neighbour of each point (M, 3); those of a point sum to 1."""
        seen = torch.cat([self.grid.places, folded], dim=1)
        embedded = self.embedding(seen[None])[0]
        apart = (embedded[:, None] - embedded[self.grid.near]).square().sum(2)
        weights: Tensor = (-apart).masked_fill(~self.grid.is_near, -torch.inf).softmax(dim=1)
        return weights

    def nodes(self) -> tuple[Tensor, Tensor]:
        """See `GridSheet`: Σ h_l A^l S with Σ h_l = 1, which leaves a constant as it is."""
        power = folded = self.fold(self.grid.places[None])[0]
        weights = self.adjacency(folded)
        filtered = (1 - self.filter.sum()) * folded
        for share in self.filter:
            power = self.grid.averaged(weights, power)
            filtered = filtered + share * power
        return filtered, self.grid.all_cells()
