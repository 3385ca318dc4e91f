"""A nearly conformal map of a planar domain to the plane without flips or overlaps, of even scale.

A planar layout of even scale that does not cover itself is the start. From another one the map goes
towards it: Tutte's embedding is bijective, and an isometric energy of the map from it to the
layout, or to the surface where there is no layout, is brought down. Last comes the conformal
energy: of the many maps that are nearly conformal it then finds one of even scale. In all of this
the space around the map is triangulated too and kept from turning over, so that the boundary never
crosses itself (Jiang, Schaefer and Panozzo 2017, "Simplicial complex augmentation framework for
bijective maps"; libigl has it, on J. R. Shewchuk's Triangle).
"""

from __future__ import annotations

import math
import time
from typing import Any

import igl
import numpy as np
from igl import triangle
from scipy import sparse
from scipy.sparse.linalg import splu

from parapoint.surfaces.surface import FloatArray, IntArray, Mesh, edge_table

LEAST_GAIN = 0.02
"""A descent ends when a step lowers what is left of the energy by less than this share."""
CLOSE, EXACT = 5e-4, 1e-14
"""An excess of energy this small is none: on the way to the layout, which is no goal of its own,
and of the map."""
MOST_STEPS = 50
"""Steps of a descent at most."""
LARGE = 1e4
"""The side of the map on which libigl works: its line search takes a change of area of less than
1e-10 for none, and would turn over the small faces of a map of side 1."""
AT_LAYOUT = 0.1
"""Excess of energy at which a map has come to the layout, so that it needs no other way there."""
MOST_ROUNDS = 10
"""Ways to the layout that are tried at most; one to five are taken."""
FLATTEST = 1e-22
"""Least area of a face, of the surface or the disk of radius 1: below it rounding decides."""


class BijectionError(RuntimeError):
    """No bijective map was found; the message says why."""


def bijective_map(mesh: Mesh, layout: FloatArray | None, deadline: float = math.inf) -> FloatArray:
    """(V, 2) a nearly conformal bijective map of a connected planar domain.

    Args:
        mesh: the domain, faces counter-clockwise.
        layout: (V, 2) a nearly conformal map whose scale is wanted, faces perhaps on one another;
            None where none is known.
        deadline: no step begins after this time of `time.monotonic`: the map is then as far as it
            came.

    Raises:
        BijectionError: a face is flat, or in Tutte's embedding too small for numbers.
    """
    size = np.sqrt(mesh.face_areas.sum())
    mesh, start = _embedded(mesh)
    uv = start
    flat = None if layout is None else _of_area_one(np.pad(layout, ((0, 0), (0, 1))), mesh.faces)
    if flat is not None and is_bijective(flat, flat.vertices[:, :2]):
        uv = flat.vertices[:, :2]
    elif flat is not None and flat.face_areas.min() > FLATTEST:
        uv = _led(mesh, flat, uv, deadline)
    else:
        uv = _descended(mesh, uv, igl.SYMMETRIC_DIRICHLET, EXACT, deadline)
    uv = _descended(mesh, uv, igl.CONFORMAL, EXACT, deadline)
    if uv is start and time.monotonic() < deadline:
        raise BijectionError("no step lowers its distortion")
    return np.asarray(size * uv)


def isometric_map(mesh: Mesh) -> FloatArray:
    """(V, 2) a bijective map of a connected planar domain of small symmetric Dirichlet energy.

    Raises:
        BijectionError: as of `bijective_map`.
    """
    size = np.sqrt(mesh.face_areas.sum())
    return np.asarray(size * _descended(*_embedded(mesh), igl.SYMMETRIC_DIRICHLET, EXACT))


def _embedded(mesh: Mesh) -> tuple[Mesh, FloatArray]:
    """The mesh and Tutte's embedding (V, 2), both of area 1.

    Raises:
        BijectionError: as of `bijective_map`.
    """
    mesh = _of_area_one(mesh.vertices, mesh.faces)
    if not mesh.face_areas.min() > FLATTEST:
        raise BijectionError("a face has no area")
    uv = tutte(mesh)
    areas = signed_areas(uv, mesh.faces)
    if not (np.isfinite(uv).all() and areas.min() > FLATTEST):
        raise BijectionError("its embedding in the disk has flat triangles")
    return mesh, np.asarray(uv / np.sqrt(areas.sum()))


def _of_area_one(vertices: FloatArray, faces: IntArray) -> Mesh:
    """A mesh scaled so; as it is where it has no area."""
    area = Mesh(vertices, faces).face_areas.sum()
    return Mesh(vertices / (np.sqrt(area) or 1.0), faces)


