"""Normals of a cloud, oriented alike; which side of a surface is the outer one; tangents."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph
from scipy.spatial import cKDTree

from parapoint.surfaces.frame import power_of_two
from parapoint.surfaces.surface import FloatArray, Mesh, Surface, vertex_normals

AGREEING = 0.5
"""Normals of a cloud tell its sides only if their mean cosine with normals that are oriented alike
is at least so large: those of many programs point to either side by chance."""
BULGING = 0.25
"""A surface bulges if its points lie in front of their middle by at least this share of their
distance from it, in the mean: half of a ball by 1, a cap of 20 degrees by 0.25. Two scans by a
depth camera, of a carton and of a person, do by 0.40 and 0.26, towards the camera."""
OPEN = 0.5
"""A surface that faces all ways has a mean normal shorter than this: half a ball one of 0.5, a tube
or a closed surface none. Where it is thin it bulges little, but as surely: it need only do so as
seen from any place along the mean normal, and not from its middle alone."""
UPRIGHT = 0.5
"""A flat surface faces along the first of z, y and x in which its mean normal has at least this
share of its largest coordinate."""


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


def known_or_zero(normals: FloatArray) -> FloatArray:
    """(N, 3) the normals, 0 where they are not finite: a normal of 0 is one that nobody knows."""
    return np.where(np.isfinite(normals).all(axis=1, keepdims=True), normals, 0.0)


def are_outer(surface: Surface, points: FloatArray, normals: FloatArray) -> bool:
    """Whether normals are on the outer side of a surface, which is seen when it is looked at.

    Faces of a mesh turn counter-clockwise on that side, and normals of a cloud point to it. Where a
    cloud has none that agree, a surface that bulges has its outer side where it does; a flat one
    faces up, along z, or else along y or x.

    Args:
        surface: what the points are of.
        points: (N, 3) points on it.
        normals: (N, 3) normals at these, oriented alike, as long as much of the surface is theirs.
    """
    unit = power_of_two(points)  # in which areas are no larger or smaller than float64
    points = points / unit
    if isinstance(surface, Mesh):
        mesh = Mesh(surface.vertices / unit, surface.faces)
        cosine = _agreement(normals, vertex_normals(mesh)[cKDTree(mesh.vertices).query(points)[1]])
        if abs(cosine) > 0:
            return cosine > 0
    elif surface.normals is not None:
        known = surface.normals[cKDTree(surface.points / unit).query(points)[1]]
        cosine = _agreement(normals, known)
        if abs(cosine) >= AGREEING:
            return cosine > 0
    return _bulge_or_face_up(points, normals)


def _agreement(normals: FloatArray, known: FloatArray) -> float:
    """The mean cosine of normals (N, 3) with known ones of any length; 0 where none has one."""
    length = np.linalg.norm(known, axis=1)
    weight = np.where(length > 0, np.linalg.norm(normals, axis=1), 0.0)
    along = (normals * known).sum(axis=1) / np.where(length > 0, length, 1.0)
    return float(along[length > 0].sum() / max(weight.sum(), 1e-300))


def _bulge_or_face_up(points: FloatArray, normals: FloatArray) -> bool:
    """Whether normals (N, 3) that are oriented alike are on the side that bulges, or face up."""
    weight = np.linalg.norm(normals, axis=1)
    weight /= weight.sum()
    normals = normals / np.linalg.norm(normals, axis=1).sum()
    away = points - weight @ points
    along = (away * normals).sum(axis=1)
    bulge, reach = float(along.sum()), float(weight @ np.linalg.norm(away, axis=1))
    mean = normals.sum(axis=0)
    faces_all_ways = bool(np.linalg.norm(mean) < OPEN)
    if abs(bulge) >= BULGING * reach or (
        faces_all_ways and abs(bulge) > float(weight @ np.abs(away @ mean))
    ):
        return bulge > 0
    upwards = mean[::-1]
    first = int((np.abs(upwards) >= UPRIGHT * np.abs(upwards).max()).argmax())
    return bool(upwards[first] >= 0)


def tangent_frames(points: FloatArray) -> FloatArray:
    """(2, N, 3) orthonormal tangent vectors, right-handed around the oriented normals."""
    return tangents_of(oriented_normals(points))


def tangents_of(normals: FloatArray) -> FloatArray:
    """(2, N, 3) orthonormal vectors, right-handed around unit normals (N, 3)."""
    least = np.eye(3)[np.abs(normals).argmin(axis=1)]
    first = np.cross(normals, least)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(normals, first)])
