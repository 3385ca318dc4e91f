"""Flattening-Net: the points of a cloud on a square grid, by a sheet that is folded onto them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from baselines.neural.grid_method import GridMethod
from baselines.neural.point_grid import arranged, blocks, squared_distances
from parapoint.surfaces.parameterization import TracePoint
from parapoint.surfaces.surface import FloatArray, IntArray

BLOCK = 16
"""Cells on a side of a block, at most, in which points are assigned one to one: the time of an
assignment grows with the cube of their number."""


@dataclass(frozen=True)
class FlatteningNet(GridMethod):
    """A point in each cell of a square grid, that which lies where a folded sheet has the cell.

    Q. Zhang, J. Hou, Y. Qian, Y. Zeng, J. Zhang and Y. He 2023, "Flattening-Net: deep regular 2D
    representation for 3D point cloud analysis". A network deforms a lattice of the square onto the
    shape, as many lattice points wherever as many points of the cloud are. The square is parted
    into patches; each takes the points around its part of the sheet and flattens them onto its own
    small grid, and the small grids side by side are the point geometry image. Stand-ins for ours,
    who train on one shape: FoldingNet's two folds without an encoder, held to the points by optimal
    assignment; and in a patch an assignment in place of the flattening network trained beforehand.
    Nothing asks for low distortion, and a closed surface is torn where the sheet's sides meet.
    """

    subset: int = 256

    def cells(
        self, points: FloatArray, drawn: FloatArray, side: int, seed: int
    ) -> tuple[IntArray, tuple[TracePoint, ...], Mapping[str, object]]:
        """See `GridMethod`."""
        from baselines.neural.flattening_net_networks import folded

        places, trace = folded(
            drawn, side, self.subset, self.iterations, self.time_budget, seed=seed
        )
        count = -(-side // BLOCK)

        def costs(rows: IntArray, cells: IntArray) -> FloatArray:
            return squared_distances(points[rows], places[cells])

        cell = arranged(points, places, blocks(side, count), costs)
        return cell, trace, {"patches": count**2}
