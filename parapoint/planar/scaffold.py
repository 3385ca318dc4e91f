"""Descent of an energy of a map of a planar domain that stays one to one.

The space around the map is triangulated too and kept from turning over, so that the boundary never
crosses itself (Jiang, Schaefer and Panozzo 2017, "Simplicial complex augmentation framework for
bijective maps"; libigl has it, on J. R. Shewchuk's Triangle).
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import igl
import numpy as np
from igl import triangle

from parapoint import clock
from parapoint.surfaces.areas import signed_areas
from parapoint.surfaces.surface import BoolArray, FloatArray, IntArray, Mesh

LEAST_GAIN = 0.02
"""A descent ends when a step lowers the energy's excess by less than this share of it."""
EXACT = 1e-14
"""An energy that is no farther above its least value than this, in units of it, is at its least."""
MOST_STEPS = 50
"""Steps of a descent at most."""
OPENING_STEPS = 100
"""Steps of a descent at most where a new cut has to open first."""
PATIENCE = 20
"""Steps that a new cut may take to open before the energy must fall by LEAST_GAIN."""
OPENING = 0.3
"""How far each side of a new cut is moved, in the least height of the triangles there. Below a half
no triangle turns over."""
LARGE = 1e4
"""The side of the map on which libigl works: its line search takes a change of area of less than
1e-10 for none, and would turn over the small faces of a map of side 1."""
LONGEST_BOX = 4.0
"""How many times as long as wide the box around a map may be. libigl puts a frame around it, three
times as large: that of a long box has few and long edges close to the map, and the space between is
filled with ever smaller triangles. They hold up the map, and beside a ribbon of 2,000 faces took
all of a machine's memory."""


def of_area_one(vertices: FloatArray, faces: IntArray) -> Mesh:
    """The mesh scaled to an area of 1; a mesh without area stays as it is."""
    area = Mesh(vertices, faces).face_areas.sum()
    return Mesh(vertices / (np.sqrt(area) or 1.0), faces)


def descended(
    mesh: Mesh,
    uv: FloatArray,
    energy: igl.MappingEnergyType,
    least: float = EXACT,
    deadline: float = math.inf,
) -> FloatArray:
    """The map `uv` (V, 2), one to one, moved down an energy by steps that gain `least` each.

    Args:
        mesh: the domain, of area 1.
        uv: (V, 2) a map of it, one to one, of area 1 or so.
        energy: libigl's name of the energy.
        least: fall of the excess that a step must bring, beside LEAST_GAIN.
        deadline: no step begins after this time of `clock.worked`.
    """
    before = np.inf
    for moved in steps_down(mesh, uv, energy, deadline):
        uv, after = moved, excess(mesh, moved, energy)
        if not before - after > LEAST_GAIN * after + least:
            break
        before = after
    return uv


def cut_opened(
    mesh: Mesh,
    uv: FloatArray,
    energy: igl.MappingEnergyType,
    deadline: float = math.inf,
) -> FloatArray:
    """Open a map (V, 2) along a new cut, where its boundary touches itself, and lower its energy.

    Args:
        mesh: the domain after the cut, of area 1.
        uv: (V, 2) the map before the cut, one to one but for the copies of the cut's vertices.
        energy: libigl's name of the energy.
        deadline: no step begins after this time of `clock.worked`.
    """
    _, place, copies = np.unique(uv, axis=0, return_inverse=True, return_counts=True)
    uv = moved_apart(mesh, uv, copies[place.reshape(-1)] > 1)
    course = [excess(mesh, uv, energy)]
    for moved in steps_down(mesh, uv, energy, deadline, OPENING_STEPS):
        uv = moved
        course.append(excess(mesh, uv, energy))
        if len(course) > PATIENCE and course[-1] > (1 - LEAST_GAIN) * course[-1 - PATIENCE]:
            break
    return uv


