"""What a map is scored on: its covered faces, with vertices at one place counted as one.

Writers of OBJ, PLY and glTF double a vertex at a seam, or give each corner a vertex of its own; and
a map may leave faces out. One map gives one set of numbers, whatever the file: vertices at one
place are welded, rows of uv that agree there are one row, and faces without a uv are left out and
counted.
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
"""Points nearer to one another than this share of the diagonal of their box lie at one place: the
single precision, in which most writers compute, rounds by about as much."""
CROWD = 32
"""Neighbours within the tolerance, on average, that `places` looks at one by one."""


class Scored(NamedTuple):
    """A map as it is scored.

    Attributes:
        mesh: the covered faces, in the order of the whole mesh.
        parameterization: their map.
        reference: another map of the same faces, or None.
        coverage: share of the 3D area, from 0 to 1, that the map covers (of the faces, where no
            face has an area).
        welded: number of vertices that lie where another one does.
    """

    mesh: Mesh
    parameterization: Parameterization
    reference: Parameterization | None
    coverage: float
    welded: int


def scored(
    mesh: Mesh, parameterization: Parameterization, reference: Parameterization | None = None
) -> Scored:
    """The covered faces of a map, their vertices welded.

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
        tolerance: points whose coordinates differ by no more, directly or through others, lie at
            one place. Where more than `CROWD` others are so near to a point on average, one point
            stands for those within half the tolerance, and takes in what is within 1.5 of it.
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
    """The tolerance of `places` for (N, k) points: SAME_PLACE of the diagonal of their box."""
    return SAME_PLACE * math.hypot(*np.ptp(points, axis=0)) if len(points) else 0.0


def _joined(parameterization: Parameterization, faces: IntArray) -> Parameterization:
    """The map with one row of uv for all corners at one vertex of `faces` (F, 3) that agree."""
    uv = parameterization.uv[parameterization.corners.reshape(-1)]
    in_the_plane = places(uv, same_place(uv))
    row = places(np.stack([faces.reshape(-1), in_the_plane], axis=1))
    joined = np.empty((int(row.max()) + 1, 2))
    joined[row] = uv
    return Parameterization(joined, row.reshape(-1, 3))
