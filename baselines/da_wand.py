"""A part of a surface around a seed triangle that flattens well, in the manner of DA-Wand."""

from __future__ import annotations

import heapq
from collections.abc import Iterable
from dataclasses import dataclass
from typing import ClassVar

import igl
import numpy as np

from parapoint.errors import InputError
from parapoint.method import UnsupportedError
from parapoint.parameters import check_number, check_whole
from parapoint.planar.domains import Domain, domain, far_pair, frames, scaled, singular_values
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import FloatArray, IntArray, Mesh, Surface, flat_faces

GROWTH = 0.3
"""Share by which a region may grow before its map is solved anew."""
LEAST = 0.02
"""Share of a region that is given up together once it distorts the map too much."""
FIRST = 12
"""Triangles of the first region, whose map is taken as it is."""
STEPS = 10
"""Local/global steps of each map."""
PASSES = 4
"""Times that the border is smoothed."""


@dataclass(frozen=True)
class DAWand:
    """A large disk around a seed triangle that flattens within a bound, and its isometric map.

    R. Liu, N. Aigerman, V. G. Kim and R. Hanocka 2023, "DA Wand: distortion-aware selection using
    neural mesh parameterization". Its network, which selects the triangles, is not here. A greedy
    growth stands in for it: from the seed on the nearest triangles are added, the map of the region
    is solved anew (least-squares conformal, then as rigid as possible), and those with which its
    mean distortion (s1 - 1)² + (s2 - 1)² exceeds the bound are given up. The region is a disk
    throughout. Like the paper's flood fill and graph cut, a majority of the neighbours then smooths
    its border. All other faces have no uv; the map is the whole of the work, not an atlas.

    Attributes:
        triangle: face from which the region grows.
        distortion: largest mean distortion of the region.
    """

    triangle: int = 0
    distortion: float = 0.01

    requires: ClassVar[frozenset[str]] = frozenset({"faces"})
    packages: ClassVar[tuple[str, ...]] = ("libigl",)

    def __post_init__(self) -> None:
        check_whole("triangle", self.triangle, 0)
        check_number("distortion", self.distortion, 0, above=True)

    def parameterize(self, surface: Surface, *, seed: int) -> Parameterization:  # noqa: ARG002 (nothing is random)
        """The map of the region, in the scale of the surface; the rest is left out.

        Raises:
            UnsupportedError: the surface is a cloud.
            InputError: there is no such triangle, or it has no area.
            FlatteningError: the map of a region is not finite.
        """
        if not isinstance(surface, Mesh):
            raise UnsupportedError("needs faces; the surface is a point cloud")
        if self.triangle >= len(surface.faces):
            last = len(surface.faces) - 1
            raise InputError(f"triangle must be a face, 0 to {last}, not {self.triangle}")
        region = Region(surface, self.triangle)
        solves = grown(region, self.distortion)
        before = region.faces()
        smoothed = Region(surface, self.triangle, before)
        smoothed.smooth()
        if distortion(surface, smoothed.faces()) <= self.distortion:
            region = smoothed
        faces = region.faces()
        uv, each = flattened(surface, faces)
        share = surface.face_areas[faces]
        report: dict[str, object] = {
            "faces": len(faces),
            "share": float(share.sum() / surface.face_areas.sum()),
            "distortion": float(each @ share / share.sum()),
            "solves": solves,
        }
        size = len(surface.vertices)
        corners = surface.faces + size  # a row for each vertex outside, and one inside
        corners[faces] -= size
        rows, corners = np.unique(corners, return_inverse=True)
        both = np.concatenate([uv, np.full((size, 2), np.nan)])
        return Parameterization(both[rows], corners.reshape(-1, 3), report=report)


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

    def is_ear(self, face: int) -> bool:
        """Whether a face can be left out, two of its neighbours are outside, one is not."""
        if not self.inside[face] or face == self.seed:
            return False
        shared = self.shared(face)
        if sum(shared) != 1 or (self.beside[face] < 0).any():
            return False
        return bool(self.uses[self.corners[face][(shared.index(True) + 2) % 3]] == 1)

    def smooth(self) -> None:
        """Take in faces with two neighbours inside, leave out those with two outside."""
        for _ in range(PASSES):
            near = np.unique(self.beside[self.inside])
            for face in near[near >= 0].tolist():
                if self.fits(face) and sum(self.shared(face)) == 2:
                    self.add(face)
            for face in self.faces().tolist():
                if self.is_ear(face):
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


def grown(region: Region, bound: float) -> int:
    """Let a region grow until nothing more can be added within the bound; how many maps it took.

    The nearest faces come first, by paths from centre to centre; a batch that exceeds the bound is
    halved, and the smallest is given up.
    """
    mesh = region.mesh
    centres: FloatArray = mesh.vertices[mesh.faces].mean(axis=1)
    distance = {region.seed: 0.0}
    heap: list[tuple[float, int]] = []

    def reach(face: int) -> None:
        for other in region.beside[face].tolist():
            if other >= 0 and not region.inside[other]:
                far = distance[face] + float(np.linalg.norm(centres[other] - centres[face]))
                if far < distance.get(other, np.inf):
                    distance[other] = far
                heapq.heappush(heap, (distance[other], other))

    def taken(count: int) -> list[int]:
        added: list[int] = []
        while heap and len(added) < count:
            _, face = heapq.heappop(heap)
            if region.fits(face):
                region.add(face)
                added.append(face)
                reach(face)
        return added

    reach(region.seed)
    taken(FIRST)
    solves, size = 0, FIRST
    while added := taken(size):
        solves += 1
        count = int(region.inside.sum())
        if distortion(mesh, region.faces()) <= bound:
            size = max(1, min(2 * len(added), int(GROWTH * count)))
            continue
        for face in added:
            region.drop(face)
        if len(added) <= max(1, LEAST * count):
            region.blocked[added] = True
        else:
            size = len(added) // 2
        heap.clear()
        for face in region.faces().tolist():
            reach(face)
    return solves


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
    s1, s2 = singular_values(frames(disk), rows, disk.faces)
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
