"""Least-squares conformal maps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import igl
import numpy as np

from parapoint.planar.domains import check_triangles, domain, far_pair, scaled
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import Surface


@dataclass(frozen=True)
class LSCM:
    """Least-squares conformal map with two far vertices of the longest boundary loop pinned.

    B. Levy et al. 2002, "Least squares conformal maps for automatic texture atlas generation", as
    libigl solves it.
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
        pins = disk.loop[list(far_pair(disk.vertices[disk.loop]))]
        uv, _ = igl.lscm(disk.vertices, disk.faces, pins, np.array([[0.0, 0.0], [1.0, 0.0]]))
        return Parameterization(scaled(disk, uv), disk.faces)
