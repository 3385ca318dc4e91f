"""Boundary First Flattening with a free boundary."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import igl
import numpy as np

from parapoint.planar.domains import (
    arc_lengths,
    check_triangles,
    closed_holes,
    domain,
    finite,
    scaled,
)
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import FloatArray, Surface


@dataclass(frozen=True)
class BFF:
    """Boundary First Flattening: conformal, with no change of scale along the boundary.

    R. Sawhney and K. Crane 2017, "Boundary First Flattening". Scale factors of zero on the boundary
    give the least area distortion of all conformal maps. Loops other than the longest are closed
    by a fan of triangles for the solve. Equations (numbers of the paper's sections):

    - Yamabe problem (4.1): the log scale factors u solve A u = -K inside with u = 0 on the
      boundary, A the cotangent Laplacian and K the angle defects; the flow of u across the boundary
      gives the curvature of the flat boundary, k - h.
    - Best-fit curve (4.3): edge lengths closest to the given ones that close the curve.
    - Extension (4.4): the first coordinate is harmonic, the second its harmonic conjugate.
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
        vertices, faces = closed_holes(disk)
        loop = disk.loop
        laplacian = -igl.cotmatrix(vertices, faces)
        zeros = np.zeros((len(vertices), 1))

        inner = igl.min_quad_with_fixed_data()
        igl.min_quad_with_fixed_precompute(laplacian, loop, pd=True, data=inner)

        # Angle defects: 2 pi less the angles inside, pi less the angles on the boundary.
        defect = igl.gaussian_curvature(vertices, faces)
        defect[loop] -= np.pi
        scale = igl.min_quad_with_fixed_solve(inner, defect[:, None], zeros[loop])
        turning = defect[loop] + (laplacian @ finite(scale))[loop, 0]

        boundary = closed_curve(arc_lengths(vertices[loop]), turning)
        u = igl.min_quad_with_fixed_solve(inner, zeros, boundary[:, :1])
        # Cauchy-Riemann: the conjugate's flow across the boundary is u's change along it.
        flow = zeros.copy()
        flow[loop, 0] = (np.roll(u[loop, 0], -1) - np.roll(u[loop, 0], 1)) / 2
        v = igl.min_quad_with_fixed(laplacian, flow, loop[:1], zeros[:1])
        uv = np.concatenate([finite(u), finite(v)], axis=1)[: len(disk.vertices)]
        return Parameterization(scaled(disk, uv), disk.faces)


def closed_curve(lengths: FloatArray, turning: FloatArray) -> FloatArray:
    """(B, 2) a closed curve with these exterior angles and nearly these edge lengths.

    Its longest principal axis lies along u, so that the map does not depend on where it begins.

    Args:
        lengths: (B,) length of the edge after each vertex.
        turning: (B,) exterior angle at each vertex; they sum to 2 pi.
    """
    angle = np.cumsum(turning)
    tangents = np.stack([np.cos(angle), np.sin(angle)])
    # Least change of length, weighted by 1 / length, that closes the curve.
    weighted = tangents * lengths
    fitted = lengths - weighted.T @ np.linalg.solve(weighted @ tangents.T, tangents @ lengths)
    steps = (tangents * fitted).T
    points = np.cumsum(steps, axis=0) - steps
    a, b = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2][0]
    return np.asarray(points @ [[a, -b], [b, a]], dtype=np.float64)
