"""Tutte's embedding: the longest boundary on a circle, each inner vertex amid its neighbours."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from parapoint.planar.domains import domain
from parapoint.planar.tutte import tutte
from parapoint.surfaces.areas import signed_areas
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import Surface


@dataclass(frozen=True)
class Tutte:
    """Tutte's embedding with uniform weights; the longest boundary loop on a circle.

    W. T. Tutte 1963, "How to draw a graph". The loop is spaced by arc length; other loops are free.
    A vertex of another loop with two neighbours only then lands between them and its triangle has
    no area: where that happens, the loops are closed by fans for the solve. The report counts what
    flipped none the less, which takes triangles below the precision of a number.
    """

    requires: ClassVar[frozenset[str]] = frozenset({"faces", "disk_after_cut"})
    packages: ClassVar[tuple[str, ...]] = ("libigl",)

    def parameterize(self, surface: Surface, *, seed: int) -> Parameterization:  # noqa: ARG002 (nothing is random)
        """The embedding, scaled to the 3D area.

        Raises:
            UnsupportedError: the surface is no disk, with or without holes.
            FlatteningError: the system has no finite solution.
        """
        disk = domain(surface)
        uv = tutte(disk)
        areas = signed_areas(uv, disk.faces)
        flips = {"flipped": int((areas < 0).sum()), "degenerate": int((areas == 0).sum())}
        return Parameterization(uv, disk.faces, report=flips)
