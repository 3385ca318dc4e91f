"""An oriented triangulation of a bare cloud, grown over its Delaunay triangles.

After Cohen-Steiner and Da 2004 ("A greedy Delaunay-based surface reconstruction algorithm"): of the
triangles of the 3D Delaunay complex those with small empty balls are candidates, and a front takes
them one by one, the smoothest and smallest first. It only closes up on itself once nothing else is
left to take, which keeps noise from growing handles.

What is small is said in spacings, the distance to the nearest points.

Where two sheets are nearer to each other than their points are, no front tells them apart. One more
front therefore takes only the triangles between inside and outside (`parapoint.computed.delaunay`),
as they face. Open sheets have no inside.

Where sheets cross, no such front goes straight through: it turns from one sheet to the other. The
last front therefore takes the triangles that face as the normals of the points' own sheets do,
those along one of two sheets that cross among them (`parapoint.computed.sheets`). It is kept where
it is smoother than the best of the others by more than chance.
"""

from __future__ import annotations

import heapq
import math

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph
from scipy.spatial import QhullError, cKDTree

from parapoint.computed.delaunay import delaunay_complex, empty_radii, insideness
from parapoint.computed.sheets import sheet_normals, sheet_triangles
from parapoint.surfaces.scan_lines import NEAREST, Lines
from parapoint.surfaces.surface import (
    BoolArray,
    FloatArray,
    IntArray,
    Mesh,
    edge_table,
    twin_halfedges,
    unit_normals,
)

Vector = tuple[float, float, float]

LOOSEST = 2.5
"""Largest empty ball of a candidate triangle, in spacings."""
LEAP = 1.5
"""Longest edge between two points of one scan line, in distances to the next line."""
PASSES = -0.5
"""An edge passes by a point from which the cosine between its ends is less."""
BESIDE = 12
"""The nearest points among which such are sought."""
BEND_COSTS = (15.0, 2.0)
"""A front takes triangles by size times (1 + cost (1 − cosine of the bend)); each is tried."""
SHARPEST = -0.8
"""Least cosine between the normals of neighbouring triangles."""
GLUE = 0.3
"""Least cosine between a triangle's normal and that of a vertex where the front meets itself."""
TIGHTEST = 1.2
"""Triangles with a larger empty ball have no say in the normals; its radius, in spacings."""
AGAINST = -0.3
"""Least cosine between a triangle along the sheets and any of the three normals at its corners."""
DISAGREEMENT = 2.0
"""Such a triangle counts as larger by this many times 1 − its mean cosine with them."""
THINNEST = 1e-7
"""Least height of a triangle over its longest edge."""
QUARTER = math.pi / 2
SHARP = math.pi / 3
"""Least bend, in radians, that counts as a turn from one sheet to another that crosses it."""
SMOOTHER = 0.97
"""Most of its roughness that the front along sheets leaves where it is taken; without sheets that
cross it leaves 0.98 or more. It is not tried where turns from sheet to sheet are fewer."""
LONGEST_HOLE = 12
"""Edges of the largest hole that is filled."""
LONGEST_HOLE_IN_LINES = 6
"""The same in thinned scan lines, whose outermost ring may have few points."""
HANDLE = 30
"""Where fronts are compared, a handle counts as this many boundary edges, folds or spare points."""


class ReconstructionError(RuntimeError):
    """The cloud shows no surface that can be followed; the message says why."""


