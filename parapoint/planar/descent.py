"""A one-to-one map of a planar domain, and the way down its symmetric Dirichlet energy."""

from __future__ import annotations

import math
import time

import igl
import numpy as np

from parapoint.planar.bijection import BijectionError, isometric_map
from parapoint.planar.crossing import crossing_vertices
from parapoint.planar.domains import FlatteningError, check_triangles
from parapoint.planar.scaffold import (
    cut_opened,
    energy_densities,
    of_area_one,
    steps_down,
)
from parapoint.surfaces.areas import signed_areas
from parapoint.surfaces.cutting import cut_along, origin
from parapoint.surfaces.surface import FloatArray, IntArray, Mesh

ENERGY = igl.SYMMETRIC_DIRICHLET
LEAST_ENERGY = 4.0
"""The energy of an isometry."""
SETTLED = 1e-3
"""A map is at its best once a step lowers the energy's excess by less than this share of it."""


class Run:
    """A map that stays one to one while it changes.

    Attributes:
        mesh: the domain, all its vertices referenced.
        uv: (V, 2) the map so far, without flips, in the scale of the mesh.
        energy: its symmetric Dirichlet energy: the mean over the area of s1² + s1⁻² + s2² + s2⁻²,
            of the singular values s1 and s2 of each triangle's map.
        unit: sqrt(area).
        start: what it began with.
        branches: branches that the seam grew.
        deadline: `time.monotonic()` after which no step begins.
    """

    def __init__(self, mesh: Mesh, deadline: float = math.inf) -> None:
        self.mesh, self.deadline = mesh, deadline
        self.unit = float(np.sqrt(mesh.face_areas.sum()))
        self.uv: FloatArray = np.zeros((0, 2))
        self.energy, self.start, self.branches = math.inf, "none", 0

    @property
    def is_late(self) -> bool:
        """Whether the time is up."""
        return time.monotonic() > self.deadline

    def begin(self, uv: FloatArray | None) -> None:
        """Start from an isometric map or, if it is one to one and has less energy, from `uv`.

        Args:
            uv: (V, 2) another map, such as the computed one; it is brought to the mesh's scale.

        Raises:
            FlatteningError: the mesh has no isometric map to start from.
        """
        try:
            self.take(isometric_map(self.mesh), "isometric")
        except BijectionError as error:
            raise FlatteningError(f"no start without flips was found: {error}") from None
        if uv is None or (areas := signed_areas(uv, self.mesh.faces)).min() <= 0:
            return
        uv = uv * (self.unit / np.sqrt(areas.sum()))
        if self.energy_of(uv) < self.energy and len(crossing_vertices(self.mesh, uv)) == 0:
            self.take(uv, "computed")

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

    def improve(self) -> None:
        """Bring the energy down until the map has settled."""
        unit = of_area_one(self.mesh.vertices, self.mesh.faces)
        for moved in steps_down(unit, self.uv / self.unit, ENERGY, self.deadline):
            uv = self.unit * moved
            before, after = self.energy, self.energy_of(uv)
            if not after < before:
                return
            self.uv, self.energy = uv, after
            if before - after < SETTLED * (after - LEAST_ENERGY):
                return

    def cut(self, path: IntArray) -> Run | None:
        """Another run whose seam is longer by a path of vertices (n,); None where that fails."""
        mesh = cut_along(self.mesh, np.stack([path[:-1], path[1:]], axis=1))
        longer = Run(mesh, self.deadline)
        uv = self.uv[origin(self.mesh, mesh)] / self.unit
        moved = cut_opened(of_area_one(mesh.vertices, mesh.faces), uv, ENERGY, self.deadline)
        if len(crossing_vertices(mesh, moved)):
            return None
        longer.take(self.unit * moved, self.start)
        longer.branches = self.branches + 1
        return longer

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
    used, faces = np.unique(mesh.faces, return_inverse=True)
    return Mesh(mesh.vertices[used], faces.reshape(-1, 3))
