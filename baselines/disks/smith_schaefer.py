"""Smith and Schaefer's parameterization: bijective, with a free boundary."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from baselines.disks.barrier_energy import Energy
from baselines.disks.quasi_newton import MEMORY, direction
from parapoint import clock
from parapoint.parameters import LONGEST_SECONDS, check_number
from parapoint.planar.crossing import crossing_vertices
from parapoint.planar.domains import (
    FlatteningError,
    check_iterations,
    check_triangles,
    domain,
    is_kept,
)
from parapoint.planar.tutte import tutte
from parapoint.surfaces.areas import signed_areas
from parapoint.surfaces.parameterization import Parameterization, TracePoint
from parapoint.surfaces.surface import FloatArray, Mesh, Surface

ARMIJO = 1e-4
"""Share of the fall that the slope promises which a step must bring."""
HALVINGS = 40
"""Times that a step is halved before the descent ends."""
REACH = 0.25
"""Distance at which the barrier begins, in mean boundary edges of Tutte's embedding."""
LEAST = 4.0
"""The energy of an isometry."""
PATIENCE, SETTLED = 100, 0.01
"""The map has settled where so many steps lower the energy's excess by less than this share."""
EXACT = 1e-6
"""Excess of the energy at which a map is an isometry."""


@dataclass(frozen=True)
class SmithSchaefer:
    """Isometric map whose triangles never flip and whose boundary never crosses itself.

    J. Smith and S. Schaefer 2015, "Bijective parameterization with free boundaries". From Tutte's
    embedding the symmetric Dirichlet energy is brought down by L-BFGS, together with a barrier
    max(0, e / distance - 1)² between boundary edges and boundary vertices; no step goes as far as
    the first flip or contact, which are roots of quadratics. One to one at every step.

    Ours is the weight of the barrier, a mean over boundary edges beside a mean over the area, and
    where it begins (REACH). The descent is slow where the embedding squeezes a limb: it knows
    nothing of the triangles' sizes, and a single one bounds the step of all. It ends where it has
    settled. Left out: other energies than the isometric one.

    Attributes:
        iterations: steps at most, at least 1.
        time_budget: seconds after which no step begins.
    """

    iterations: int = 5000
    time_budget: float | None = None

    requires: ClassVar[frozenset[str]] = frozenset({"faces", "disk_after_cut"})
    packages: ClassVar[tuple[str, ...]] = ("libigl", "shapely")

    def __post_init__(self) -> None:
        check_iterations(self.iterations)
        if self.time_budget is not None:
            check_number("time_budget", self.time_budget, 0, LONGEST_SECONDS, above=True)

    @property
    def deterministic(self) -> bool:
        """Whether the same surface gives the same map: not where time ends the descent."""
        return self.time_budget is None

    def parameterize(self, surface: Surface, *, seed: int) -> Parameterization:  # noqa: ARG002 (nothing is random)
        """The map, in the scale of the surface, with the energy of each step.

        Raises:
            UnsupportedError: the surface is no disk, with or without holes.
            InputError: a triangle has no area.
            FlatteningError: Tutte's embedding has flips.
        """
        began = clock.worked()
        disk = domain(surface)
        check_triangles(disk.vertices, disk.faces)
        unit = math.sqrt(disk.area)
        disk = disk._replace(vertices=disk.vertices / unit, area=1.0)
        uv = tutte(disk)
        if not (signed_areas(uv, disk.faces) > 0).all():
            raise FlatteningError("Tutte's embedding, the start, has flipped triangles")
        rim = np.linalg.norm(uv[disk.loop] - np.roll(uv[disk.loop], 1, axis=0), axis=1)
        energy = Energy(disk, REACH * float(rim.mean()))
        trace = []
        deadline = began + (self.time_budget or math.inf)
        for done, (moved, distortion) in enumerate(descent(energy, uv, self.iterations)):
            uv = moved
            kept = unit * uv if is_kept(done, self.iterations) else None
            seconds = clock.worked() - began
            trace.append(TracePoint(done, seconds, {"symmetric_dirichlet": distortion}, kept))
            if clock.worked() > deadline:
                break
        report: dict[str, object] = {
            "energy": "symmetric_dirichlet",
            "start_energy": trace[0].values["symmetric_dirichlet"],
            "end_energy": trace[-1].values["symmetric_dirichlet"],
            "iterations": len(trace) - 1,
            "bijective": len(crossing_vertices(Mesh(disk.vertices, disk.faces), uv)) == 0,
        }
        return Parameterization(unit * uv, disk.faces, tuple(trace), report)


def descent(energy: Energy, uv: FloatArray, iterations: int) -> Iterator[tuple[FloatArray, float]]:
    """The maps (V, 2) and their distortion from the start `uv` on, until the map has settled."""
    value, slope, distortion = energy.of(uv)
    yield uv, distortion
    pairs: deque[tuple[FloatArray, FloatArray]] = deque(maxlen=MEMORY)
    course = [value - LEAST]
    while len(course) <= iterations and course[-1] > EXACT:
        move = direction(slope, pairs)
        if not pairs:
            move = move / np.abs(move).max()
        promised = float((move * slope).sum())
        step = energy.largest_step(uv, move)
        for _ in range(HALVINGS):
            moved = uv + step * move
            value, ahead, distortion = energy.of(moved)
            if value - LEAST <= course[-1] + ARMIJO * step * promised:
                break
            step /= 2
        else:
            if not pairs:
                return
            pairs.clear()  # the remembered curvature misled: down the slope instead
            continue
        pair = moved - uv, ahead - slope
        if (pair[0] * pair[1]).sum() > 0:
            pairs.append(pair)
        uv, slope = moved, ahead
        course.append(value - LEAST)
        yield uv, distortion
        if len(course) > PATIENCE and course[-1] > (1 - SETTLED) * course[-1 - PATIENCE]:
            return
