"""Tutte's embedding of a planar domain, and the cuts that give it room."""

from __future__ import annotations

from typing import Any

import igl
import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from parapoint.surfaces.areas import signed_areas
from parapoint.surfaces.cutting import (
    cut_along,
    edge_graph,
    edge_lengths,
    path_edges,
    path_to,
    ways_to,
)
from parapoint.surfaces.surface import FloatArray, Mesh, edge_table

FLATTEST = 1e-22
"""Least area of a face, of the surface or the disk of radius 1: below it rounding decides."""
MOST_OPENINGS = 50
"""Cuts at most to what Tutte's embedding flattens; one to three were needed where any was."""


def embedded_in_disk(mesh: Mesh) -> FloatArray:
    """(V, 2) Tutte's embedding in the unit disk, the longest loop on the circle.

    All other vertices are at the mean of their neighbours; each inner loop is filled with a fan
    around a vertex of its own.
    """
    outer, *inner = mesh.boundary_loops
    fans = [
        np.stack([np.roll(loop, -1), loop, np.full(len(loop), len(mesh.vertices) + row)], axis=1)
        for row, loop in enumerate(inner)
    ]
    i, j = edge_table(np.concatenate([mesh.faces, *fans]))[0].T
    size = len(mesh.vertices) + len(inner)
    upper = sparse.coo_matrix((np.ones(len(i)), (i, j)), (size, size))
    joined = (upper + upper.T).tocsc()
    matrix = (sparse.diags_array(np.asarray(joined.sum(axis=1)).reshape(-1)) - joined).tocsc()
    inside = np.setdiff1d(np.arange(size), outer)
    uv: FloatArray = np.zeros((size, 2))
    uv[outer] = igl.map_vertices_to_circle(mesh.vertices, outer)
    uv[inside] = factored(matrix[inside][:, inside]).solve(-(matrix[inside][:, outer] @ uv[outer]))
    return uv[: len(mesh.vertices)]


def factored(matrix: sparse.csc_matrix) -> Any:
    """The factors of a symmetric positive definite matrix."""
    options = {"SymmetricMode": True}
    return splu(matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)


def embeddable(mesh: Mesh) -> Mesh:
    """The planar domain cut until Tutte's embedding has room for all of its faces.

    It shrinks a horn or a tail exponentially from its foot to its tip, and so it does a strip of
    triangles that hangs into a hole. A cut from the outer loop to the far end of what is too flat
    for numbers, or to the hole, brings this to the rim of the disk.
    """
    for _ in range(MOST_OPENINGS):
        flat = ~(signed_areas(embedded_in_disk(mesh), mesh.faces) > FLATTEST)
        if not flat.any():
            break
        loops = mesh.boundary_loops
        distance, previous = ways_to(few_edges_graph(mesh), loops[0])
        squeezed = np.unique(mesh.faces[flat])
        path = path_edges(path_to(previous, int(squeezed[distance[squeezed].argmax()])))
        at_hole = np.flatnonzero(np.isin(path[:, 0], np.concatenate(loops)))
        path = path[at_hole[-1] :] if len(at_hole) else path
        if not len(path):
            break
        mesh = cut_along(mesh, path)
    return mesh


def few_edges_graph(mesh: Mesh) -> sparse.csr_matrix:
    """The symmetric (V, V) graph of the edges; their lengths plus the mean, so few are best."""
    lengths = edge_lengths(mesh)
    return edge_graph(mesh, lengths + lengths.mean())
