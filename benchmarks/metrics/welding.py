"""What a map is scored on: the faces that it covers, with vertices at one place counted as one.

Writers of OBJ, PLY and glTF double the vertices along a seam, or give each corner a vertex of its
own. The same map must score the same in every file. So vertices at one place are welded, and rows
of uv that agree there become one row. Faces without a uv are left out, and the share of the
surface that is left says so.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph
from scipy.spatial import cKDTree

from parapoint.errors import InputError
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import FloatArray, IntArray, Mesh

SAME_PLACE = 1e-7
"""Two points are at one place if they are no farther apart than this share of the diagonal of their
bounding box. Most writers compute in single precision, which rounds by about as much."""
CROWD = 32
"""Neighbours within the tolerance, on average, that `places` looks at one by one."""


class Scored(NamedTuple):
    """A map as it is scored.

    Attributes:
        mesh: the faces that the map covers, in the order of the whole mesh.
        parameterization: their map.
        reference: another map of the same faces, or None.
        coverage: the share of the 3D area, from 0 to 1, that the map covers; the share of the
            number of faces if none has an area.
        welded: the number of vertices that were welded to another one.
    """

    mesh: Mesh
    parameterization: Parameterization
    reference: Parameterization | None
    coverage: float
    welded: int


def scored(
    mesh: Mesh, parameterization: Parameterization, reference: Parameterization | None = None
) -> Scored:
    """The faces that a map covers, with their vertices welded.

    Raises:
        InputError: the map covers no face.
    """
    covered = parameterization.covered
    coverage = 1.0
    if not covered.all():
        areas = mesh.face_areas
        shares = areas if areas.sum() > 0 else np.ones(len(areas))
        coverage = float(shares[covered].sum() / shares.sum())
        if not covered.any():
            raise InputError("the map covers no face: every uv is NaN")
        mesh = Mesh(mesh.vertices, mesh.faces[covered])
        parameterization = Parameterization(parameterization.uv, parameterization.corners[covered])
        if reference is not None:
            reference = Parameterization(reference.uv, reference.corners[covered])
    place = places(mesh.vertices, same_place(mesh.vertices[mesh.referenced]))
    doubled = len(place) - (int(place.max(initial=-1)) + 1)
    if not doubled:
        return Scored(mesh, parameterization, reference, coverage, 0)
    vertices = np.empty((int(place.max()) + 1, 3))
    vertices[place] = mesh.vertices
    faces = place[mesh.faces]
    return Scored(
        Mesh(vertices, faces),
        _joined(parameterization, faces),
        None if reference is None else _joined(reference, faces),
        coverage,
        doubled,
    )


def places(points: FloatArray, tolerance: float = 0.0) -> IntArray:
    """(N,) the number of the place, from 0, at which each of (N, k) points lies.

    Args:
        points: coordinates.
        tolerance: two points are at one place if none of their coordinates differ by more than
            this, or if a chain of such points joins them. Where more than `CROWD`
            others are so near to a point on average, one point stands for those within half the
            tolerance, and takes in what is within 1.5 of it.
    """
    order = np.lexsort(points.T)
    ordered = points[order] + 0.0  # no negative zeros
    is_new = np.ones(len(points), dtype=bool)
    is_new[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    place = np.empty(len(points), dtype=np.int64)
    place[order] = np.cumsum(is_new) - 1
    if tolerance <= 0:
        return place
    apart = ordered[is_new]
    tree, cell = cKDTree(apart), np.arange(len(apart))
    if tree.count_neighbors(tree, tolerance, p=np.inf) > (CROWD + 1) * len(apart):
        cell = places(np.floor((apart - apart.min(axis=0)) / (tolerance / 2)))
        apart = apart[np.unique(cell, return_index=True)[1]]
        tree, tolerance = cKDTree(apart), 1.5 * tolerance
    pairs = tree.query_pairs(tolerance, p=np.inf, output_type="ndarray")
    links = sparse.coo_matrix((np.ones(len(pairs), bool), pairs.T), [len(apart)] * 2)
    joined = csgraph.connected_components(links, directed=False)[1]
    return np.asarray(joined[cell[place]], dtype=np.int64)


def same_place(points: FloatArray) -> float:
    """The tolerance of `places` for (N, k) points, by SAME_PLACE, in the unit of the points."""
    return SAME_PLACE * math.hypot(*np.ptp(points, axis=0)) if len(points) else 0.0


def _joined(parameterization: Parameterization, faces: IntArray) -> Parameterization:
    """The map with one row of uv for all corners of `faces` (F, 3) that share a vertex and a uv."""
    uv = parameterization.uv[parameterization.corners.reshape(-1)]
    in_the_plane = places(uv, same_place(uv))
    row = places(np.stack([faces.reshape(-1), in_the_plane], axis=1))
    joined = np.empty((int(row.max()) + 1, 2))
    joined[row] = uv
    return Parameterization(joined, row.reshape(-1, 3))
