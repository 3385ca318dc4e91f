"""Descent of the symmetric Dirichlet energy of a map that stays one to one."""

from __future__ import annotations

import math
import time
from contextlib import suppress

import numpy as np

from parapoint.computed.bijection import BijectionError, isometric_map
from parapoint.surfaces.surface import FloatArray, IntArray, Mesh
from parapoint.unwrapping.crossing import crossing_vertices
from parapoint.unwrapping.domains import (
    FlatteningError,
    check_triangles,
    domain,
    frames,
    signed_areas,
    singular_values,
)
from parapoint.unwrapping.energies import DENSITIES, stepper
from parapoint.unwrapping.tutte import tutte

ENERGY = "symmetric_dirichlet"
DENSITY, LEAST_ENERGY = DENSITIES[ENERGY]
HOLD = 1e6
"""Weight of the soft constraint on a vertex that is held at its place for a step."""
MOST_HOLDS = 12
"""How often more vertices are held before a step is given up."""


class Run:
    """SLIM on a planar domain, one step at a time, its boundary kept from crossing itself.

    Attributes:
        mesh: the domain, all its vertices referenced.
        uv: (V, 2) the map so far, without flips.
        energy: its symmetric Dirichlet energy.
        unit: sqrt(area).
        start: what it began with.
        held_steps: steps in which vertices were held.
        branches: branches that the seam grew.
        deadline: `time.monotonic()` after which no step begins.
    """

    def __init__(self, mesh: Mesh, deadline: float = math.inf) -> None:
        self.held_steps = self.branches = 0
        self.deadline = deadline
        self.set(mesh, np.zeros((0, 2)))

    def set(self, mesh: Mesh, uv: FloatArray) -> None:
        """Go on with another domain and a map of it, the energy as it was."""
        self.mesh, self.uv = mesh, uv
        self.unit = float(np.sqrt(mesh.face_areas.sum()))
        self.domain = domain(mesh)
        self.frame = frames(self.domain)

    @property
    def is_late(self) -> bool:
        """Whether the time is up."""
        return time.monotonic() > self.deadline

    def begin(self, uv: FloatArray | None) -> None:
        """Start from an isometric map or, if it is one to one and has less energy, from `uv`.

        SLIM alone is far from its end after 20 steps from Tutte's embedding: on lucy the energy is
        20 with the learned seam and 22 without one, and 7.8 and 19 with this start.

        Args:
            uv: (V, 2) the computed map; it is brought to the scale of the surface.
        """
        self.start, self.uv = self._isometric()
        self.energy = self.energy_of(self.uv)
        if uv is not None and (areas := signed_areas(uv, self.mesh.faces)).min() > 0:
            uv = uv * (self.unit / np.sqrt(areas.sum()))
            energy = self.energy_of(uv)
            if energy < self.energy and len(crossing_vertices(self.mesh, uv)) == 0:
                self.start, self.uv, self.energy = "computed", uv, energy

    def _isometric(self) -> tuple[str, FloatArray]:
        """The name of the start, and a map (V, 2) of small energy; Tutte's where that fails."""
        with suppress(BijectionError):
            uv = isometric_map(self.mesh)
            if len(crossing_vertices(self.mesh, uv)) == 0:
                return "isometric", uv
        uv = tutte(self.domain)
        folded = int((signed_areas(uv, self.mesh.faces) <= 0).sum())
        if folded:
            raise FlatteningError(
                f"SLIM needs a start without flips; Tutte's embedding has {folded} flipped or "
                f"degenerate triangles of {len(self.mesh.faces)}"
            )
        return "tutte", uv

    def densities(self, uv: FloatArray) -> FloatArray:
        """(F,) energy of each triangle."""
        return DENSITY(*singular_values(self.frame, uv, self.mesh.faces))

    def energy_of(self, uv: FloatArray) -> float:
        """The area-weighted mean over the triangles."""
        return float(self.mesh.face_areas @ self.densities(uv) / self.mesh.face_areas.sum())

    def improve(self, steps: int) -> None:
        """Take so many steps; the map stays one to one if it is."""
        for _ in range(steps):
            if self.is_late:
                return
            stepped = self.one_to_one(1)
            if stepped is None:
                return
            self.uv, self.energy = stepped, self.energy_of(stepped)

    def one_to_one(self, steps: int) -> FloatArray | None:
        """(V, 2) the map after some steps, vertices held where need be; None where that fails."""
        held = np.zeros(0, dtype=np.int64)
        for _ in range(MOST_HOLDS):
            uv = self._stepped(held, steps)
            crossing = np.setdiff1d(crossing_vertices(self.mesh, uv), held)
            if len(crossing) == 0:
                if len(held) and len(crossing_vertices(self.mesh, uv)):
                    return None
                self.held_steps += len(held) > 0
                return uv
            held = np.union1d(held, crossing)
        return None

    def _stepped(self, held: IntArray, steps: int) -> FloatArray:
        """(V, 2) the map after some steps of libigl's SLIM with some vertices held in place."""
        return stepper(self.domain, self.uv, "symmetric_dirichlet", held, HOLD)(steps)

    def report(self) -> dict[str, object]:
        """What stands beside the map."""
        return {
            "energy": ENERGY,
            "end_energy": self.energy,
            "start": self.start,
            "bijective": len(crossing_vertices(self.mesh, self.uv)) == 0,
            "held_steps": self.held_steps,
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
