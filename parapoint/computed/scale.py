"""The scale of conformal maps of a planar domain, which linear solves tell without the map.

It follows from the curvature and from its values at the boundary (Springborn, Schröder and Pinkall
2008, "Conformal equivalence of triangle meshes", section 5), and these are free.
"""

from __future__ import annotations

import igl
import numpy as np
from scipy import sparse
from scipy.optimize import minimize

from parapoint.planar.embedding import factored
from parapoint.surfaces.surface import FloatArray, IntArray, Mesh

COTANGENTS = (0.02, 20.0)
"""Range of the edge weights of a Laplacian: positive, for the maximum principle."""
WAVES = 8
"""Waves of the scale around the boundary at most, where it is made even."""
EVEN = 0.05
"""A face whose area is off by less than this share counts less than in proportion."""
MOST_STEPS = 60
"""Steps in which the scale is made even at most; some 15 are taken."""


def laplacian(mesh: Mesh) -> sparse.csc_matrix:
    """(V, V) positive cotangent Laplacian, its edge weights kept within COTANGENTS."""
    rows, columns, halves = [], [], []
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        at, left, right = (mesh.faces[:, n] for n in (i, j, k))
        a, b = (mesh.vertices[end] - mesh.vertices[at] for end in (left, right))
        area = np.linalg.norm(np.cross(a, b), axis=1)
        cotangent = np.clip((a * b).sum(axis=1) / np.maximum(area, 1e-300), -1e6, 1e6)
        rows += [left, right]
        columns += [right, left]
        halves += [cotangent / 2] * 2
    entries = np.concatenate(halves), (np.concatenate(rows), np.concatenate(columns))
    weight = sparse.coo_matrix(entries, (len(mesh.vertices),) * 2).tocsc()
    weight.data = np.clip(weight.data, *COTANGENTS)
    return (sparse.diags_array(np.asarray(weight.sum(axis=1)).reshape(-1)) - weight).tocsc()


def _curvature(mesh: Mesh) -> FloatArray:
    """(V,) angle defect at inner vertices, turning angle at those of the boundary."""
    angles = igl.internal_angles(mesh.vertices, mesh.faces)
    total = np.bincount(mesh.faces.reshape(-1), np.nan_to_num(angles).reshape(-1))
    flat = np.full(len(total), 2 * np.pi)
    flat[np.concatenate(mesh.boundary_loops)] = np.pi
    return np.asarray(flat - total)


def turning(mesh: Mesh, scale: FloatArray) -> FloatArray:
    """(loops,) angle by which each boundary loop turns in the metric of a log scale (V,)."""
    bend = _curvature(mesh) + laplacian(mesh) @ scale
    return np.array([bend[loop].sum() for loop in mesh.boundary_loops])


class _InnerLaplacian:
    """The Laplacian of a mesh, factored where values at the boundary are given.

    Attributes:
        matrix: (V, V), of all vertices.
        inside: (I,) the vertices off the boundary.
    """

    def __init__(self, mesh: Mesh) -> None:
        boundary = np.concatenate(mesh.boundary_loops)
        self.matrix = laplacian(mesh)
        self.inside: IntArray = np.setdiff1d(np.arange(len(mesh.vertices)), boundary)
        self._rows = self.matrix[self.inside]
        self._factor = factored(self._rows[:, self.inside]) if len(self.inside) else None

    def solved(self, right: FloatArray) -> FloatArray:
        """(I, ...) the values inside whose Laplacian is `right`, (I, ...)."""
        return right if self._factor is None else np.asarray(self._factor.solve(right))

    def pull(self, vertices: IntArray, values: FloatArray) -> FloatArray:
        """(I, ...) what values at some vertices of the boundary ask of those inside."""
        return np.asarray(-(self._rows[:, vertices] @ values))


