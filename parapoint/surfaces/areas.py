"""Areas of a map, and the places that get too little of it."""

from __future__ import annotations

import igl
import numpy as np

from parapoint.surfaces.surface import BoolArray, FloatArray, IntArray, Mesh

STARVED = 0.25
"""A face is starved where its share of the UV area is below this part of its share in space: a
texture then has less than half of the fair number of texels along a side."""
LEAST_PART = 0.01
"""Share of the surface from which on something is a part: a map that starves less starves none."""
MOST_STARVED = 0.02
"""Share of the surface that a map may starve before that is a fault of it."""


def cross(first: FloatArray, second: FloatArray) -> FloatArray:
    """(N,) cross products of plane vectors (N, 2), positive where the second lies to the left."""
    return np.asarray(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0], dtype=np.float64)


def signed_areas(uv: FloatArray, faces: IntArray) -> FloatArray:
    """(F,) area of each triangle in the plane, negative where it is turned over."""
    return np.asarray(igl.doublearea(uv, faces) / 2, dtype=np.float64)


def starved_faces(mesh: Mesh, uv: FloatArray) -> BoolArray:
    """(F,) the faces that a map (V, 2) without flips starves of area."""
    area, uv_area = mesh.face_areas, signed_areas(uv, mesh.faces)
    return np.asarray(uv_area * area.sum() < STARVED * area * uv_area.sum(), dtype=bool)


def starved_share(mesh: Mesh, uv: FloatArray) -> float:
    """The share of the surface that a map (V, 2) without flips starves, from 0 to 1."""
    area = mesh.face_areas
    return float(area[starved_faces(mesh, uv)].sum() / area.sum())
