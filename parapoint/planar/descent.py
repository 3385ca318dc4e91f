"""A one-to-one map of a planar domain, and the way down its symmetric Dirichlet energy."""

from __future__ import annotations

import math

import igl
import numpy as np

from parapoint import clock
from parapoint.planar.bijection import BijectionError, embedded
from parapoint.planar.crossing import crossing_vertices
from parapoint.planar.domains import FlatteningError, check_triangles
from parapoint.planar.scaffold import (
    cut_opened,
    energy_densities,
    free_steps_down,
    of_area_one,
    steps_down,
)
from parapoint.planar.unrolling import conformal_layout
from parapoint.surfaces.cutting import cut_along, edge_lengths, origin, path_edges
from parapoint.surfaces.surface import FloatArray, IntArray, Mesh, compact

ENERGY = igl.SYMMETRIC_DIRICHLET
LEAST_ENERGY = 4.0
"""The energy of an isometry."""
UNROLLED = 4.004
"""Energy of a conformal layout below which the surface unrolls: lengths are off by 2 % or so. A
descent from Tutte's embedding takes dozens of steps to it where the surface is long, and may end
before it is there."""
SETTLED = 1e-3
"""A map is at its best once a step lowers the energy's excess by less than this share of it."""
MANY = 50_000
"""Faces from which on a step takes a second or more, and none is taken for what nobody sees."""
UNSEEN = 1e-3
"""A map of so many faces is at its best, too, once a step lowers the energy by less; that is 4 at
least. Where a surface unrolls without distortion, each step takes away a tenth of what is left,
however little that is; and a noisy scan of 160,000 faces comes from 4.196 to 4.190 in twelve more
steps."""
REACH = 10
"""A goal is in sight if the descent would reach it in at most this many steps like its last one."""


class Run:
    """A map that stays one to one while it changes.

    Attributes:
        mesh: the domain, all its vertices referenced.
        uv: (V, 2) the map so far, without flips, in the scale of the mesh.
        energy: its symmetric Dirichlet energy: the mean over the area of s1² + s1⁻² + s2² + s2⁻²,
            of the singular values s1 and s2 of each triangle's map.
        unit: sqrt(area).
        start: what it began with.
        tips: the vertices of the first domain to which branches of the seam were grown, in order.
        grown_from: the run before the last branch, and the branch's path of vertices to the seam.
        is_free: whether the boundary may cross itself; the map is then without flips, but perhaps
            not one to one.
        deadline: `clock.worked()` after which no step begins.
    """

    def __init__(self, mesh: Mesh, deadline: float = math.inf, *, is_free: bool = False) -> None:
        self.mesh, self.deadline, self.is_free = mesh, deadline, is_free
        self.unit = float(np.sqrt(mesh.face_areas.sum()))
        self.uv: FloatArray = np.zeros((0, 2))
        self.energy, self.start = math.inf, "none"
        self.tips: tuple[int, ...] = ()
        self.grown_from: tuple[Run, IntArray] | None = None

    @property
    def branches(self) -> int:
        """Branches that the seam grew."""
        return len(self.tips)

    @property
    def rim(self) -> float:
        """Length of the boundary, in which each edge of the seam counts twice."""
        return float(edge_lengths(self.mesh)[self.mesh.edge_face_count == 1].sum())

    @property
    def is_late(self) -> bool:
        """Whether the time is up."""
        return clock.worked() > self.deadline

    def begin(self) -> None:
        """Start from the surface unrolled, or from Tutte's embedding of one that does not unroll.

        Where the embedding is too flat for numbers, the conformal layout is the start.

        Raises:
            FlatteningError: that layout is not one to one either.
        """
        flat = conformal_layout(self.mesh)
        if flat is not None and self.energy_of(flat) < UNROLLED:
            self.take(flat, "unrolled")
            return
        try:
            _, uv = embedded(self.mesh)
        except BijectionError as error:
            if flat is None:
                raise FlatteningError(f"no start without flips was found: {error}") from None
            self.take(flat, "conformal")
            return
        self.take(self.unit * uv, "embedded")

    def take(self, uv: FloatArray, start: str) -> None:
        """Go on from a map (V, 2) that is one to one, in the scale of the mesh."""
        self.uv, self.start, self.energy = uv, start, self.energy_of(uv)

    def densities(self) -> FloatArray:
        """(F,) energy of each triangle."""
        return self._densities(self.uv)

    def energy_of(self, uv: FloatArray) -> float:
        """The mean energy of a map (V, 2) over the area."""
        area = self.mesh.face_areas
        return float(area @ self._densities(uv) / area.sum())

    def _densities(self, uv: FloatArray) -> FloatArray:
        return np.asarray(LEAST_ENERGY * energy_densities(self.mesh, uv, ENERGY))

    def improve(self, goal: float = math.inf) -> None:
        """Bring the energy down until the map has settled, or cannot be brought to a goal.

        Args:
            goal: an energy; the descent ends where so much is not in sight (REACH).
        """
        unit = of_area_one(self.mesh.vertices, self.mesh.faces)
        down = free_steps_down if self.is_free else steps_down
        unseen = UNSEEN if len(self.mesh.faces) > MANY else 0.0
        for moved in down(unit, self.uv / self.unit, ENERGY, self.deadline):
            uv = self.unit * moved
            before, after = self.energy, self.energy_of(uv)
            if not after < before:
                return
            self.uv, self.energy = uv, after
            if before - after < max(SETTLED * (after - LEAST_ENERGY), unseen):
                return
            if after - goal > REACH * (before - after):
                return

    def cut(self, path: IntArray, goal: float = math.inf) -> Run | None:
        """Another run whose seam is longer by a path of vertices (n,); None where that fails.

        Args:
            path: from a vertex inside to the seam or the boundary.
            goal: as of `improve`, for a free map.
        """
        mesh = cut_along(self.mesh, path_edges(path))
        longer = Run(mesh, self.deadline, is_free=self.is_free)
        longer.tips = (*self.tips, int(path[0]))  # a cut leaves its vertex where it was
        uv = self.uv[origin(self.mesh, mesh)]
        if self.is_free:
            longer.take(uv, self.start)
            longer.improve(goal)
            return longer
        unit = of_area_one(mesh.vertices, mesh.faces)
        moved = cut_opened(unit, uv / self.unit, ENERGY, self.deadline)
        if len(crossing_vertices(mesh, moved)):
            return None
        longer.take(self.unit * moved, self.start)
        return longer

    def freed(self) -> Run:
        """This map as a free one that has settled, in half of the time that is left."""
        left = self.deadline - clock.worked()
        free = Run(self.mesh, clock.worked() + left / 2, is_free=True)
        free.take(self.uv, self.start)
        free.tips = self.tips
        free.improve()
        return free

    def held(self, deadline: float) -> Run | None:
        """A map of the same domain, begun anew, that is one to one; None where that fails."""
        held = Run(self.mesh, deadline)
        try:
            held.begin()
        except FlatteningError:
            return None
        held.improve()
        held.tips = self.tips
        return held

    def report(self) -> dict[str, object]:
        """What stands beside the map."""
        return {
            "energy": "symmetric_dirichlet",
            "end_energy": self.energy,
            "start": self.start,
            "bijective": len(crossing_vertices(self.mesh, self.uv)) == 0,
            "branches_added": self.branches,
        }


def sound(mesh: Mesh) -> Mesh:
    """The mesh without unreferenced vertices.

    Raises:
        InputError: a triangle has no area.
    """
    check_triangles(mesh.vertices, mesh.faces)
    return compact(mesh.vertices, mesh.faces)