def log_scale(mesh: Mesh, *, flat_loops: bool = True) -> FloatArray:
    """(V,) log scale of the conformal map of a planar domain that distorts area least.

    It solves Δu = −(angle defect), with u = 0 on the boundary (Springborn, Schröder and Pinkall
    2008, section 5). With `flat_loops` it is a constant on each inner loop instead, such that the
    loop turns by −2π, as in the plane.
    """
    loops = mesh.boundary_loops
    inner_laplacian = _InnerLaplacian(mesh)
    inside, boundary = inner_laplacian.inside, np.concatenate(loops)
    scale = np.zeros(len(mesh.vertices))
    scale[inside] = inner_laplacian.solved(-_curvature(mesh)[inside])
    if not flat_loops or len(loops) == 1:
        return scale
    turns = turning(mesh, scale)
    inner = np.delete(np.arange(len(loops)), turns.argmax())
    unit = np.zeros((len(scale), len(inner)))
    for column, loop in enumerate(inner):
        unit[loops[loop], column] = 1
    unit[inside] = inner_laplacian.solved(inner_laplacian.pull(boundary, unit[boundary]))
    flux = inner_laplacian.matrix @ unit
    response = np.array([flux[loops[loop]].sum(axis=0) for loop in inner])
    return np.asarray(scale + unit @ np.linalg.solve(response, -2 * np.pi - turns[inner]))


def even_scale(mesh: Mesh) -> FloatArray:
    """(V,) log scale of a conformal map of a disk with a small total area discrepancy.

    Beginning with u = 0 on the boundary, its values there are moved by WAVES waves of arc length.
    """
    (loop,) = mesh.boundary_loops
    inner_laplacian = _InnerLaplacian(mesh)
    inside = inner_laplacian.inside
    scale = np.zeros(len(mesh.vertices))
    scale[inside] = inner_laplacian.solved(-_curvature(mesh)[inside])
    sides = np.linalg.norm(mesh.vertices[np.roll(loop, -1)] - mesh.vertices[loop], axis=1)
    place = 2 * np.pi * (np.cumsum(sides) - sides) / sides.sum()
    phase = place[:, None] * np.arange(1, min(WAVES, len(loop) // 4) + 1)
    waves = np.zeros((len(scale), 2 * phase.shape[1]))
    waves[loop] = np.concatenate([np.cos(phase), np.sin(phase)], axis=1)
    waves[inside] = inner_laplacian.solved(inner_laplacian.pull(loop, waves[loop]))
    of_face = waves[mesh.faces].mean(axis=1)
    given, area = scale[mesh.faces].mean(axis=1), mesh.face_areas / mesh.face_areas.sum()

    def discrepancy(height: FloatArray) -> tuple[float, FloatArray]:
        """Of waves of these heights, smooth where it is 0; and its derivatives."""
        ratio = np.exp(2 * np.clip(given + of_face @ height, -30, 30))
        ratio /= area @ ratio
        off = np.sqrt((ratio - 1) ** 2 + EVEN**2)
        pull = 2 * area * (ratio - 1) / off * ratio
        return float(area @ off), of_face.T @ (pull - pull.sum() * area * ratio)

    start = np.zeros(waves.shape[1])
    options = {"maxiter": MOST_STEPS}
    found = minimize(discrepancy, start, jac=True, method="L-BFGS-B", options=options)
    return np.asarray(scale + waves @ found.x)


def area_discrepancy(mesh: Mesh, scale: FloatArray) -> float:
    """Σ |share of the mapped area − share of the area| over the faces, predicted from the scale."""
    mapped = mapped_areas(mesh, scale)
    return float(np.abs(mapped / mapped.sum() - mesh.face_areas / mesh.face_areas.sum()).sum())


def mapped_areas(mesh: Mesh, scale: FloatArray) -> FloatArray:
    """(F,) areas of the faces in the metric of a log scale (V,)."""
    return np.asarray(
        mesh.face_areas * np.exp(2 * np.clip(scale[mesh.faces].mean(axis=1), -30, 30))
    )