def moved_apart(mesh: Mesh, uv: FloatArray, is_copied: BoolArray) -> FloatArray:
    """The map (V, 2) with the two copies of each vertex of a new cut moved apart by OPENING.

    Each copy moves into its own side, along the line that halves the angle of the boundary there.

    Args:
        mesh: a planar domain, faces counter-clockwise.
        uv: (V, 2) a map of it without flips.
        is_copied: (V,) the vertices of the cut, but for its tip.
    """
    size = len(mesh.vertices)
    rim = mesh.halfedges[mesh.edge_face_count[mesh.edge_of_halfedge] == 1]
    ahead, back = np.zeros((size, 2)), np.zeros((size, 2))
    ahead[rim[:, 0]] = uv[rim[:, 1]] - uv[rim[:, 0]]
    back[rim[:, 1]] = uv[rim[:, 0]] - uv[rim[:, 1]]
    start = np.arctan2(ahead[:, 1], ahead[:, 0])
    turn = (np.arctan2(back[:, 1], back[:, 0]) - start) % (2 * np.pi)
    inwards = start + turn / 2
    corners = uv[mesh.faces]
    longest = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).max(axis=1)
    heights = np.repeat(2 * signed_areas(uv, mesh.faces) / longest, 3)
    least = np.full(size, np.inf)
    np.minimum.at(least, mesh.faces.reshape(-1), heights)
    step = OPENING * np.where(is_copied, least, 0.0)
    return np.asarray(uv + step[:, None] * np.stack([np.cos(inwards), np.sin(inwards)], axis=1))


def steps_down(
    mesh: Mesh,
    uv: FloatArray,
    energy: igl.MappingEnergyType,
    deadline: float = math.inf,
    most: int = MOST_STEPS,
) -> Iterator[FloatArray]:
    """The maps (V, 2) after each of at most `most` steps; none after one that fails."""
    state, turn = None, np.eye(2)
    for _ in range(most):
        if clock.worked() > deadline:
            return
        is_long = _is_long(uv @ turn)
        turn = _to_diagonal(uv) if is_long else turn
        if state is None or is_long:
            state = _begun(mesh, uv @ turn, energy)
        uv = np.array(triangle.scaf_solve(1, state)[:, :2]) @ turn.T / LARGE
        if not (signed_areas(uv, mesh.faces) > 0).all():  # nor if not a number
            return
        yield uv


def _begun(mesh: Mesh, uv: FloatArray, energy: igl.MappingEnergyType) -> triangle.SCAFData:
    """The descent before its first step."""
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
    return state


def _is_long(uv: FloatArray) -> bool:
    """Whether the box around a map (V, 2) leaves its frame too near."""
    sides = np.ptp(uv, axis=0)
    return bool(sides.max() > LONGEST_BOX * sides.min())


def _to_diagonal(uv: FloatArray) -> FloatArray:
    """(2, 2) the turn that lays the longest way of a map (V, 2) along the diagonal of its box."""
    _, _, axes = np.linalg.svd(uv - uv.mean(axis=0), full_matrices=False)
    x, y = axes[0]
    cos, sin = np.array([x + y, x - y]) / math.sqrt(2)
    return np.array([[cos, sin], [-sin, cos]])


def free_steps_down(
    mesh: Mesh,
    uv: FloatArray,
    energy: igl.MappingEnergyType,
    deadline: float = math.inf,
) -> Iterator[FloatArray]:
    """As `steps_down`, of maps without flips whose boundary may cross itself."""
    state = igl.slim_precompute(
        np.asfortranarray(LARGE * mesh.vertices),
        np.asfortranarray(mesh.faces.astype(np.int32)),
        np.asfortranarray(LARGE * uv),
        energy,
        np.zeros(0, dtype=np.int32),
        np.zeros((0, 2), order="F"),
        0.0,
    )
    for _ in range(MOST_STEPS):
        if clock.worked() > deadline:
            return
        moved = np.ascontiguousarray(igl.slim_solve(state, 1)[:, :2]) / LARGE
        if not (signed_areas(moved, mesh.faces) > 0).all():
            return
        yield moved


def excess(mesh: Mesh, uv: FloatArray, energy: igl.MappingEnergyType) -> float:
    """The mean of an energy over the area, above its least value, in units of this."""
    area = mesh.face_areas
    return float(energy_densities(mesh, uv, energy) @ area / area.sum()) - 1


def energy_densities(mesh: Mesh, uv: FloatArray, energy: igl.MappingEnergyType) -> FloatArray:
    """(F,) an energy of each triangle's map, in units of its least value."""
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
        return np.asarray(squares / (2 * product))
    if energy == igl.SYMMETRIC_DIRICHLET:
        return np.asarray(squares * (1 + 1 / product**2) / 4)
    raise ValueError(f"no formula for {energy}")
