"""The conformal layout of a planar domain, exact where the surface unrolls, as a ribbon does."""

from __future__ import annotations

import igl
import numpy as np

from parapoint.planar.bijection import is_bijective
from parapoint.planar.domains import far_pair
from parapoint.planar.scaffold import of_area_one
from parapoint.surfaces.areas import signed_areas
from parapoint.surfaces.surface import FloatArray, Mesh


def conformal_layout(mesh: Mesh) -> FloatArray | None:
    """(V, 2) the least-squares conformal map of a planar domain, of its area, if it is one to one.

    B. Levy et al. 2002, "Least squares conformal maps for automatic texture atlas generation", as
    libigl solves it. None where it has no solution, or covers itself.

    Args:
        mesh: the domain, faces counter-clockwise, all its vertices referenced.
    """
    unit = of_area_one(mesh.vertices, mesh.faces)
    loop = unit.boundary_loops[0]
    pins = loop[list(far_pair(unit.vertices[loop]))]
    try:
        uv, _ = igl.lscm(unit.vertices, unit.faces, pins, np.array([[0.0, 0.0], [1.0, 0.0]]))
    except RuntimeError:  # faces too thin for numbers
        return None
    area = signed_areas(uv, unit.faces).sum()
    if not (area > 0 and is_bijective(unit, uv)):  # nor if not a number
        return None
    return np.asarray(uv * np.sqrt(mesh.face_areas.sum() / area))
