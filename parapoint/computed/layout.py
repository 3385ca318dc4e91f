"""A planar map of a given scale: the triangles turned by parallel transport, then fitted together.

The map may cover itself; `parapoint.planar.bijection` makes a bijective one of it.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from parapoint.computed.scale import COTANGENTS, laplacian
from parapoint.planar.embedding import factored
from parapoint.surfaces.surface import FloatArray, IntArray, Mesh, twin_halfedges

LARGEST_SCALE = 8.0
"""Largest absolute log scale: what is smaller or larger is as good as lost."""


def scaled_layout(mesh: Mesh, scale: FloatArray) -> FloatArray:
    """(V, 2) the conformal map of a disk whose log scale is nearest to `scale` (V,).

    In a metric scaled by e^u the turn from one triangle's frame to the next one's changes by the
    flow of u along their edge, (Δu)_ij = w_ij (u_i − u_j). Where Δu is minus the angle defect it
    adds up to a full turn around each vertex, so every path from face to face gives the same
    frames. The map with the gradients nearest to the scaled frames is found by a Poisson solve, in
    which errors count relative to the scale.

    Args:
        mesh: connected and consistently oriented.
        scale: (V,) log scale that flattens it, such as those of `parapoint.computed.scale`.
    """
    edges = _flat_edges(mesh)
    size = np.exp(np.clip(scale, -LARGEST_SCALE, LARGEST_SCALE)[mesh.faces].mean(axis=1))
    angle = _frames(mesh, edges, scale)
    wanted = ((size * np.exp(1j * angle))[:, None] * edges).reshape(-1)
    one, other = np.roll(edges, -2, axis=1), -np.roll(edges, -1, axis=1)  # to the opposite corner
    product = -one.conj() * other
    cotangent = product.real / np.maximum(np.abs(product.imag), 1e-300)
    weight = (np.clip(cotangent, *COTANGENTS) / size[:, None] ** 2).reshape(-1)
    start, end = mesh.halfedges.T
    links = sparse.coo_matrix((weight, (start, end)), (len(scale),) * 2).tocsc()
    links = links + links.T
    matrix = sparse.diags_array(np.asarray(links.sum(axis=1)).reshape(-1)) - links
    pull = np.stack([(weight * wanted).real, (weight * wanted).imag], axis=1)
    right: FloatArray = np.zeros((len(scale), 2))
    np.add.at(right, end, pull)
    np.add.at(right, start, -pull)
    uv: FloatArray = np.zeros((len(scale), 2))
    uv[1:] = factored(matrix.tocsc()[1:][:, 1:]).solve(right[1:])  # it may move: one is held
    return uv


def _flat_edges(mesh: Mesh) -> np.ndarray:
    """(F, 3) complex: the edges of each triangle in a plane of its own, the first along x."""
    corners = mesh.vertices[mesh.faces]
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    length = np.maximum(np.linalg.norm(first, axis=1), 1e-300)
    along = (first * second).sum(axis=1) / length
    across = np.linalg.norm(np.cross(first, second), axis=1) / length
    apex = along + 1j * across
    return np.stack([length + 0j, apex - length, -apex], axis=1)


def _frames(mesh: Mesh, edges: np.ndarray, scale: FloatArray) -> FloatArray:
    """(F,) the angle by which each triangle's plane is turned, by transport from the first one."""
    one, other = twin_halfedges(mesh.edge_of_halfedge)
    start, end = mesh.halfedges[one].T
    flow = np.asarray(laplacian(mesh)[start, end]).reshape(-1) * (scale[end] - scale[start])
    heading = np.angle(edges).reshape(-1)
    turn = heading[one] - heading[other] - np.pi + flow
    count = len(mesh.faces)
    pairs: tuple[IntArray, IntArray] = (one // 3, other // 3)
    graph = sparse.coo_matrix((np.ones(len(one)), pairs), (count, count)).tocsr()
    turns = sparse.coo_matrix((turn, pairs), (count, count)).tocsr()
    turns = turns - turns.T
    reached, before = csgraph.breadth_first_order(graph, 0, directed=False)
    steps = np.asarray(turns[before[reached[1:]], reached[1:]]).reshape(-1)
    angle = [0.0] * count
    for face, previous, step in zip(
        reached[1:].tolist(), before[reached[1:]].tolist(), steps.tolist(), strict=True
    ):
        angle[face] = angle[previous] + step
    return np.array(angle)