def is_bijective(mesh: Mesh, uv: FloatArray) -> bool:
    """Whether a map (V, 2) of a planar domain is one to one, faces counter-clockwise.

    Where no face is turned over it is if the images of the boundary's edges do not cross.
    """
    if not (signed_areas(uv, mesh.faces) > 0).all():
        return False
    start = np.concatenate(mesh.boundary_loops)
    end = np.concatenate([np.roll(loop, -1) for loop in mesh.boundary_loops])
    low, high = np.minimum(uv[start], uv[end]), np.maximum(uv[start], uv[end])
    meets = ((low[:, None] <= high) & (low <= high[:, None])).all(axis=2)
    one, other = np.nonzero(np.triu(meets, 1))
    apart = (start[one] != end[other]) & (end[one] != start[other])
    ends = start[one], end[one], start[other], end[other]
    a, b, c, d = (uv[rows[apart]] for rows in ends)
    return not ((_side(a, b, c) != _side(a, b, d)) & (_side(c, d, a) != _side(c, d, b))).any()


def _side(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """(n,) on which side of the line from a to b the point c is: 1 left, -1 right, 0 on it."""
    first, second = b - a, c - a
    return np.asarray(np.sign(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]))


def tutte(mesh: Mesh) -> FloatArray:
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


def signed_areas(uv: FloatArray, faces: IntArray) -> FloatArray:
    """(F,) signed areas of triangles in the plane."""
    a, b = uv[faces[:, 1]] - uv[faces[:, 0]], uv[faces[:, 2]] - uv[faces[:, 0]]
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / 2


def _led(mesh: Mesh, flat: Mesh, uv: FloatArray, deadline: float) -> FloatArray:
    """(V, 2) the bijective map `uv` (V, 2) of a mesh led towards the layout `flat`.

    Where it is held up on the way, among triangles that Tutte's embedding squeezes, the conformal
    energy opens these, and it sets out again.
    """
    left = math.inf
    for _ in range(MOST_ROUNDS):
        uv = _descended(flat, uv, igl.SYMMETRIC_DIRICHLET, CLOSE, deadline)
        before, left = left, _excess(flat, uv, igl.SYMMETRIC_DIRICHLET)
        if left < AT_LAYOUT or not left < (1 - LEAST_GAIN) * before:
            break
        uv = _descended(mesh, uv, igl.CONFORMAL, EXACT, deadline)
    return uv


def _descended(
    mesh: Mesh,
    uv: FloatArray,
    energy: igl.MappingEnergyType,
    least: float,
    deadline: float = math.inf,
) -> FloatArray:
    """(V, 2) the bijective map `uv` (V, 2) moved down an energy by steps that gain `least`."""
    state = triangle.SCAFData()
    triangle.scaf_precompute(
        np.asfortranarray(LARGE * mesh.vertices),
        np.asfortranarray(mesh.faces.astype(np.int32)),
        np.asfortranarray(LARGE * uv),
        energy,
        np.zeros(0, dtype=np.int32),
        np.zeros((0, 2), order="F"),
        0.0,
        state,
    )
    before = np.inf
    for _ in range(MOST_STEPS):
        if time.monotonic() > deadline:
            break
        moved = np.array(triangle.scaf_solve(1, state)[:, :2]) / LARGE
        if not (signed_areas(moved, mesh.faces) > 0).all():  # nor if not a number
            break
        uv, after = moved, _excess(mesh, moved, energy)
        if not before - after > LEAST_GAIN * after + least:
            break
        before = after
    return uv


def _excess(mesh: Mesh, uv: FloatArray, energy: igl.MappingEnergyType) -> float:
    """The mean of an energy over the area, above its least value, in units of this."""
    faces = mesh.faces
    edges = [
        np.linalg.norm(of[faces[:, i]] - of[faces[:, j]], axis=1)
        for i, j in ((1, 2), (2, 0), (0, 1))
        for of in (mesh.vertices, uv)
    ]
    area, image = mesh.face_areas, np.abs(signed_areas(uv, faces))
    a, a_uv, b, b_uv, c, c_uv = (edge**2 for edge in edges)
    # σ1² + σ2² of the map that takes a triangle of sides a, b, c to one of other sides.
    squares = (a_uv * (b + c - a) + b_uv * (c + a - b) + c_uv * (a + b - c)) / (8 * area**2)
    product = image / area
    if energy == igl.CONFORMAL:
        values = squares / (2 * product)
    elif energy == igl.SYMMETRIC_DIRICHLET:
        values = squares * (1 + 1 / product**2) / 4
    else:  # log² σ1 + log² σ2, by log σ1σ2 and log σ1/σ2
        ratio = np.arccosh(np.maximum(squares / (2 * product), 1))
        values = 1 + (np.log(product) ** 2 + ratio**2) / 2
    return float(values @ area / area.sum()) - 1
