"""A sheet that is known at the points of a grid and interpolated between them.

Some networks take all points of a grid at once, as each depends on its neighbours: there is no
network that maps a single place of the square. Between four points the sheet is bilinear.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from baselines.neural.sheets import Sheets
from parapoint.learned.losses import wrap_loss

SIDE = 45
"""Points along a side of the grid, as in FoldingNet and all that came after it."""
FAR = 1e3
"""Where the places of a torn cell lie: the surface lies in a ball of radius 1."""


@dataclass(frozen=True)
class Grid:
    """The points of a grid, M = side², in rows along the second axis, and who may be joined.

    Attributes:
        side: points along a side.
        places: (M, 2) in the square from -1 to 1.
        near: (M, K) the points around each, some step or other along the axes away.
        is_near: (M, K) False where there is none, as at the border.
    """

    side: int
    places: Tensor
    near: Tensor
    is_near: Tensor

    @classmethod
    def of_steps(cls, steps: Tensor, side: int) -> Grid:
        """A grid whose points have neighbours at these steps (K, 2) along both axes."""
        axis = torch.arange(side)
        cell = torch.cartesian_prod(axis, axis)
        there = cell[:, None] + steps
        near = there.clamp(0, side - 1)
        return cls(
            side,
            2 * cell / (side - 1) - 1,
            near[:, :, 0] * side + near[:, :, 1],
            (near == there).all(dim=2),
        )

    @classmethod
    def of_reach(cls, reach: int, side: int) -> Grid:
        """A grid whose points have all others as neighbours up to `reach` steps along an axis."""
        steps = torch.arange(-reach, reach + 1)
        pairs = torch.cartesian_prod(steps, steps)
        return cls.of_steps(pairs[pairs.any(dim=1)], side)

    def averaged(self, weights: Tensor, values: Tensor) -> Tensor:
        """(M, C) the sums of the values (M, C) of all neighbours by their weights (M, K)."""
        return (weights[:, :, None] * values[self.near]).sum(dim=1)

    def all_cells(self) -> Tensor:
        """(side - 1, side - 1) True for each cell."""
        return torch.ones(self.side - 1, self.side - 1, dtype=torch.bool)


class GridSheet(nn.Module):
    """Base class: a sheet through points of a grid."""

    def __init__(self, grid: Grid) -> None:
        super().__init__()
        self.grid = grid

    def nodes(self) -> tuple[Tensor, Tensor]:
        """(M, 3) where the points lie, and (side - 1, side - 1) which cells are not torn."""
        raise NotImplementedError

    def forward(self, x: Tensor) -> Tensor:
        """(1 + T, N, 2) → (1 + T, N, 3), in a torn cell FAR away from everything."""
        nodes, is_whole = self.nodes()
        side = self.grid.side
        width = 2 / (side - 1)
        at = (x[0] + 1) / width
        cell = at.floor().clamp(0, side - 2).long()
        p, q = (at - cell)[:, :, None].unbind(1)
        i, j = cell.unbind(1)
        corner = nodes.reshape(side, side, 3)
        a, b, c, d = corner[i, j], corner[i + 1, j], corner[i, j + 1], corner[i + 1, j + 1]
        along = torch.stack([torch.lerp(b - a, d - c, q), torch.lerp(c - a, d - b, p)]) / width
        point = torch.lerp(torch.lerp(a, b, p), torch.lerp(c, d, p), q)
        tangents = x[1:, :, :1] * along[0] + x[1:, :, 1:] * along[1]
        whole = is_whole[i, j][:, None]
        return torch.cat([point.where(whole, FAR)[None], tangents.where(whole, 0.0)])


class GridNetworks(Sheets):
    """One sheet through the points of a grid."""

    def __init__(self, sheet: GridSheet) -> None:
        super().__init__([sheet])

    def terms(self, given: Tensor, count: int, generator: torch.Generator) -> dict[str, Tensor]:
        """The larger of the mean distances of either set to the other; a set is `count` points."""
        nodes: Tensor = self.sheets[0].nodes()[0]  # type: ignore[operator]  # a GridSheet
        chosen = torch.randperm(len(nodes), generator=generator)[:count]
        return {"chamfer": wrap_loss(nodes[chosen], given)}
