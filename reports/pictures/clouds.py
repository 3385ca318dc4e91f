"""The paper's pictures of a learned map, made of points: cloud, uv, checkerboard, seams.

Of a map of a mesh, a results folder holds the uv of the vertices and no network: the uv of a point
is interpolated in its face, or, where the face spans a learned seam, that of its nearest corner. A
cloud is drawn as small disks in its tangent planes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from benchmarks.metrics.pointwise import PointMap, point_map
from benchmarks.rendering.colours import (
    DARK_TONE,
    FLIP_ORANGE,
    LIGHT_TONE,
    SEAM_GREEN,
    Floats,
    Image,
    averaged,
    linear,
)
from benchmarks.rendering.maps import Map
from benchmarks.rendering.scene import Scene, View
from benchmarks.rendering.viewpoints import two_cameras
from benchmarks.store.rows import ResultRow
from parapoint.errors import InputError
from parapoint.surfaces.normals import oriented_normals
from parapoint.surfaces.parameterization import PointParameterization
from parapoint.surfaces.surface import BoolArray, FloatArray, IntArray, Mesh, PointCloud

SPARSE, DENSE = 10_000, 250_000
"""Points of the paper's input, drawn where a row does not say how many it had, and of its texture
mapping.
"""

MOST_POINTS = 50_000
"""Most points that are drawn of a cloud: more run into one another."""

GREY = linear([0.62, 0.62, 0.62])

DOT, SEAM_DOT = 0.38, 0.5
"""Radius of a dot in the cloud, and of one on a seam, in mean distances of the sparse points."""


@dataclass(frozen=True, eq=False)
class Points:
    """Points spread evenly over a mesh, drawn at random.

    Attributes:
        mesh: the surface.
        face: (n,) the face that each lies in.
        weights: (n, 3) weights of its corners.
    """

    mesh: Mesh
    face: IntArray
    weights: FloatArray

    def at(self, values: FloatArray | Floats) -> FloatArray:
        """(n, k) values (F, 3, k), given at the corners of the faces, at the points."""
        return np.asarray(np.einsum("nc,nck->nk", self.weights, values[self.face]))

    @property
    def positions(self) -> FloatArray:
        """(n, 3) where they are."""
        return self.at(self.mesh.vertices[self.mesh.faces])

    def uv(self, uv: FloatArray, spanning: BoolArray) -> FloatArray:
        """(n, 2) uv of the points for those (F, 3, 2) of the corners."""
        nearest = np.eye(3)[self.weights.argmax(axis=1)]
        weights = np.where(spanning[self.face, None], nearest, self.weights)
        return replace(self, weights=weights).at(uv)


def surface_points(mesh: Mesh, count: int) -> Points:
    """`count` points on a mesh, as dense everywhere; the same ones each time."""
    draw = np.random.default_rng(0)
    share = np.cumsum(mesh.face_areas)
    face = np.searchsorted(share, draw.random(count) * share[-1], side="right")
    root, along = np.sqrt(draw.random(count)), draw.random(count)
    weights = np.stack([1 - root, root * (1 - along), root * along], axis=1)
    return Points(mesh, np.minimum(face, len(mesh.faces) - 1), weights)


def points_used(row: ResultRow) -> int:
    """How many points the method of a row was given."""
    told = row.report.get("points", row.params.get("points"))
    return min(told, MOST_POINTS) if isinstance(told, int) and told > 0 else SPARSE


def images(
    view: View, found: Map, colours: Floats, squares: float, count: int
) -> Mapping[str, Image]:
    """The pictures of a map of a mesh by their kind.

    `colours` (F, 3, 3) of the corners by normals, `squares` fields of the checkerboard to a unit of
    uv, `count` points of the cloud.
    """
    mesh, spanning = view.scene.mesh, found.spanning
    uv = found.uv - found.uv.min(axis=(0, 1))
    sparse, dense = surface_points(mesh, count), surface_points(mesh, DENSE)
    spacing = float(np.sqrt(mesh.face_areas.sum() / count))
    seen = view.at_corners(mesh.vertices[mesh.faces])
    reach = DOT * spacing
    distance, nearest = cKDTree(sparse.positions).query(
        seen, distance_upper_bound=reach, workers=-1
    )
    dots = np.isfinite(distance)
    tones = sparse.at(colours).astype(np.float32)
    _, densely = cKDTree(dense.positions).query(seen, workers=-1)
    field = np.floor(dense.uv(uv, spanning) * squares).sum(axis=1) % 2 == 0
    checker = np.where(field[:, None], LIGHT_TONE, DARK_TONE)
    checker[found.flipped[dense.face]] = FLIP_ORANGE
    return {
        "cloud": _part(view, dots).image(tones[nearest[dots]], lit=False),
        "cloud-uv": _planar(sparse.uv(uv, spanning), tones, view),
        "dense": view.image(checker[densely].astype(np.float32)),
        "seams": _seams(view, dense.positions[spanning[dense.face]], dots, seen, spacing),
    }


SIDES = 6
"""Corners of the disk that stands for a point of a cloud."""

DISK_DOT = 0.55
"""Radius of the dot in its middle, in its own."""

POINTS_A_FIELD = 5
"""Least side of a field of the checkerboard, in distances of neighbouring points."""


class Portrait:
    """A cloud of points, ready to be drawn under any map."""

    def __init__(self, cloud: PointCloud, size: int, samples: int, fields: float) -> None:
        """Pictures of `size` pixels, `fields` of the checkerboard along the diagonal."""
        self.cloud = cloud
        normals = cloud.normals
        if normals is None:
            normals = oriented_normals(cloud.points)
            outward = np.einsum("pk,pk->p", normals, cloud.points - cloud.points.mean(axis=0))
            normals = normals * (1 if outward.sum() >= 0 else -1)
        self._normals = normals
        near = cKDTree(cloud.points).query(cloud.points, min(SIDES + 1, len(cloud.points)))[0]
        self._radius = np.minimum(near[:, 1:].mean(axis=1), 3 * np.median(near[:, 1:]))
        self._fields = fields
        scene = Scene(self._disks(), shadows=False)
        cameras = two_cameras(scene)
        self._views = [scene.view(camera, size, samples) for camera in cameras]

    def _disks(self) -> Mesh:
        """SIDES - 2 faces a point: a disk in its tangent plane that reaches its neighbours."""
        least = np.eye(3)[np.abs(self._normals).argmin(axis=1)]
        across = np.cross(self._normals, least)
        across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
        angle = np.arange(SIDES) * 2 * np.pi / SIDES
        rim = np.multiply.outer(np.cos(angle), across)
        rim += np.multiply.outer(np.sin(angle), np.cross(self._normals, across))
        corners = self.cloud.points + self._radius[:, None] * rim  # (SIDES, P, 3)
        fan = np.array([[0, k, k + 1] for k in range(1, SIDES - 1)])
        first = SIDES * np.arange(len(self.cloud.points))
        faces = (first[:, None, None] + fan).reshape(-1, 3)
        return Mesh(corners.transpose(1, 0, 2).reshape(-1, 3), faces)

    def _dots(self, view: View) -> tuple[IntArray, BoolArray]:
        """(S,) the point that each sample shows, and whether it lies on the dot in its middle."""
        point = view.face // (SIDES - 2)
        mesh = view.scene.mesh
        apart = view.at_corners(mesh.vertices[mesh.faces]) - self.cloud.points[point]
        return point, np.linalg.norm(apart, axis=1) < DISK_DOT * self._radius[point]

    def model(self) -> Mapping[str, Image]:
        """The pictures of the cloud itself by their kind: grey dots."""
        found = {}
        for number, view in enumerate(self._views, start=1):
            _, dots = self._dots(view)
            grey = np.tile(GREY, (int(dots.sum()), 1))
            found[f"mesh-{number}"] = _part(view, dots).image(grey)
        return found

    def map(self, result: object, kinds: Sequence[str]) -> Mapping[str, Image]:
        """The pictures of a map, those of `kinds`.

        Raises:
            InputError: the map is not of this cloud.
        """
        if not isinstance(result, PointParameterization):
            raise InputError("the map is not one of points")
        found = point_map(self.cloud, result)
        view = self._views[0]
        point, dots = self._dots(view)
        tones = linear(0.5 + 0.42 * self._normals @ view.camera.axes.T)
        field = np.floor(found.uv / self._field(found)).sum(axis=1) % 2 == 0
        checker = np.where(field[:, None], LIGHT_TONE, DARK_TONE)
        seam = np.where(found.spanning[:, None], SEAM_GREEN, GREY)
        kept = dots | found.spanning[point]
        makers: dict[str, Callable[[], Image]] = {
            "cloud": lambda: _part(view, dots).image(tones[point[dots]], lit=False),
            "cloud-uv": lambda: _planar(found.uv, tones, view),
            "dense": lambda: view.image(checker[point].astype(np.float32)),
            "seams": lambda: _part(view, kept).image(seam[point[kept]].astype(np.float32)),
        }
        return {kind: makers[kind]() for kind in kinds}

    def _field(self, found: PointMap) -> float:
        """The side of a field of the checkerboard in uv.

        It follows the median scale of the map, as on a mesh, but a field holds enough points that
        it can be seen.
        """
        magnified = float(np.median(found.singular_values.prod(axis=1)[~found.spanning]))
        near = np.linalg.norm(found.points[found.neighbours[:, 0]] - found.points, axis=1)
        side = float(np.linalg.norm(np.ptp(found.points, axis=0)))
        length = max(side / self._fields, POINTS_A_FIELD * float(np.median(near)))
        return length * max(float(np.sqrt(magnified)), 1e-12)


def _part(view: View, kept: BoolArray) -> View:
    """The samples of `view` that are kept (S,)."""
    return replace(
        view,
        sample=view.sample[kept],
        fine_face=view.fine_face[kept],
        fine_weights=view.fine_weights[kept],
    )


def _seams(view: View, seam: FloatArray, dots: BoolArray, seen: Floats, spacing: float) -> Image:
    """Grey dots, and green ones over them at the points `seam` (m, 3)."""
    green = np.zeros(len(seen), dtype=np.bool_)
    if len(seam):
        distance, _ = cKDTree(seam).query(seen, distance_upper_bound=SEAM_DOT * spacing, workers=-1)
        green = np.isfinite(distance)
    kept = dots | green
    colours = np.where(green[kept, None], SEAM_GREEN, GREY)
    return _part(view, kept).image(colours.astype(np.float32))


def _planar(uv: FloatArray, tones: Floats, view: View) -> Image:
    """Dots of these colours at `uv` (n, 2), in an image as large as that of `view`."""
    size, samples = max(view.shape), view.samples
    low, high = uv.min(axis=0), uv.max(axis=0)
    extent = np.maximum(high - low, 1e-12)
    width, height = np.maximum(np.round(size * extent / extent.max()), 1).astype(int)
    step = extent.max() / (size * samples)
    x = low[0] + (np.arange(width * samples) + 0.5) * step
    y = high[1] - (np.arange(height * samples) + 0.5) * step
    grid = np.stack(np.meshgrid(x, y), axis=2).reshape(-1, 2)
    radius = DOT * 1.2 * float(np.sqrt(extent.prod() / len(uv)))
    distance, nearest = cKDTree(uv).query(grid, distance_upper_bound=radius, workers=-1)
    found = np.isfinite(distance)
    return averaged(
        (int(height), int(width)), samples, np.flatnonzero(found), tones[nearest[found]]
    )
