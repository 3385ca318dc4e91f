"""Discrete harmonic map: the longest boundary on a circle, cotangent weights inside."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import igl

from parapoint.planar.domains import check_triangles, circle, domain, scaled
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import Surface


@dataclass(frozen=True)
class Harmonic:
    """Harmonic map (cotangent weights); the longest boundary loop on a circle, other loops free.

    U. Pinkall and K. Polthier 1993; M. Eck et al. 1995, "Multiresolution analysis of arbitrary
    meshes". Negative cotangents can flip triangles; the metrics count them.
    """

    requires: ClassVar[frozenset[str]] = frozenset({"faces", "disk_after_cut"})
    packages: ClassVar[tuple[str, ...]] = ("libigl",)

    def parameterize(self, surface: Surface, *, seed: int) -> Parameterization:  # noqa: ARG002 (nothing is random)
        """The map, scaled to the 3D area.

        Raises:
            UnsupportedError: the surface is no disk, with or without holes.
            InputError: a triangle has no area.
            FlatteningError: the system has no finite solution.
        """
        disk = domain(surface)
        check_triangles(disk.vertices, disk.faces)
        boundary = circle(disk.vertices[disk.loop])
        uv = igl.harmonic(disk.vertices, disk.faces, disk.loop, boundary, 1)
        return Parameterization(scaled(disk, uv), disk.faces)
