"""What goes through the networks in a step: some of the cloud's points, and a lattice."""

from __future__ import annotations

import torch
from scipy.spatial import cKDTree
from torch import Tensor


class Cloud:
    """Points that networks are fitted to, and what is drawn from them.

    Args:
        rows: (1 + T, N, 3): the points, and T vectors at each.
        patch: points of a batch that lie beside one another: a centre and its nearest of all
            points. Random points alone would hide folds from terms that compare neighbours: of 256
            on a hand the nearest others lie across a finger.
    """

    def __init__(self, rows: Tensor, patch: int) -> None:
        self.rows = rows
        points = rows[0].cpu().numpy()
        patch = min(patch, len(points))
        near = cKDTree(points).query(points, patch)[1]
        self.patches = torch.from_numpy(near.reshape(len(points), patch))

    @property
    def points(self) -> Tensor:
        """(N, 3)."""
        return self.rows[0]

    def drawn(self, count: int, generator: torch.Generator) -> Tensor:
        """(1 + T, n, 3) rows of patches around random centres; all where `count` is N or more.

        As many patches as `count` holds, at least one; a point in two of them comes twice.
        """
        size, patch = self.patches.shape
        if count >= size:
            return self.rows
        centres = torch.randperm(size, generator=generator)[: max(1, count // patch)]
        return self.rows[:, self.patches[centres].flatten().to(self.rows.device)]


def lattice(side: int, generator: torch.Generator) -> Tensor:
    """(side², 2) a lattice of cells in [−1, 1]², one point in each, anywhere in it."""
    cells = torch.cartesian_prod(torch.arange(side), torch.arange(side))
    return (cells + torch.rand(side * side, 2, generator=generator)) * (2 / side) - 1
