"""As-rigid-as-possible parameterization: the local/global method."""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter
from typing import ClassVar

import igl
import numpy as np

from parapoint.planar.domains import (
    check_iterations,
    check_triangles,
    domain,
    finite,
    frames,
    is_kept,
    singular_values,
)
from parapoint.planar.tutte import tutte
from parapoint.surfaces.areas import signed_areas
from parapoint.surfaces.parameterization import Parameterization, TracePoint
from parapoint.surfaces.surface import Surface


@dataclass(frozen=True)
class ARAP:
    """As-rigid-as-possible map from Tutte's embedding: each triangle close to a rotation.

    L. Liu et al. 2008, "A local/global approach to mesh parameterization", as libigl solves it,
    with one vertex held. Nothing keeps triangles from flipping; the report counts those that did.
    The trace holds the energy: the area-weighted mean of (s1 - 1)^2 + (s2 - 1)^2, where s2 is
    negative for a flipped triangle.

    Attributes:
        iterations: local/global steps, at least 1.
    """

    iterations: int = 100

    requires: ClassVar[frozenset[str]] = frozenset({"faces", "disk_after_cut"})
    packages: ClassVar[tuple[str, ...]] = ("libigl",)

    def __post_init__(self) -> None:
        check_iterations(self.iterations)

    def parameterize(self, surface: Surface, *, seed: int) -> Parameterization:  # noqa: ARG002 (nothing is random)
        """The map, in the scale of the surface.

        Raises:
            UnsupportedError: the surface is no disk, with or without holes.
            InputError: a triangle has no area.
            FlatteningError: the system has no finite solution.
        """
        began = perf_counter()
        disk = domain(surface)
        check_triangles(disk.vertices, disk.faces)
        frame = frames(disk.vertices, disk.faces)
        weight = 1 / (2 * np.abs(np.linalg.det(frame)) * disk.area)
        uv = tutte(disk)
        held = disk.loop[:1]
        position = uv[held]
        solver = igl.ARAPData()
        igl.arap_precomputation(disk.vertices, disk.faces, 2, held.astype(np.int32), solver)
        trace = []
        done = 0
        for count in range(1, self.iterations + 1):
            if not is_kept(count, self.iterations):
                continue  # one call for all steps up to the next that is kept
            solver.max_iter, done = count - done, count
            uv = finite(igl.arap_solve(position, solver, uv))
            s1, s2 = singular_values(frame, uv, disk.faces)
            energy = float((weight * ((s1 - 1) ** 2 + (s2 - 1) ** 2)).sum())
            trace.append(TracePoint(count, perf_counter() - began, {"arap": energy}, uv))
        report: dict[str, object] = {
            "energy": "arap",
            "end_energy": trace[-1].values["arap"],
            "iterations": self.iterations,
            "flipped": int((signed_areas(uv, disk.faces) <= 0).sum()),
        }
        return Parameterization(uv, disk.faces, tuple(trace), report)
