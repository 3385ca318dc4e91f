"""Angle based flattening: the angles are the unknowns, and then the triangles are laid out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy import sparse

from baselines.disks.angle_system import angles, newton_step
from parapoint.planar.domains import (
    Domain,
    FlatteningError,
    check_iterations,
    check_triangles,
    closed_holes,
    domain,
    far_pair,
    scaled,
)
from parapoint.planar.embedding import factored
from parapoint.surfaces.areas import signed_areas
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import FloatArray, IntArray, Surface

CLOSED = 1e-9
"""Largest error of a constraint, in radians or logarithms of lengths, at which the angles close."""
INWARDS = 0.9
"""Share of the way to the first angle of 0 or pi that a step may take at most."""
REFINEMENTS = 2
"""Corrections of the layout by its own residual."""


@dataclass(frozen=True)
class ABF:
    """Angle based flattening: the angles nearest to those in space that a flat mesh can have.

    A. Sheffer, B. Levy, M. Mogilnitsky and A. Bogomyakov 2005, "ABF++: fast and robust angle based
    flattening". The angles a minimise sum ((a - b) / b)², where b are those in space, scaled to sum
    up to 2 pi around an inner vertex. Constraints: a triangle's sum up to pi, those around an inner
    vertex to 2 pi, and its wheel of triangles closes, prod sin(next) = prod sin(previous). Newton
    steps leave out the constraints' curvature; the triangles' multipliers are eliminated in closed
    form, so that two unknowns an inner vertex are left (the ABF++ reduction). Vertices are then
    found by least squares (the paper's LSCM-like reconstruction), all at once.

    Ours: the wheel's constraint in logarithms; a step that would leave (0, pi) is cut short, where
    the paper changes weights; holes are closed by fans, whose angles are unknowns too. Left out:
    the hierarchical solver. Angles are all that counts, so that areas may shrink without bound, and
    a free boundary may cross itself.

    Attributes:
        iterations: Newton steps at most, at least 1.
    """

    iterations: int = 30

    requires: ClassVar[frozenset[str]] = frozenset({"faces", "disk_after_cut"})
    packages: ClassVar[tuple[str, ...]] = ("libigl", "scipy")

    def __post_init__(self) -> None:
        check_iterations(self.iterations)

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
        problem = angles(vertices, faces)
        angle, wrong = problem.target, np.inf
        steps = 0
        while steps < self.iterations:
            move, wrong = newton_step(problem, angle)
            if wrong < CLOSED:
                break
            steps += 1
            room = np.where(move < 0, angle, np.pi - angle)
            fraction = min(1.0, INWARDS / float((np.abs(move) / room).max()))
            angle = angle + fraction * move
        uv = laid_out(disk, faces, angle)[: len(disk.vertices)]
        report: dict[str, object] = {
            "steps": steps,
            "largest_error": wrong,
            "flipped": int((signed_areas(uv, disk.faces) <= 0).sum()),
        }
        return Parameterization(scaled(disk, uv), disk.faces, report=report)


def laid_out(disk: Domain, faces: IntArray, angle: FloatArray) -> FloatArray:
    """(V, 2) vertices whose triangles have these angles, or nearly so, in the least squares.

    Corners 1, 2, 3 of a triangle: p3 - p1 = sin(a2) / sin(a3) e^(i a1) (p2 - p1).
    """
    a1, a2, a3 = angle.reshape(-1, 3).T
    ratio = np.sin(a2) / np.sin(a3) * np.exp(1j * a1)
    row = np.arange(len(faces))
    size = int(faces.max()) + 1
    values = np.concatenate([ratio - 1, -ratio, np.ones(len(faces))])
    matrix = sparse.coo_array((values, (np.tile(row, 3), faces.T.reshape(-1))), (len(faces), size))
    pinned = disk.loop[list(far_pair(disk.vertices[disk.loop]))]
    free = np.setdiff1d(np.arange(size), pinned)
    matrix = matrix.tocsc()
    held = -matrix[:, pinned] @ np.array([0, 1])
    kept = matrix[:, free]
    adjoint = kept.conj().T.tocsr()
    solver = factored((adjoint @ kept).tocsc())
    place = np.zeros(len(free), dtype=np.complex128)
    for _ in range(1 + REFINEMENTS):
        place = place + solver.solve(adjoint @ (held - kept @ place))
    points = np.zeros(size, dtype=np.complex128)
    points[free], points[pinned] = place, [0, 1]
    if not np.isfinite(points).all():
        raise FlatteningError("the layout of the angles has no finite solution")
    return np.stack([points.real, points.imag], axis=1)