def triangulation(points: FloatArray, lines: Lines | None = None) -> Mesh:
    """The largest component of a manifold, oriented triangulation of distinct points (N, 3).

    The vertices are the points, in order; those in no face are not on the component.

    Args:
        points: the cloud.
        lines: the thinned scan lines that they are on, if they are.

    Raises:
        ReconstructionError: there are no candidate triangles.
    """
    spacing: FloatArray = cKDTree(points).query(points, NEAREST + 1)[0][:, 1:].mean(axis=1)
    try:
        delaunay = delaunay_complex(points, spacing)
    except QhullError as error:
        raise ReconstructionError(f"Qhull: {str(error).splitlines()[0]}") from None
    triangles, radius = delaunay.triangles, empty_radii(delaunay)
    near = (radius < LOOSEST * spacing[triangles].max(axis=1)) & _has_area(points, triangles)
    if lines is not None:
        near &= ~_leaps(points, triangles, lines)
    if not near.any():
        raise ReconstructionError("no two neighbouring points span a triangle with a third")
    front, back = (insideness(delaunay) > 0)[delaunay.sides].T
    between = near & (front != back)
    outward = np.where(front[:, None], triangles[:, ::-1], triangles)
    longest = LONGEST_HOLE if lines is None else LONGEST_HOLE_IN_LINES
    fronts = [_Front(points, triangles[near], radius[near], cost) for cost in BEND_COSTS]
    if between.any():
        args = points, outward[between], radius[between], BEND_COSTS[-1]
        fronts.append(_Front(*args, is_oriented=True))
    best = min((_largest_part(points, front.grown(), longest) for front in fronts), key=defects)
    tight = near & (radius < TIGHTEST * spacing[triangles].max(axis=1))
    bends = _bends(best)
    turns = bends[bends > SHARP].sum() / QUARTER
    if not tight.any() or turns < (1 - SMOOTHER) * roughness(best):
        return best
    normals = sheet_normals(points, triangles[tight], radius[tight], best)
    along = _along_sheets(points, normals, triangles[near], radius[near])
    front_across = _Front(points, *along, BEND_COSTS[0], is_oriented=True)
    across = _largest_part(points, front_across.grown(), longest)
    return across if roughness(across) < SMOOTHER * roughness(best) else best


def _leaps(points: FloatArray, triangles: IntArray, lines: Lines) -> BoolArray:
    """(T,) whether triangles (T, 3) reach across a ring of a scan, or from end to end of an arc.

    An edge between two points of one line is too long, or passes by a third point of that line.
    """
    edges, edge, _ = edge_table(triangles)
    (a, b), (line, gap) = edges.T, (lines.line, lines.gap)
    length = np.linalg.norm(points[a] - points[b], axis=1)
    is_along = (line[a] == line[b]) & (gap[a] > 0)
    leaps = length > LEAP * np.maximum(gap[a], gap[b])
    near = cKDTree(points).query(points, min(BESIDE, len(points)))[1][:, 1:]
    for c in near[a].T:
        there, back = points[a] - points[c], points[b] - points[c]
        far = np.linalg.norm(there, axis=1) * np.linalg.norm(back, axis=1)
        leaps |= (line[c] == line[a]) & (c != b) & ((there * back).sum(axis=1) < PASSES * far)
    return np.asarray((leaps & is_along)[edge].reshape(-1, 3).any(axis=1))


