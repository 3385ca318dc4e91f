"""Tutte's embedding: the longest boundary on a circle, each inner vertex amid its neighbours."""

from __future__ import annotations

import igl
import numpy as np
from scipy import sparse

from parapoint.planar.domains import Domain, circle, closed_holes, scaled
from parapoint.surfaces.areas import signed_areas
from parapoint.surfaces.surface import FloatArray, IntArray


def tutte(disk: Domain) -> FloatArray:
    """(V, 2) Tutte's embedding of a domain, scaled to its 3D area."""
    uv = scaled(disk, _embedded(disk, disk.vertices, disk.faces))
    if (signed_areas(uv, disk.faces) > 0).all():
        return uv
    vertices, faces = closed_holes(disk)
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
