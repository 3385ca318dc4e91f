"""Normals of a cloud, oriented alike, and tangents around normals."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph
from scipy.spatial import cKDTree

from parapoint.surfaces.surface import FloatArray


def oriented_normals(points: FloatArray, neighbours: int = 12) -> FloatArray:
    """(N, 3) unit normals, oriented alike along a spanning tree (Hoppe et al. 1992).

    Least principal directions of the nearest neighbours; the tree prefers parallel ones.
    """
    near = cKDTree(points).query(points, min(neighbours, len(points)))[1]
    offsets = points[near] - points[near].mean(axis=1, keepdims=True)
    normals = np.linalg.eigh(np.einsum("nki,nkj->nij", offsets, offsets))[1][:, :, 0]
    rows = np.repeat(np.arange(len(points)), near.shape[1] - 1)
    columns = near[:, 1:].ravel()
    apart = 1.0 + 1e-6 - np.abs((normals[rows] * normals[columns]).sum(axis=1))
    size = (len(points), len(points))
    tree = csgraph.minimum_spanning_tree(sparse.coo_matrix((apart, (rows, columns)), size).tocsr())
    waiting = np.ones(len(points), dtype=bool)
    while waiting.any():
        root = int(np.argmax(waiting))
        order, parents = csgraph.breadth_first_order(tree, root, directed=False)
        waiting[order] = False
        for child in order[1:]:
            if normals[child] @ normals[parents[child]] < 0:
                normals[child] *= -1
    return np.asarray(normals)


def tangent_frames(points: FloatArray) -> FloatArray:
    """(2, N, 3) orthonormal tangent vectors, right-handed around the oriented normals."""
    return tangents_of(oriented_normals(points))


def tangents_of(normals: FloatArray) -> FloatArray:
    """(2, N, 3) orthonormal vectors, right-handed around unit normals (N, 3)."""
    least = np.eye(3)[np.abs(normals).argmin(axis=1)]
    first = np.cross(normals, least)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(normals, first)])
