"""How a surface is made to fit a method, and how the maps of its parts become one map of it.

What a method `requires` decides: a method gets the surface as it is wherever that meets the words
(`REQUIREMENTS`). Else these steps are taken, the same for every method, in this order:

- *weld*: vertices at one place, up to rounding (`Mesh.place`), become one.
- *area*: the long edge of a face without area is flipped where another face is across it, so that
  no slit is left; other faces without area are dropped, and so are copies of a face. A copy that
  turns the other way is the other side of a sheet, as of a leaf: the sides are parted.
- *split* (`manifold`): the surface is opened along edges of more than two faces, and at vertices
  where more than one fan of faces meets.
- *turn* (`oriented`, which also asks for `manifold` and for faces with area): neighbouring faces
  turn alike; a one-sided surface is first cut open.
- *components* (`connected`): each is mapped on its own; all are scaled alike and laid side by side.
- *cut* (`disk_after_cut`, which also asks for all the others): what is no disk, with or without
  holes, is cut to one.

A connected, manifold, oriented surface of faces with area is thus cut at most.

The map that comes back is one of the faces as they were, in order. A copy lies on the face that was
kept, and overlaps that. A face without area has the images of its vertices on the faces beside it;
it is in no mean, as it is degenerate in 3D, and adds no seam.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from parapoint import clock
from parapoint.method import REQUIREMENTS, Method, UnsupportedError
from parapoint.surfaces.cutting import cut_along, cut_to_disk
from parapoint.surfaces.parameterization import Parameterization, PointParameterization, TracePoint
from parapoint.surfaces.sides import other_sides, parted
from parapoint.surfaces.surface import (
    BoolArray,
    FloatArray,
    IntArray,
    Mesh,
    PointCloud,
    Surface,
    compact,
    flat_faces,
    turned_faces,
)

IMPLIED = {
    "oriented": frozenset({"manifold"}),
    "disk_after_cut": frozenset({"manifold", "oriented", "connected"}),
}
"""What else a word asks for."""
CUT = "automatic cut to a disk"
"""The step that gives a surface seams which no method chose."""
LEAST_TIME = 0.01
"""Seconds that a part of a surface has at least, however little of a time budget is left."""
GAP = 1 / 256
"""Room between packed components, over the side of a square of all their boxes."""


@dataclass(frozen=True, eq=False)
class Preparation:
    """A surface as a method gets it, and the way back.

    Attributes:
        parts: the surfaces that the method maps, one after another.
        steps: what was done, in words with counts; "" for nothing.
        origin: (F, 3) for each corner of the faces as they were, the corner whose image it has,
            counted through the faces of all parts; None where there is one part with these faces.
    """

    parts: tuple[Surface, ...]
    steps: str = ""
    origin: IntArray | None = None

    def maps(self, method: Method, seed: int) -> list[Parameterization | PointParameterization]:
        """The map of each part; an error has a note of its part, where there are several.

        Several parts share the method's time budget, if it has one: each gets as much of the time
        that is left as it has of the faces that are left.
        """
        if len(self.parts) == 1:
            return [method.parameterize(self.parts[0], seed=seed)]
        meshes = cast("tuple[Mesh, ...]", self.parts)
        begun, found = clock.worked(), []
        left = sum(len(part.faces) for part in meshes)
        for number, part in enumerate(meshes, start=1):
            share = len(part.faces) / left
            try:
                found.append(_sharing(method, share, begun).parameterize(part, seed=seed))
            except Exception as error:
                size = f"{len(part.faces)} face{'s' * (len(part.faces) != 1)}"
                error.add_note(f"(component {number} of {len(meshes)}, {size})")
                raise
            left -= len(part.faces)
        return found

    def joined(
        self, maps: Sequence[Parameterization | PointParameterization]
    ) -> Parameterization | PointParameterization:
        """One map of the surface as it was, from the map of each part.

        Several parts are scaled to their 3D areas and packed. So are the states of their traces,
        where these have the same iterations (there is no trace otherwise); seconds add up, values
        are means by 3D area. The report is that of the largest part.
        """
        if self.origin is None:
            return maps[0]
        parts, charts = cast("list[Mesh]", self.parts), cast("list[Parameterization]", maps)
        first_row = np.cumsum([0, *(len(chart.uv) for chart in charts)])
        rows = [
            chart.corners.reshape(-1) + row for chart, row in zip(charts, first_row, strict=False)
        ]
        corners = np.concatenate(rows)[self.origin]
        if len(charts) == 1:
            return Parameterization(charts[0].uv, corners, charts[0].trace, charts[0].report)
        area = np.array([part.face_areas.sum() for part in parts])
        uv = _packed(charts, [chart.uv for chart in charts], area)
        largest = int(area.argmax())
        report = {"components": len(parts), "largest": dict(charts[largest].report)}
        return Parameterization(uv, corners, _trace(charts, area), report)


def _sharing(method: Method, share: float, begun: float) -> Method:
    """The method with a share of what is left of its time budget, which began to run at `begun`."""
    budget: float | None = getattr(method, "time_budget", None)
    if budget is None:
        return method
    seconds = max(share * (begun + budget - clock.worked()), LEAST_TIME)
    return cast("Method", replace(cast("Any", method), time_budget=seconds))


def prepared(surface: Surface, requires: frozenset[str]) -> Preparation:
    """`surface` as a method that `requires` these words gets it.

    Raises:
        UnsupportedError: the surface does not meet a requirement, and cannot be made to.
        KeyError: a word is not in REQUIREMENTS.
    """
    for word in sorted(requires):
        reason = REQUIREMENTS[word](surface)
        if reason is not None:
            raise UnsupportedError(reason)
    if isinstance(surface, PointCloud):
        return Preparation((surface,))
    words = requires.union(*(IMPLIED.get(word, frozenset()) for word in requires))
    steps: list[str] = []
    parts, origin = [surface], None
    if not _meets(surface, words):
        parts, steps, origin = _repaired(surface, words)
    if "disk_after_cut" in words:
        disks = [part if part.is_planar_domain else cut_to_disk(part) for part in parts]
        count = sum(disk is not part for disk, part in zip(disks, parts, strict=True))
        several = f" ({count} of {len(parts)} components)" if len(parts) > 1 else ""
        steps += [f"{CUT}{several}"] * (count > 0)
        parts = disks
    return Preparation(tuple(parts), "; ".join(steps), origin)


def _meets(mesh: Mesh, words: frozenset[str]) -> bool:
    """Whether the mesh is as these words ask for, but for a cut."""
    return (
        ("manifold" not in words or mesh.is_manifold)
        and ("oriented" not in words or mesh.is_oriented)
        and ("oriented" not in words or not flat_faces(mesh.vertices, mesh.faces).any())
        and ("oriented" not in words or not other_sides(mesh.faces).any())
        and ("connected" not in words or mesh.component_count == 1)
    )


def _repaired(mesh: Mesh, words: frozenset[str]) -> tuple[list[Mesh], list[str], IntArray]:
    """The parts, the steps, and the origin of a mesh that does not meet the words.

    Raises:
        UnsupportedError: no face has an area.
    """
    steps: list[str] = []

    def note(count: int, step: str, thing: str, plural: str = "") -> None:
        if count:
            steps.append(f"{step} {count} {thing if count == 1 else plural or thing + 's'}")

    whole = mesh.welded
    note(int(mesh.referenced.sum() - whole.referenced.sum()), "welded", "vertex", "vertices")
    solid = (whole.faces != np.roll(whole.faces, 1, axis=1)).all(axis=1)
    if flat_faces(whole.vertices, whole.faces).all():
        raise UnsupportedError("needs faces with an area; no face of the surface has any")
    faces, flips = _with_flipped_edges(Mesh(whole.vertices, whole.faces[solid]))
    note(flips, "flipped the long edge of", "face without area", "faces without area")
    flat = flat_faces(whole.vertices, faces)
    count = int((~solid).sum() + flat.sum())
    note(count, "dropped", "face without area", "faces without area")
    is_other = other_sides(faces)
    single = _first_of_each(np.column_stack([np.sort(faces, axis=1), is_other]))
    kept, is_other = single & ~flat, is_other[single & ~flat]
    note(int((~single & ~flat).sum()), "dropped", "duplicate face")
    note(int(is_other.sum()), "parted the two sides of", "face")
    note(
        int((~whole.referenced[mesh.place]).sum()),
        "dropped",
        "unreferenced vertex",
        "unreferenced vertices",
    )
    place = faces[kept]  # welded vertex at each corner, whatever copies the next steps make
    made = parted(Mesh(whole.vertices, place), is_other)
    if "manifold" in words:
        fans = cut_along(made, made.edges[made.edge_face_count > 2])
        note(int((made.edge_face_count > 2).sum()), "split", "non-manifold edge")
        copied = np.unique(place[fans.faces != made.faces])
        note(len(copied), "split", "non-manifold vertex", "non-manifold vertices")
        made = fans
    if "oriented" in words:
        turned = turned_faces(made.faces)
        note(int(turned.sum()), "turned", "face")
        place = np.where(turned[:, None], place[:, ::-1], place)
        made = Mesh(made.vertices, np.where(turned[:, None], made.faces[:, ::-1], made.faces))
        twice = made.halfedges[~_first_of_each(made.halfedges)]
        note(len(twice), "cut a one-sided surface along", "edge")
        made = cut_along(made, twice)
    component = made.face_components if "connected" in words else np.zeros(len(place), np.int64)
    order = np.argsort(component, kind="stable")
    bounds = np.cumsum(np.bincount(component))[:-1]
    parts = [compact(made.vertices, faces) for faces in np.split(made.faces[order], bounds)]
    note(len(parts) if len(parts) > 1 else 0, "packed", "component")
    return parts, steps, _origin(whole.faces, place[order], is_other[order])


def _first_of_each(rows: IntArray) -> BoolArray:
    """(N,) whether a row of (N, k) is the first of those equal to it."""
    first = np.zeros(len(rows), dtype=bool)
    first[np.unique(rows, axis=0, return_index=True)[1]] = True
    return first


def _with_flipped_edges(mesh: Mesh) -> tuple[IntArray, int]:
    """The faces (F, 3) with the long edge of faces without area flipped, and how many flips.

    A face a, b, c without area has b on its long edge from c to a. With the face a, c, d across
    that edge it makes the two faces a, b, d and b, c, d, which have areas.
    """
    faces, flips = mesh.faces.copy(), 0
    while (flat := flat_faces(mesh.vertices, faces)).any():
        made, changed = Mesh(mesh.vertices, faces), np.zeros(len(faces), dtype=bool)
        ends = mesh.vertices[made.halfedges]
        length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        halfedges_at = np.argsort(made.edge_of_halfedge, kind="stable")
        first = np.cumsum(made.edge_face_count) - made.edge_face_count
        faces = faces.copy()
        for face in np.flatnonzero(flat):
            long = 3 * face + int(length[3 * face : 3 * face + 3].argmax())
            edge = made.edge_of_halfedge[long]
            if made.edge_face_count[edge] != 2:
                continue
            other = int(halfedges_at[first[edge] : first[edge] + 2].sum()) - long
            g = other // 3
            if flat[g] or changed[g] or changed[face]:
                continue
            c, a, b = np.roll(made.faces[face], -(long % 3))
            d = made.faces[g, (other + 2) % 3]
            faces[face], faces[g] = (a, b, d), (b, c, d)
            changed[[face, g]] = True
        if flat_faces(mesh.vertices, faces).sum() >= flat.sum():
            return made.faces.copy(), flips
        flips += int(changed.sum()) // 2
    return faces, flips


def _origin(faces: IntArray, made: IntArray, is_other: BoolArray) -> IntArray:
    """(F, 3) for each corner of `faces`, the corner of `made` (P, 3) that has its image.

    Corners are counted through the faces; entries are vertices of the welded mesh. A face that is
    among `made`, on the side (P,) that `is_other` says, has its corners there. Any other one has
    those of faces that share an edge with it, else of any face at the vertex, else all at the same
    place.
    """
    flat = made.reshape(-1)
    origin = np.full(faces.shape, -1, dtype=np.int64)

    def found(keys: IntArray, wanted: IntArray) -> IntArray:
        """(N,) the first of `keys` that equals each of `wanted`, or -1."""
        known, first = np.unique(keys, return_index=True)
        at = np.minimum(np.searchsorted(known, wanted), len(known) - 1)
        return np.where(known[at] == wanted, first[at], -1)

    def key(pairs: IntArray) -> IntArray:
        """(N,) one number for each undirected pair (N, 2) of vertices."""
        return np.asarray(np.sort(pairs, axis=1) @ [int(faces.max()) + 1, 1], dtype=np.int64)

    sides = np.concatenate([is_other, other_sides(faces)])
    both = np.column_stack([np.sort(np.concatenate([made, faces]), axis=1), sides])
    _, triple = np.unique(both, axis=0, return_inverse=True)
    twin = found(triple.reshape(-1)[: len(made)], triple.reshape(-1)[len(made) :])
    for k in range(3):
        corner = 3 * twin + (made[twin] == faces[:, k, None]).argmax(axis=1)
        origin[:, k] = np.where(twin >= 0, corner, -1)
    lost = np.flatnonzero(twin < 0)
    following = np.arange(3 * len(made)).reshape(-1, 3)[:, [1, 2, 0]].reshape(-1)
    ends = key(np.stack([flat, flat[following]], axis=1))
    for k in range(3):
        pair = faces[lost][:, [k, (k + 1) % 3]]
        halfedge = found(ends, key(pair))
        for side, corner in ((0, k), (1, (k + 1) % 3)):
            here = np.where(flat[halfedge] == pair[:, side], halfedge, following[halfedge])
            take = (halfedge >= 0) & (origin[lost, corner] < 0)
            origin[lost[take], corner] = here[take]
    for k in range(3):
        rest = lost[origin[lost, k] < 0]
        origin[rest, k] = found(flat, faces[rest, k])
    return np.where(origin < 0, np.maximum(origin.max(axis=1, keepdims=True), 0), origin)


def _packed(
    charts: Sequence[Parameterization], uvs: Sequence[FloatArray], area: FloatArray
) -> FloatArray:
    """(T, 2) the maps `uvs` of all parts side by side, each scaled to its 3D `area` (N,)."""
    placed = []
    for chart, uv, size in zip(charts, uvs, area, strict=True):
        a, b, c = (uv[chart.corners[:, k]] for k in range(3))
        (x, y), (z, w) = (b - a).T, (c - a).T
        uv_area = float(np.abs(x * w - y * z).sum()) / 2
        scaled = uv * np.sqrt(size / uv_area if uv_area > 0 else 1.0)
        placed.append(scaled - np.nanmin(scaled[chart.corners], axis=(0, 1)))
    sizes = [
        np.nanmax(uv[chart.corners], axis=(0, 1)) for uv, chart in zip(placed, charts, strict=True)
    ]
    corner = shelves(np.array(sizes))
    return np.concatenate([uv + at for uv, at in zip(placed, corner, strict=True)])


def shelves(sizes: FloatArray, gap: float = GAP) -> FloatArray:
    """(N, 2) lower left corners of boxes (N, 2) set on shelves, the highest first.

    Args:
        sizes: of the boxes.
        gap: room between them, over the side of a square of all boxes.
    """
    sizes = sizes + gap * float(np.sqrt(sizes.prod(axis=1).sum()))
    width = max(float(sizes[:, 0].max()), float(np.sqrt(sizes.prod(axis=1).sum())))
    corner = np.empty_like(sizes)
    x = y = shelf = 0.0
    for box in np.argsort(-sizes[:, 1], kind="stable"):
        if x > 0 and x + sizes[box, 0] > width:
            x, y = 0.0, y + shelf
        if x == 0:
            shelf = sizes[box, 1]
        corner[box] = x, y
        x += sizes[box, 0]
    return corner


def _trace(charts: Sequence[Parameterization], area: FloatArray) -> tuple[TracePoint, ...]:
    """The traces of all parts as one, as `Preparation.joined` says."""
    steps = {tuple(point.iteration for point in chart.trace) for chart in charts}
    if len(steps) > 1:
        return ()
    joined = []
    for points in zip(*(chart.trace for chart in charts), strict=True):
        uvs = [point.uv for point in points if point.uv is not None]
        values = {
            name: float(np.average([point.values[name] for point in points], weights=area))
            for name in points[0].values
        }
        uv = _packed(charts, uvs, area) if len(uvs) == len(charts) else None
        seconds = sum(point.seconds for point in points)
        joined.append(TracePoint(points[0].iteration, seconds, values, uv))
    return tuple(joined)
