"""A map of a bare cloud with short seams, computed without training.

The cloud is thinned where it is scanned in lines (`parapoint.surfaces.scan_lines`), triangulated,
cut open (`parapoint.computed.seams`), and laid out by the scale of a conformal map
(`parapoint.computed.layout`). The map is then made bijective (`parapoint.planar.bijection`) and,
unless it is to be conformal at any cost, such that every part keeps its area
(`parapoint.computed.parts`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from parapoint import clock
from parapoint.computed.denoising import denoised
from parapoint.computed.layout import scaled_layout
from parapoint.computed.parts import Distortion, parts_kept
from parapoint.computed.reconstruction import ReconstructionError, defects, triangulation
from parapoint.computed.scale import even_scale
from parapoint.computed.seams import seamed
from parapoint.errors import InputError
from parapoint.planar.bijection import bijective_map
from parapoint.surfaces.areas import signed_areas
from parapoint.surfaces.cutting import origin
from parapoint.surfaces.parameterization import Charted, Parameterization
from parapoint.surfaces.scan_lines import Lines, thinned
from parapoint.surfaces.surface import FloatArray, IntArray, Mesh

FEWER_DEFECTS = 0.5
"""Share of its defects that a triangulation keeps at most where the points are noisy: 0.06 to 0.2
with noise of 0.5 and 1 % of the diagonal, 0.6 to 3 on models with details as fine as the
spacing."""
LONELY = 6.0
"""What a vertex pays, beside the share of its edges that cross the seam: so many times what this
share exceeds a half by."""
SWEEPS = 10
"""Passes over the seam in the choice of sides."""
SEAM_SHARE = 0.5
"""Share of the time for a map after which its seams are led no farther."""
LEAST_PART = 0.5
"""Share of the points that the triangulation must reach."""


class FlatMap(NamedTuple):
    """A map at A anchors, the points of the cloud that the triangulation reached.

    Attributes:
        anchors: (A,) rows of the cloud.
        missed: (B,) rows that the triangulation did not reach.
        uv: (A, 2) images; the map keeps the total area.
        jacobians: (A, 2, 3) d uv / d x.
        inverse_jacobians: (A, 3, 2) d x / d uv.
        facts: what was found, for reports: genus and boundary loops of the triangulation, faces,
            seam edges, whether it is of the denoised points.
        charted: the whole triangulation, with both sides of its seams.
    """

    anchors: IntArray
    missed: IntArray
    uv: FloatArray
    jacobians: FloatArray
    inverse_jacobians: FloatArray
    facts: dict[str, Any]
    charted: Charted

    def turned(self) -> FlatMap:
        """The same map seen from the other side of the surface: mirrored."""
        mirror = np.array([-1.0, 1.0])
        return self._replace(
            uv=self.uv * mirror,
            jacobians=self.jacobians * mirror[:, None],
            inverse_jacobians=self.inverse_jacobians * mirror,
            charted=self.charted.turned(),
        )


class Flattened(NamedTuple):
    """A cloud as a triangle mesh, cut open and laid into the plane.

    Attributes:
        rows: (A,) rows of the cloud that the triangulation reached.
        missed: (B,) rows that it did not reach.
        thinned: how many rows were thinned out: those in neither.
        mesh: the triangulation of these A points.
        disk: the mesh cut to a planar domain of M vertices.
        origin: (M,) the vertex of `mesh` that each one of `disk` is or copies.
        uv: (M, 2) images of the vertices of `disk`; the map is bijective and keeps the total area.
        is_denoised: whether `mesh` is of the denoised points.
    """

    rows: IntArray
    missed: IntArray
    thinned: int
    mesh: Mesh
    disk: Mesh
    origin: IntArray
    uv: FloatArray
    is_denoised: bool

    def jacobians(self) -> FloatArray:
        """(M, 2, 3) d uv / d x at the vertices of `disk`."""
        return _vertex_jacobians(self.disk, self.uv)

    def chosen(self) -> IntArray:
        """(A,) the one vertex of `disk` that stands for each of `mesh`."""
        return _chosen_copies(self.disk, self.origin)


Say = Callable[[str], None]
"""Is called with what is being done, in a word, when it begins."""


def unheard(_: str) -> None:
    """What is called where nobody wants to know."""


def flattened(
    points: FloatArray,
    deadline: float = math.inf,
    distortion: Distortion = "conformal",
    say: Say = unheard,
) -> Flattened:
    """Distinct points (N, 3) triangulated, cut and flattened; see `flat_map`.

    Raises:
        ReconstructionError: the points show no surface that can be followed and flattened.
        InputError: nor do the lines that they are scanned in; no training would see more.
    """
    lines = thinned(points)
    try:
        return _flattened(points, lines, deadline, distortion, say)
    except ReconstructionError as error:
        if lines is None:
            raise
        raise InputError(
            f"the points lie on scan lines that show no surface ({error}); smooth the lines, or "
            "scan more of them"
        ) from None


def _flattened(
    points: FloatArray, lines: Lines | None, deadline: float, distortion: Distortion, say: Say
) -> Flattened:
    """See `flattened`; `lines` are the scan lines of the points, where there are any."""
    say("reconstructing")
    rows = np.arange(len(points)) if lines is None else lines.rows
    mesh, is_denoised = _still(points[rows], lines)
    reached = np.flatnonzero(mesh.referenced)
    if len(reached) < LEAST_PART * len(rows):
        raise ReconstructionError(
            f"the largest component holds {len(reached)} of {len(rows)} points"
        )
    row = np.full(len(rows), -1, dtype=np.int64)
    row[reached] = np.arange(len(reached))
    missed = rows[~mesh.referenced]
    mesh = Mesh(mesh.vertices[reached], row[mesh.faces])
    disk, uv = _laid_out(mesh, deadline, distortion, say)
    thinned_out = len(points) - len(rows)
    return Flattened(
        rows[reached], missed, thinned_out, mesh, disk, origin(mesh, disk), uv, is_denoised
    )


def _laid_out(
    mesh: Mesh, deadline: float, distortion: Distortion, say: Say
) -> tuple[Mesh, FloatArray]:
    """The mesh cut to a planar domain of M vertices, and their places (M, 2)."""
    begun = clock.worked()
    try:
        say("cutting")
        disk = seamed(mesh, distortion, begun + SEAM_SHARE * (deadline - begun))
        say("flattening")
        uv = bijective_map(disk, _layout(disk), deadline)
        disk, uv = parts_kept(disk, uv, distortion, deadline)
    except (RuntimeError, np.linalg.LinAlgError) as error:  # a singular factor, no bijection
        raise ReconstructionError(f"the triangulation has no flat map ({error})") from None
    uv -= (uv.max(axis=0) + uv.min(axis=0)) / 2
    uv *= np.sqrt(disk.face_areas.sum() / signed_areas(uv, disk.faces).sum())
    return disk, uv


def flat_map(
    points: FloatArray,
    deadline: float = math.inf,
    distortion: Distortion = "conformal",
    say: Say = unheard,
) -> FlatMap:
    """A map of distinct points (N, 3), worse where `deadline` ends the descents.

    Args:
        points: the cloud.
        deadline: no descent takes a step after this time of `clock.worked`.
        distortion: what the map keeps, see `parapoint.computed.parts`.
        say: is told what is being done.

    Raises:
        ReconstructionError: the points show no surface that can be followed and flattened.
    """
    return _differentiated(flattened(points, deadline, distortion, say), distortion)


def flat_map_of_faces(mesh: Mesh, deadline: float = math.inf) -> FlatMap:
    """The conformal map of a mesh by its own faces, worse where `deadline` ends the descents.

    Args:
        mesh: connected, manifold and oriented; no face without area, no vertex without a face.
        deadline: as for `flat_map`.

    Raises:
        ReconstructionError: the mesh has no flat map.
    """
    disk, uv = _laid_out(mesh, deadline, "conformal", unheard)
    rows = np.arange(len(mesh.vertices))
    flat = Flattened(rows, rows[:0], 0, mesh, disk, origin(mesh, disk), uv, is_denoised=False)
    return _differentiated(flat, "conformal")


def _differentiated(flat: Flattened, distortion: Distortion) -> FlatMap:
    """One place and one pair of Jacobians for each vertex, and what was found."""
    chosen = flat.chosen()
    jacobians = flat.jacobians()[chosen]
    boundary = [int((of.edge_face_count == 1).sum()) for of in (flat.mesh, flat.disk)]
    facts = {
        "genus": flat.mesh.genus,
        "boundary_loops": len(flat.mesh.boundary_loops),
        "faces": len(flat.mesh.faces),
        "seam_edges": (boundary[1] - boundary[0]) // 2,
        "denoised": flat.is_denoised,
        "thinned": flat.thinned,
        "distortion": distortion,
    }
    inverse: FloatArray = np.asarray(np.linalg.pinv(jacobians, rcond=0.1), dtype=np.float64)
    charted = Charted(flat.mesh, Parameterization(flat.uv, flat.disk.faces))
    return FlatMap(flat.rows, flat.missed, flat.uv[chosen], jacobians, inverse, facts, charted)


def _still(points: FloatArray, lines: Lines | None) -> tuple[Mesh, bool]:
    """A triangulation of points (N, 3), perhaps on lines, and whether it is of denoised ones.

    Details as fine as the spacing look like noise. So that they stay, the denoised points are taken
    only where most defects of the triangulation go with the noise.
    """
    mesh, moved = triangulation(points, lines), denoised(points)
    if moved is points:
        return mesh, False
    smooth = triangulation(moved, lines)
    if defects(smooth) > FEWER_DEFECTS * defects(mesh):
        return mesh, False
    return smooth, True


def _layout(disk: Mesh) -> FloatArray | None:
    """(V, 2) a map of even scale, faces perhaps on one another; None where there are holes.

    Around a hole the frames come back turned by a full turn, but not to the same place.
    """
    if len(disk.boundary_loops) > 1:
        return None
    return scaled_layout(disk, even_scale(disk))


def _vertex_jacobians(mesh: Mesh, uv: FloatArray) -> FloatArray:
    """(V, 2, 3) d uv / d x: means of the affine maps of the faces around, weighted by area."""

    def edges(values: FloatArray) -> FloatArray:
        corners = values[mesh.faces]
        return np.stack([corners[:, k] - corners[:, 0] for k in (1, 2)], axis=2)

    weight = mesh.face_areas
    by_face = weight[:, None, None] * (edges(uv) @ np.linalg.pinv(edges(mesh.vertices), rcond=1e-3))
    total = np.bincount(mesh.faces.reshape(-1), np.repeat(weight, 3), len(uv))
    jacobians = np.zeros((len(uv), 2, 3))
    for corner in mesh.faces.T:
        np.add.at(jacobians, corner, by_face)
    return jacobians / np.maximum(total, 1e-300)[:, None, None]


def _chosen_copies(disk: Mesh, origin: IntArray) -> IntArray:
    """(N,) the one vertex of `disk` that stands for each of the N uncut ones, `origin` (M,).

    A point on the seam goes to one of its sides. By coordinate descent on the share of edges that
    bridge the seam, and LONELY times what it exceeds a half at any vertex, so that the seam runs
    between two rows of points without notches.
    """
    chosen = np.empty(int(origin.max()) + 1, dtype=np.int64)
    chosen[origin] = np.arange(len(origin))
    for loop in disk.boundary_loops:  # begin with one whole side of each cut
        chosen[origin[loop]] = loop
    links = np.concatenate([disk.edges, disk.edges[:, ::-1]])
    is_copied = np.bincount(origin)[origin] > 1
    near = np.zeros(len(chosen), dtype=bool)
    near[origin[is_copied]] = True
    near[origin[links[is_copied[links[:, 1]], 0]]] = True
    linked: set[tuple[int, int]] = set()
    ring: dict[int, set[int]] = {}
    for i, j in links[near[origin[links[:, 0]]]].tolist():
        linked.add((i, j))
        ring.setdefault(int(origin[i]), set()).add(int(origin[j]))
    copies: dict[int, list[int]] = {}
    for copy in np.flatnonzero(is_copied).tolist():
        copies.setdefault(int(origin[copy]), []).append(copy)
    side: list[int] = chosen.tolist()

    def cost(vertex: int) -> float:
        bridging = [(side[vertex], side[other]) not in linked for other in ring[vertex]]
        share = sum(bridging) / len(bridging)
        return share + LONELY * max(0.0, share - 0.5)

    for _ in range(SWEEPS):
        before = list(side)
        for vertex, group in copies.items():
            around = [vertex, *(other for other in ring[vertex] if other in ring)]
            present, costs = side[vertex], {}
            for copy in group:
                side[vertex] = copy
                costs[copy] = sum(cost(other) for other in around)
            best = min(group, key=costs.__getitem__)
            side[vertex] = best if costs[best] < costs[present] - 1e-9 else present
        if side == before:
            break
    return np.array(side)
