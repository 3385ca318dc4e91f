"""Tutte's embedding: the longest boundary on a circle, each inner vertex amid its neighbours."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import igl
import numpy as np
from scipy import sparse

from baselines.disks.flattening import Domain, circle, closed_holes, domain, scaled, signed_areas
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import FloatArray, IntArray, Surface


@dataclass(frozen=True)
class Tutte:
    """Tutte's embedding with uniform weights; the longest boundary loop on a circle.

    W. T. Tutte 1963, "How to draw a graph". The loop is spaced by arc length; other loops are free.
    A vertex of another loop with two neighbours only then lands between them and its triangle has
    no area: where that happens, the loops are closed by fans for the solve. The report counts what
    flipped none the less, which takes triangles below the precision of a number.
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
    uv = scaled(disk, _embedded(disk, disk.vertices, disk.faces))
    if (signed_areas(uv, disk.faces) > 0).all():
        return uv
    vertices, faces = closed_holes(disk)
    if len(vertices) == len(disk.vertices):
        return uv
    return scaled(disk, _embedded(disk, vertices, faces)[: len(disk.vertices)])


def _embedded(disk: Domain, vertices: FloatArray, faces: IntArray) -> FloatArray:
    """(V, 2) each vertex at the mean of its neighbours, the domain's loop on the unit circle."""
    adjacency = igl.adjacency_matrix(faces).astype(np.float64)
    laplacian = sparse.diags(adjacency.sum(axis=1).A1) - adjacency
    return np.asarray(
        igl.min_quad_with_fixed(
            laplacian.tocsc(),
            np.zeros((len(vertices), 2)),
            disk.loop,
            circle(disk.vertices[disk.loop]),
        ),
        dtype=np.float64,
    )