def _has_area(points: FloatArray, triangles: IntArray) -> BoolArray:
    """(T,) whether the corners of triangles (T, 3) are off a line, up to rounding."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    longest = np.max([((p - q) ** 2).sum(axis=1) for p, q in ((a, b), (b, c), (c, a))], axis=0)
    return np.asarray(np.linalg.norm(np.cross(b - a, c - a), axis=1) > THINNEST * longest)


def _along_sheets(
    points: FloatArray, normals: FloatArray, triangles: IntArray, radius: FloatArray
) -> tuple[IntArray, FloatArray]:
    """Triangles (T, 3) that face as the normals do, and sizes (T,) by which a front takes them.

    Of the given ones (G, 3) with their radii (G,), and of those along the sheets.
    """
    more, more_radius = sheet_triangles(points, normals)
    triangles, row = np.unique(np.concatenate([triangles, more]), axis=0, return_index=True)
    radius = np.concatenate([radius, more_radius])[row]
    facing = unit_normals(points, triangles)
    cosine = (facing[:, None] * normals[triangles]).sum(axis=2)
    is_against = cosine.sum(axis=1, keepdims=True) < 0
    cosine = np.where(is_against, -cosine, cosine)
    triangles = np.where(is_against, triangles[:, ::-1], triangles)
    kept = cosine.min(axis=1) > AGAINST
    return triangles[kept], (radius * (1 + DISAGREEMENT * (1 - cosine.mean(axis=1))))[kept]


class _Front:
    """Oriented triangles grown from seeds, over candidate triangles (T, 3) with radii (T,).

    With `is_oriented` a candidate is only taken with its corners in their order.

    A directed edge from i to j is the integer i · N + j; plain Python numbers, as it goes one
    triangle at a time.
    """

    def __init__(
        self,
        points: FloatArray,
        triangles: IntArray,
        radius: FloatArray,
        bend_cost: float,
        *,
        is_oriented: bool = False,
    ) -> None:
        self.size, self.bend_cost, self.is_oriented = len(points), bend_cost, is_oriented
        normals = unit_normals(points, triangles)
        self.seeds: list[int] = np.argsort(radius, kind="stable").tolist()
        self.corners: list[list[int]] = triangles.tolist()
        self.radii: list[float] = radius.tolist()
        self.normals: list[Vector] = [(x, y, z) for x, y, z in normals.tolist()]
        self.candidates: dict[int, list[int]] = {}
        for row, (i, j, k) in enumerate(self.corners):
            for p, q in ((i, j), (j, k), (k, i)):
                self.candidates.setdefault(min(p, q) * self.size + max(p, q), []).append(row)
        self.open: dict[int, Vector] = {}  # edge of the front: normal of the triangle on its left
        self.closed: set[int] = set()  # edges with both triangles, in either direction
        self.leaving = [0] * self.size  # edges of the front that start at a vertex
        self.used = bytearray(self.size)
        self.taken = bytearray(len(triangles))
        self.vertex_normals: list[Vector] = [(0.0, 0.0, 0.0)] * self.size
        self.heap: list[tuple[float, int, int, int]] = []  # cost, candidate, edge, third corner
        self.deferred: list[tuple[float, int, int, int]] = []
        self.faces: list[tuple[int, int, int]] = []

    def grown(self) -> IntArray:
        """(F, 3) the triangles taken; those around a vertex may still form several fans."""
        for seed in self.seeds:
            i, j, k = self.corners[seed]
            if self.used[i] or self.used[j] or self.used[k]:
                continue
            self._take(seed, (i, j, k), self.normals[seed])
            while self.heap or self.deferred:
                self._advance()
        return np.array(self.faces, dtype=np.int64)

    def _advance(self) -> None:
        """Take the cheapest candidate, put it off, or drop it."""
        gluing = not self.heap
        entry = heapq.heappop(self.deferred if gluing else self.heap)
        _, row, edge, k = entry
        if edge not in self.open or self.taken[row]:
            return
        i, j = divmod(edge, self.size)
        normal = self._oriented_normal(row, j, i)
        if self.used[k]:
            there, back = i * self.size + k, k * self.size + j
            if self.leaving[k] == 0 or any(
                key in held for key in (there, back) for held in (self.closed, self.open)
            ):
                return
            met = [self.open.get(k * self.size + i), self.open.get(j * self.size + k)]
            if any(side is not None and _dot(side, normal) <= SHARPEST for side in met):
                return
            if met == [None, None]:  # the front meets itself at a vertex alone
                if not gluing:
                    heapq.heappush(self.deferred, entry)
                    return
                other = self.vertex_normals[k]
                if self.leaving[k] > 1 or _dot(other, normal) < GLUE * _dot(other, other) ** 0.5:
                    return
        self._take(row, (j, i, k), normal)

    def _take(self, row: int, face: tuple[int, int, int], normal: Vector) -> None:
        """Add a candidate with its corners in this order, and offer what its free edges border."""
        self.taken[row] = 1
        self.faces.append(face)
        edges = tuple(zip(face, (*face[1:], face[0]), strict=True))
        for i, j in edges:
            self.used[i] = 1
            x, y, z = self.vertex_normals[i]
            self.vertex_normals[i] = (x + normal[0], y + normal[1], z + normal[2])
            if self.open.pop(j * self.size + i, None) is not None:
                self.leaving[j] -= 1
                self.closed.update((i * self.size + j, j * self.size + i))
            else:
                self.open[i * self.size + j] = normal
                self.leaving[i] += 1
        for i, j in edges:
            if i * self.size + j not in self.open:
                continue
            for other in self.candidates[min(i, j) * self.size + max(i, j)]:
                if self.taken[other]:
                    continue
                beside = self._oriented_normal(other, j, i)
                if self.is_oriented and beside != self.normals[other]:
                    continue
                cosine = _dot(beside, normal)
                if cosine > SHARPEST:
                    cost = self.radii[other] * (1 + self.bend_cost * (1 - cosine))
                    third = sum(self.corners[other]) - i - j
                    heapq.heappush(self.heap, (cost, other, i * self.size + j, third))

    def _oriented_normal(self, row: int, i: int, j: int) -> Vector:
        """The normal of a candidate, turned so that the edge from i to j runs around it."""
        a, b, c = self.corners[row]
        x, y, z = self.normals[row]
        return (x, y, z) if (i, j) in ((a, b), (b, c), (c, a)) else (-x, -y, -z)


def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _largest_part(points: FloatArray, faces: IntArray, longest: int) -> Mesh:
    """The largest component of oriented faces as a manifold, holes up to `longest` edges filled."""
    faces = _connected(points, _single_fans(faces))
    loops = [loop for loop in Mesh(points, faces).boundary_loops if len(loop) <= longest]
    return Mesh(points, _connected(points, _single_fans(_filled(points, faces, loops))))


def _connected(points: FloatArray, faces: IntArray) -> IntArray:
    """The faces of the component with the most."""
    label = Mesh(points, faces).face_components
    return np.asarray(faces[label == np.bincount(label).argmax()])


def _single_fans(faces: IntArray) -> IntArray:
    """The oriented faces without those that make a vertex non-manifold.

    Only the largest fan at each vertex stays; repeated, as this may split other fans.
    """
    while True:
        _, edge_of_halfedge, _ = edge_table(faces)
        corner = np.arange(faces.size)
        following = np.roll(corner.reshape(-1, 3), -1, axis=1).reshape(-1)
        a, b = twin_halfedges(edge_of_halfedge)
        # Twins run in opposite directions: the start of one is the end of the other.
        links = np.concatenate([a, following[a]]), np.concatenate([following[b], b])
        graph = sparse.coo_matrix((np.ones(len(links[0]), dtype=bool), links), (faces.size,) * 2)
        fans, label = csgraph.connected_components(graph, directed=False)
        vertex = np.empty(fans, dtype=np.int64)
        vertex[label] = faces.reshape(-1)
        best = np.lexsort((-np.bincount(label), vertex))
        keep = np.zeros(fans, dtype=bool)
        keep[best[np.unique(vertex[best], return_index=True)[1]]] = True
        good = keep[label].reshape(-1, 3).all(axis=1)
        if good.all():
            return faces
        faces = faces[good]


def _filled(points: FloatArray, faces: IntArray, loops: list[IntArray]) -> IntArray:
    """The faces with each boundary loop closed by ears, the shortest first."""
    present = {tuple(edge) for edge in edge_table(faces)[0].tolist()}
    ears: list[list[int]] = []
    for boundary in loops:
        loop: list[int] = boundary[::-1].tolist()  # against the faces, as the ears will run
        while len(loop) > 3:
            before, after = np.roll(loop, 1), np.roll(loop, -1)
            length = np.linalg.norm(points[after] - points[before], axis=1)
            ends = np.sort(np.stack([before, after], axis=1), axis=1).tolist()
            length[[tuple(pair) in present for pair in ends]] = np.inf
            length[~_has_area(points, np.stack([before, loop, after], axis=1))] = np.inf
            ear = int(length.argmin())
            if not np.isfinite(length[ear]):
                break
            present.add(tuple(ends[ear]))
            ears.append([int(before[ear]), loop.pop(ear), int(after[ear])])
        if len(loop) == 3 and _has_area(points, np.array([loop]))[0]:
            ears.append(loop)
    return np.concatenate([faces, np.array(ears, dtype=np.int64).reshape(-1, 3)])


def defects(mesh: Mesh) -> int:
    """What a triangulation has of handles, boundary edges, folds and unused points, as a count."""
    return _gaps(mesh) + int((_bends(mesh) > QUARTER).sum())


def roughness(mesh: Mesh) -> float:
    """As `defects`, with all bends in quarter turns in place of the folds.

    A boundary edge counts as a half turn: a slit along a sharp rim is no smoother than the rim.
    """
    return _gaps(mesh) + _boundary_edges(mesh) + float(_bends(mesh).sum() / QUARTER)


def _gaps(mesh: Mesh) -> int:
    """Handles, boundary edges and unused points, as a count."""
    return HANDLE * mesh.genus + _boundary_edges(mesh) + int((~mesh.referenced).sum())


def _boundary_edges(mesh: Mesh) -> int:
    return int((mesh.edge_face_count == 1).sum())


def _bends(mesh: Mesh) -> FloatArray:
    """The angles by which the surface turns at its inner edges, in radians."""
    normals = unit_normals(mesh.vertices, mesh.faces)
    one, other = (halfedge // 3 for halfedge in twin_halfedges(mesh.edge_of_halfedge))
    return np.asarray(np.arccos(np.clip((normals[one] * normals[other]).sum(axis=1), -1, 1)))
