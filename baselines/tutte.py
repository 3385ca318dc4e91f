"""Tutte's embedding: the longest boundary on a circle, each inner vertex amid its neighbours."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import igl
import numpy as np
from scipy import sparse

from baselines.flattening import Domain, circle, domain, scaled, signed_areas
from parapoint.parameterization import Parameterization
from parapoint.surface import FloatArray, Surface


@dataclass(frozen=True)
class Tutte:
    """Tutte's embedding with uniform weights; the longest boundary loop on a circle.

    W. T. Tutte 1963, "How to draw a graph". The loop is spaced by arc length; vertices of other
    loops are free like inner ones. The disk is embedded without flips if its graph is 3-connected
    (an edge across the disk between two boundary vertices breaks that); the report counts them.
    """

    requires: ClassVar[frozenset[str]] = frozenset({"faces", "disk_after_cut"})
    packages: ClassVar[tuple[str, ...]] = ("libigl",)

    def parameterize(self, surface: Surface, *, seed: int) -> Parameterization:  # noqa: ARG002 (nothing is random)
        """The embedding, scaled to the 3D area.

        Raises:
            UnsupportedError: the surface is no disk, with or without holes.
            FlatteningError: the system has no finite solution.
        """
        disk = domain(surface)
        uv = tutte(disk)
        areas = signed_areas(uv, disk.faces)
        flips = {"flipped": int((areas < 0).sum()), "degenerate": int((areas == 0).sum())}
        return Parameterization(uv, disk.faces, report=flips)


def tutte(disk: Domain) -> FloatArray:
    """(V, 2) Tutte's embedding of a domain, scaled to its 3D area."""
    adjacency = igl.adjacency_matrix(disk.faces).astype(np.float64)
    laplacian = sparse.diags(adjacency.sum(axis=1).A1) - adjacency
    uv = igl.min_quad_with_fixed(
        laplacian.tocsc(),
        np.zeros((len(disk.vertices), 2)),
        disk.loop,
        circle(disk.vertices[disk.loop]),
    )
    return scaled(disk, uv)
