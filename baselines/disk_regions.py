"""A part of a mesh that stays a disk while faces come and go, and its isometric map."""

from __future__ import annotations

from collections.abc import Iterable

import igl
import numpy as np

from parapoint.errors import InputError
from parapoint.planar.domains import Domain, domain, far_pair, frames, scaled, singular_values
from parapoint.surfaces.surface import FloatArray, IntArray, Mesh, flat_faces

PASSES = 12
"""Times that the border is smoothed."""
MAJORITY = 0.5
"""Share of the faces around a face that decides whether it is inside."""
STEPS = 10
"""Local/global steps of each map."""


class Region:
    """A set of faces that is a disk: faces are added and taken away where it stays one.

    Args:
        mesh: any mesh; faces without area stay outside.
        seed: a face of the region that never leaves it.
        faces: rows of the region; the seed alone by default.

    Raises:
        InputError: the seed has no area.
    """

    def __init__(self, mesh: Mesh, seed: int, faces: Iterable[int] = ()) -> None:
        self.mesh, self.seed = mesh, seed
        self.corners: list[list[int]] = mesh.faces.tolist()
        self.beside = neighbours(mesh)
        self.blocked = flat_faces(mesh.vertices, mesh.faces)
        if self.blocked[seed]:
            raise InputError(f"triangle {seed} has no area: take another one as the seed")
        self.inside = np.zeros(len(mesh.faces), dtype=bool)
        self.uses = np.zeros(len(mesh.vertices), dtype=np.int64)
        self.valence = np.bincount(mesh.faces.reshape(-1), minlength=len(mesh.vertices))
        self.rim = np.zeros(len(mesh.vertices), dtype=bool)
        self.rim[mesh.halfedges[self.beside.reshape(-1) < 0]] = True
        self.add(seed)
        for face in faces:
            if face != seed:
                self.add(face)

    def faces(self) -> IntArray:
        """The rows of its faces."""
        return np.flatnonzero(self.inside)

    def add(self, face: int) -> None:
        """Take a face in."""
        self.inside[face] = True
        self.uses[self.corners[face]] += 1

    def drop(self, face: int) -> None:
        """Leave a face out."""
        self.inside[face] = False
        self.uses[self.corners[face]] -= 1

    def shared(self, face: int) -> list[bool]:
        """For each edge of a face, from corner k to k + 1, whether the region lies across it."""
        return [other >= 0 and bool(self.inside[other]) for other in self.beside[face]]

    def fits(self, face: int) -> bool:
        """Whether the region with a face is a disk: it meets it along one piece of the border."""
        if self.inside[face] or self.blocked[face]:
            return False
        shared = self.shared(face)
        if sum(shared) == 1:
            opposite = self.corners[face][(shared.index(True) + 2) % 3]
            return bool(self.uses[opposite] == 0)
        return sum(shared) == 2

    def may_leave(self, face: int) -> bool:
        """Whether the region without a face is a disk: it bares at most one vertex."""
        if not self.inside[face] or face == self.seed:
            return False
        shared = self.shared(face)
        if sum(shared) != 2:
            return sum(shared) == 1
        apex = self.corners[face][(shared.index(False) + 2) % 3]
        return bool(self.uses[apex] == self.valence[apex] and not self.rim[apex])

    def smooth(self) -> None:
        """Let the faces around decide: take in where most are inside, leave out where few are."""
        for _ in range(PASSES):
            around = self.uses / np.maximum(self.valence, 1)
            votes = around[self.mesh.faces].mean(axis=1)
            for face in np.flatnonzero(~self.inside & (votes > MAJORITY)).tolist():
                if self.fits(face):
                    self.add(face)
            for face in np.flatnonzero(self.inside & (votes < MAJORITY)).tolist():
                if self.may_leave(face):
                    self.drop(face)


def neighbours(mesh: Mesh) -> IntArray:
    """(F, 3) the face across each edge, from corner k to k + 1; -1 where there is not just one.

    A neighbour that turns the other way counts as none.
    """
    order = np.argsort(mesh.edge_of_halfedge, kind="stable")
    count = mesh.edge_face_count
    first = (np.cumsum(count) - count)[count == 2]
    one, other = order[first], order[first + 1]
    turned = mesh.halfedges[one, 0] == mesh.halfedges[other, 1]
    beside = np.full(3 * len(mesh.faces), -1)
    beside[one[turned]] = other[turned] // 3
    beside[other[turned]] = one[turned] // 3
    return beside.reshape(-1, 3)


def distortion(mesh: Mesh, faces: IntArray) -> float:
    """The mean distortion of the map of a region over its area."""
    return float(np.average(flattened(mesh, faces)[1], weights=mesh.face_areas[faces]))


def flattened(mesh: Mesh, faces: IntArray) -> tuple[FloatArray, FloatArray]:
    """(V, 2) the map of a disk of some faces, 0 elsewhere; (n,) the distortion of each.

    Raises:
        FlatteningError: the map is not finite.
    """
    used, corners = np.unique(mesh.faces[faces], return_inverse=True)
    disk = domain(Mesh(mesh.vertices[used], corners.reshape(-1, 3)))
    rows = rigid(disk)
    s1, s2 = singular_values(frames(disk.vertices, disk.faces), rows, disk.faces)
    uv = np.zeros((len(mesh.vertices), 2))
    uv[used] = rows
    return uv, (s1 - 1) ** 2 + (s2 - 1) ** 2


def rigid(disk: Domain) -> FloatArray:
    """(V, 2) the as-rigid-as-possible map that begins with the least-squares conformal one."""
    pins = disk.loop[list(far_pair(disk.vertices[disk.loop]))]
    uv, _ = igl.lscm(disk.vertices, disk.faces, pins, np.array([[0.0, 0.0], [1.0, 0.0]]))
    uv = scaled(disk, uv)
    held = disk.loop[:1]
    solver = igl.ARAPData()
    igl.arap_precomputation(disk.vertices, disk.faces, 2, held.astype(np.int32), solver)
    solver.max_iter = STEPS
    return np.asarray(igl.arap_solve(uv[held], solver, uv), dtype=np.float64)
