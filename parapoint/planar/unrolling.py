"""The flat layout of a surface that unrolls without distortion, as a ribbon or a pipe cut open."""

from __future__ import annotations

import igl
import numpy as np

from parapoint.planar.bijection import is_bijective
from parapoint.planar.domains import far_pair
from parapoint.planar.scaffold import excess, of_area_one
from parapoint.surfaces.areas import signed_areas
from parapoint.surfaces.surface import FloatArray, Mesh

MOST_EXCESS = 1e-3
"""Excess of the symmetric Dirichlet energy, in units of its least value, below which a surface
unrolls: its lengths are off by 2 % or so."""


def unrolled(mesh: Mesh) -> FloatArray | None:
    """(V, 2) the flat layout of a planar domain, of its area; None unless it unrolls, one to one.

    The least-squares conformal map (B. Levy et al. 2002) of such a surface keeps lengths, too. From
    Tutte's embedding it is dozens of steps away where the surface is long, and these may end first.

    Args:
        mesh: the domain, faces counter-clockwise, all its vertices referenced.
    """
    unit = of_area_one(mesh.vertices, mesh.faces)
    loop = unit.boundary_loops[0]
    pins = loop[list(far_pair(unit.vertices[loop]))]
    uv, _ = igl.lscm(unit.vertices, unit.faces, pins, np.array([[0.0, 0.0], [1.0, 0.0]]))
    area = signed_areas(uv, unit.faces).sum()
    if not area > 0:  # nor if not a number
        return None
    uv = np.asarray(uv / np.sqrt(area))
    if not (is_bijective(unit, uv) and excess(unit, uv, igl.SYMMETRIC_DIRICHLET) < MOST_EXCESS):
        return None
    return np.asarray(uv * np.sqrt(mesh.face_areas.sum()))
