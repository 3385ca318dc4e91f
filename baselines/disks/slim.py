"""Scalable locally injective mappings."""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter
from typing import ClassVar, Literal

import numpy as np

from parapoint.errors import InputError
from parapoint.planar.domains import (
    Domain,
    FlatteningError,
    check_iterations,
    check_triangles,
    domain,
    frames,
    is_kept,
    singular_values,
)
from parapoint.planar.energies import DENSITIES, stepper
from parapoint.planar.tutte import tutte
from parapoint.surfaces.areas import signed_areas
from parapoint.surfaces.parameterization import Parameterization, TracePoint
from parapoint.surfaces.surface import FloatArray, IntArray, Surface

NUDGE = 1e-5
"""How far corners move for a difference quotient of the energy, in typical edges."""
HALVINGS = 40
"""Steps down the slope that are tried: the extent of the map, halved up to this many times."""
ROUNDING = 1e-9
"""Relative fall of an energy that counts as none."""


@dataclass(frozen=True)
class SLIM:
    """SLIM from Tutte's embedding: no triangle ever flips.

    M. Rabinovich et al. 2017, "Scalable locally injective mappings", as libigl solves it; the
    longest boundary loop is free after the start. libigl gives a start with flips back unchanged
    and says nothing, so the start is checked before and the fall of the energy after.

    libigl weighs `exp_conformal` by the gradient of the symmetric Dirichlet energy, so that its
    maps are nearer to isometric than the name says.

    Attributes:
        energy: what is minimised; its value is in the trace at each step.
        iterations: steps, at least 1.
    """

    energy: Literal["symmetric_dirichlet", "conformal", "log_arap", "exp_conformal"] = (
        "symmetric_dirichlet"
    )
    iterations: int = 20

    requires: ClassVar[frozenset[str]] = frozenset({"faces", "disk_after_cut"})
    packages: ClassVar[tuple[str, ...]] = ("libigl",)

    def __post_init__(self) -> None:
        check_iterations(self.iterations)
        if self.energy not in DENSITIES:
            raise InputError(f"energy must be one of {', '.join(DENSITIES)}, not {self.energy!r}")

    def parameterize(self, surface: Surface, *, seed: int) -> Parameterization:  # noqa: ARG002 (nothing is random)
        """The map, in the scale of the surface, with the energy of each step.

        Raises:
            UnsupportedError: the surface is no disk, with or without holes.
            InputError: a triangle has no area.
            FlatteningError: the start has flipped triangles, or the energy did not fall.
        """
        began = perf_counter()
        disk = domain(surface)
        check_triangles(disk.vertices, disk.faces)
        start = tutte(disk)
        folded = int((signed_areas(start, disk.faces) <= 0).sum())
        if folded:
            raise FlatteningError(
                f"SLIM needs a start without flips; Tutte's embedding has {folded} flipped or "
                f"degenerate triangles of {len(disk.faces)}"
            )
        return self.improved(disk, start, began)

    def improved(self, disk: Domain, start: FloatArray, began: float) -> Parameterization:
        """The map after all steps from a flip-free `start` (V, 2) in the scale of the surface.

        Args:
            disk: the surface.
            start: (V, 2), each triangle with positive area.
            began: `perf_counter()` when the method began.

        Raises:
            FlatteningError: the energy did not fall.
        """
        frame = frames(disk.vertices, disk.faces)
        weight = 1 / (2 * np.abs(np.linalg.det(frame)) * disk.area)

        def energy(uv: FloatArray) -> float:
            return map_energy(self.energy, weight, *singular_values(frame, uv, disk.faces))

        stepped = stepper(disk, start, self.energy)
        uv = start
        trace = [TracePoint(0, perf_counter() - began, {self.energy: energy(start)}, start)]
        for step in range(1, self.iterations + 1):
            uv = stepped(1)
            kept = uv if is_kept(step, self.iterations) else None
            seconds = perf_counter() - began
            trace.append(TracePoint(step, seconds, {self.energy: energy(uv)}, kept))
        first, last = trace[0].values[self.energy], trace[-1].values[self.energy]
        # A start that is the minimum cannot fall (a regular polygon, flat or drawn up to a cone).
        if not (last < first or is_minimum(self.energy, weight, frame, start, disk.faces)):
            raise FlatteningError(
                f"SLIM's {self.energy} energy did not fall in {self.iterations} iterations: "
                f"{first:.6g} at the start, {last:.6g} at the end"
            )
        report: dict[str, object] = {
            "energy": self.energy,
            "start": "tutte",
            "start_energy": first,
            "end_energy": last,
            "iterations": self.iterations,
        }
        return Parameterization(uv, disk.faces, tuple(trace), report)


def is_minimum(
    name: str, weight: FloatArray, frame: FloatArray, uv: FloatArray, faces: IntArray
) -> bool:
    """Whether no step down its slope lowers the energy of a map by more than rounding does.

    Args:
        name: key of DENSITIES.
        weight: (F,) share of each triangle in the 3D area.
        frame: (F, 2, 2) the triangles in 3D, as `parapoint.planar.domains.frames` gives them.
        uv: (V, 2) the map.
        faces: (F, 3) rows of `uv`.
    """
    here = map_energy(name, weight, *singular_values(frame, uv, faces))
    if not np.isfinite(here):
        return False
    corners = uv[faces]
    apart = np.arange(faces.size).reshape(-1, 3)

    def densities(moved: FloatArray) -> FloatArray:
        return DENSITIES[name][0](*singular_values(frame, moved.reshape(-1, 2), apart))

    share = weight
    if name == "exp_conformal":
        density = densities(corners)
        share = weight * np.exp(density - density.max())
    nudge = NUDGE * float(np.ptp(uv, axis=0).max()) / len(faces) ** 0.5
    slope = np.zeros_like(uv)
    for corner, axis in np.ndindex(3, 2):
        shift = np.zeros((3, 2))
        shift[corner, axis] = nudge
        rise = share * (densities(corners + shift) - densities(corners - shift)) / (2 * nudge)
        slope[:, axis] += np.bincount(faces[:, corner], rise, len(uv))
    steepest = float(np.linalg.norm(slope, axis=1).max())
    if steepest == 0:
        return True
    down = -slope / steepest * float(np.ptp(uv, axis=0).max())
    there = [
        map_energy(name, weight, *singular_values(frame, uv + 2.0**-halving * down, faces))
        for halving in range(HALVINGS)
    ]
    return min(there) > here - ROUNDING * max(1.0, here)


def map_energy(name: str, weight: FloatArray, s1: FloatArray, s2: FloatArray) -> float:
    """Energy of a map: the mean of the triangles' energies, infinite where one is flipped.

    Args:
        name: key of DENSITIES.
        weight: (F,) share of each triangle in the 3D area.
        s1: (F,) larger singular values.
        s2: (F,) smaller singular values, negative where a triangle is flipped.
    """
    if not (s2 > 0).all():
        return float("inf")
    density = DENSITIES[name][0](s1, s2)
    if name == "exp_conformal":
        largest = float(density.max())
        return largest + float(np.log((weight * np.exp(density - largest)).sum()))
    return float((weight * density).sum())
