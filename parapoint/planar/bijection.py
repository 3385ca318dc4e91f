"""A nearly conformal map of a planar domain to the plane without flips or overlaps, of even scale.

A planar layout of even scale that does not cover itself is the start. From another one the map goes
towards it: Tutte's embedding is bijective, and an isometric energy of the map from it to the
layout, or to the surface where there is no layout, is brought down. Last comes the conformal
energy: of the many maps that are nearly conformal it then finds one of even scale. In all of
this the boundary never crosses itself (`parapoint.planar.scaffold`).
"""

from __future__ import annotations

import math

import igl
import numpy as np
import shapely

from parapoint import clock
from parapoint.planar.embedding import FLATTEST, embedded_in_disk
from parapoint.planar.scaffold import EXACT, LEAST_GAIN, descended, excess, of_area_one
from parapoint.surfaces.areas import cross, signed_areas
from parapoint.surfaces.surface import FloatArray, Mesh

CLOSE = 5e-4
"""Excess of energy below which a map counts as having reached the layout. It is loose, since the
layout is only a step on the way."""
AT_LAYOUT = 0.1
"""Excess of energy at which a map has come to the layout, so that it needs no other way there."""
MOST_ROUNDS = 10
"""Ways to the layout that are tried at most; one to five are taken."""


class BijectionError(RuntimeError):
    """No bijective map was found; the message says why."""


def bijective_map(mesh: Mesh, layout: FloatArray | None, deadline: float = math.inf) -> FloatArray:
    """(V, 2) a nearly conformal bijective map of a connected planar domain.

    Args:
        mesh: the domain, faces counter-clockwise.
        layout: (V, 2) a nearly conformal map whose scale is wanted, faces perhaps on one another;
            None where none is known.
        deadline: no step begins after this time of `clock.worked`: the map is then as far as it
            came.

    Raises:
        BijectionError: a face is flat, or in Tutte's embedding too small for numbers.
    """
    size = np.sqrt(mesh.face_areas.sum())
    mesh, start = embedded(mesh)
    uv = start
    flat = None if layout is None else of_area_one(np.pad(layout, ((0, 0), (0, 1))), mesh.faces)
    if flat is not None and is_bijective(flat, flat.vertices[:, :2]):
        uv = flat.vertices[:, :2]
    elif flat is not None and flat.face_areas.min() > FLATTEST:
        uv = _led(mesh, flat, uv, deadline)
    else:
        uv = descended(mesh, uv, igl.SYMMETRIC_DIRICHLET, EXACT, deadline)
    uv = descended(mesh, uv, igl.CONFORMAL, EXACT, deadline)
    if uv is start and clock.worked() < deadline:
        raise BijectionError("no step lowers its distortion")
    return np.asarray(size * uv)


def embedded(mesh: Mesh) -> tuple[Mesh, FloatArray]:
    """The mesh and Tutte's embedding (V, 2), both of area 1.

    Raises:
        BijectionError: as of `bijective_map`.
    """
    mesh = of_area_one(mesh.vertices, mesh.faces)
    if not mesh.face_areas.min() > FLATTEST:
        raise BijectionError("a face has no area")
    uv = embedded_in_disk(mesh)
    areas = signed_areas(uv, mesh.faces)
    if not (np.isfinite(uv).all() and areas.min() > FLATTEST):
        raise BijectionError("its embedding in the disk has flat triangles")
    return mesh, np.asarray(uv / np.sqrt(areas.sum()))


def is_bijective(mesh: Mesh, uv: FloatArray) -> bool:
    """Whether a map (V, 2) of a planar domain is one to one, faces counter-clockwise.

    Where no face is turned over it is if the images of the boundary's edges do not cross.
    """
    if not (signed_areas(uv, mesh.faces) > 0).all():
        return False
    start = np.concatenate(mesh.boundary_loops)
    end = np.concatenate([np.roll(loop, -1) for loop in mesh.boundary_loops])
    segments = np.asarray(shapely.linestrings(np.stack([uv[start], uv[end]], axis=1)))
    one, other = shapely.STRtree(segments).query(segments)  # whose boxes meet
    apart = (one < other) & (start[one] != end[other]) & (end[one] != start[other])
    ends = start[one], end[one], start[other], end[other]
    a, b, c, d = (uv[rows[apart]] for rows in ends)
    return not ((_side(a, b, c) != _side(a, b, d)) & (_side(c, d, a) != _side(c, d, b))).any()


def _side(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """(n,) on which side of the line from a to b the point c is: 1 left, -1 right, 0 on it."""
    return np.asarray(np.sign(cross(b - a, c - a)))


def _led(mesh: Mesh, flat: Mesh, uv: FloatArray, deadline: float) -> FloatArray:
    """(V, 2) the bijective map `uv` (V, 2) of a mesh led towards the layout `flat`.

    Where it is held up on the way, among triangles that Tutte's embedding squeezes, the conformal
    energy opens these, and it sets out again.
    """
    left = math.inf
    for _ in range(MOST_ROUNDS):
        uv = descended(flat, uv, igl.SYMMETRIC_DIRICHLET, CLOSE, deadline)
        before, left = left, excess(flat, uv, igl.SYMMETRIC_DIRICHLET)
        if left < AT_LAYOUT or not left < (1 - LEAST_GAIN) * before:
            break
        uv = descended(mesh, uv, igl.CONFORMAL, EXACT, deadline)
    return uv
