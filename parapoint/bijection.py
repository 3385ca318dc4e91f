"""A map of a planar domain to the plane without flips or overlaps, nearly conformal, of even scale.

Tutte's embedding is bijective. From it energies are brought down in turn, with the space around the
map triangulated too and kept from turning over, so that the boundary never crosses itself (Jiang,
Schaefer and Panozzo 2017, "Simplicial complex augmentation framework for bijective maps"; libigl
has it, on J. R. Shewchuk's Triangle). Isometric energies come first: of the many maps that are
nearly conformal, the descent on the conformal energy then finds one of even scale.
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

from parapoint.surface import FloatArray, IntArray, Mesh, edge_table

DESCENTS = (igl.SYMMETRIC_DIRICHLET, igl.LOG_ARAP, igl.CONFORMAL)
"""The energies in turn. Near an isometry libigl's first gives no numbers; the second goes on."""
LEAST_GAIN = 0.02
"""A descent ends when a step lowers what is left of the energy by less than this share."""
EXACT = 1e-14
"""An excess of energy this small is none."""
MOST_STEPS = 50
"""Steps of a descent at most."""
FLATTEST = 1e-22
"""Least area of a face, of the surface or the disk of radius 1: below it rounding decides."""


class BijectionError(RuntimeError):
    """No bijective map was found; the message says why."""


def bijective_map(mesh: Mesh, deadline: float = math.inf) -> FloatArray:
    """(V, 2) a bijective map of a connected planar domain, faces counter-clockwise.

    No step begins after `deadline`, a time of `time.monotonic`: the map is then as far as it came.

    Raises:
        BijectionError: a face is flat, or in Tutte's embedding too small for numbers.
    """
    size = np.sqrt(mesh.face_areas.sum())
    mesh = Mesh(mesh.vertices / size, mesh.faces)
    if not mesh.face_areas.min() > FLATTEST:
        raise BijectionError("a face has no area")
    uv = tutte(mesh)
    areas = signed_areas(uv, mesh.faces)
    if not (np.isfinite(uv).all() and areas.min() > FLATTEST):
        raise BijectionError("its embedding in the disk has flat triangles")
    start = uv = uv / np.sqrt(areas.sum())
    for energy in DESCENTS:
        uv = _descended(mesh, uv, energy, deadline)
    if uv is start and time.monotonic() < deadline:
        raise BijectionError("no step lowers its distortion")
    return np.asarray(size * uv)


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


def _descended(
    mesh: Mesh, uv: FloatArray, energy: igl.MappingEnergyType, deadline: float
) -> FloatArray:
    """(V, 2) the bijective map `uv` (V, 2) moved down an energy."""
    state = triangle.SCAFData()
    triangle.scaf_precompute(
        np.asfortranarray(mesh.vertices),
        np.asfortranarray(mesh.faces.astype(np.int32)),
        np.asfortranarray(uv),
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
        moved = np.array(triangle.scaf_solve(1, state)[:, :2])
        if not (signed_areas(moved, mesh.faces) > 0).all():  # nor if not a number
            break
        uv, after = moved, _excess(mesh, moved, energy)
        if not before - after > LEAST_GAIN * after + EXACT:
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
