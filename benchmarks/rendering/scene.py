"""A scene and its views: shading in numpy on rays that `Rays` follows; no screen is needed.

What does not depend on a map (visibility, normals, ambient occlusion, light) is kept in a `Scene`
and its `View`s, so that a further map of the same model costs a lookup of its texture only. Cameras
are orthographic: a face's screen positions and its uv are then related by one affine map, and the
checkerboard is filtered exactly, without sampling noise.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import igl
import numpy as np

from benchmarks.rendering.camera import Camera
from benchmarks.rendering.colours import DARK_TONE, LIGHT_TONE, Floats, Image, averaged
from benchmarks.rendering.rays import Rays, sphere_directions
from parapoint.surfaces.surface import BoolArray, FloatArray, IntArray, Mesh

CREASE_DEGREES = 50.0
"""Faces that meet at a larger angle are shaded with an edge between them."""

OCCLUSION_RAYS = 2_000_000
"""Rays spent on a model's ambient occlusion, in all."""

DIRECTIONS = (32, 64)
"""Directions from a vertex, at least and at most. 64 are right to .015 (root mean square) of the
sky, 128 to .009, for twice the time."""

FINE_FACES = 10_000
"""Ambient occlusion is computed on at least this many faces."""

KEY_LIGHT = np.array([-0.42, 0.56, 0.71], dtype=np.float32)

FILL_LIGHT = np.array([0.80, 0.10, 0.59], dtype=np.float32)
"""Directions of the lights in the frame of the camera: right, up, towards the eye."""


def _unit(vectors: FloatArray) -> FloatArray:
    """Rows of `vectors` at length 1; rows without a direction point along z."""
    finite = np.where(np.isfinite(vectors), vectors, 0)
    length = np.linalg.norm(finite, axis=-1, keepdims=True)
    safe = np.where(length > 0, length, 1)
    return np.asarray(np.where(length > 0, finite / safe, [0.0, 0.0, 1.0]))


class Scene:
    """A mesh ready to be looked at, from any side and under any texture.

    Its large faces are split for the computation of shadows, so that one can fall within a face.
    """

    def __init__(self, mesh: Mesh, *, shadows: bool = True) -> None:
        """A scene of `mesh`; without `shadows` nothing keeps the sky from any of it."""
        self.mesh = mesh
        self._shadows = shadows
        self.fine = split(mesh, FINE_FACES if shadows else 0)
        self.rays = Rays(self.fine.mesh)
        low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
        self.size = float(np.linalg.norm(high - low))

    @cached_property
    def face_normals(self) -> FloatArray:
        """(F, 3) unit normals."""
        a, b, c = (self.mesh.vertices[self.mesh.faces[:, k]] for k in range(3))
        return _unit(np.cross(b - a, c - a))

    @cached_property
    def corner_normals(self) -> Floats:
        """(F, 3, 3) unit normals at the corners, smooth except across creases."""
        normals = igl.per_corner_normals(self.mesh.vertices, self.mesh.faces, CREASE_DEGREES)
        return _unit(np.asarray(normals)).reshape(-1, 3, 3).astype(np.float32)

    @cached_property
    def openness(self) -> Floats:
        """(fine vertices, 2) how much of the sky each sees on its front and back: 1 for all.

        Cosine-weighted, over directions that are the same for every vertex: smooth, no noise.
        """
        mesh = self.fine.mesh
        if not self._shadows:
            return np.ones((len(mesh.vertices), 2), dtype=np.float32)
        normals = _unit(np.asarray(igl.per_vertex_normals(mesh.vertices, mesh.faces)))
        count = int(np.clip(OCCLUSION_RAYS // len(normals), *DIRECTIONS))
        directions = sphere_directions(count)
        share = np.ones((len(normals), 2), dtype=np.float32)
        closed = len(self.mesh.boundary_loops) == 0
        for side, sign in enumerate((1.0,) if closed else (1.0, -1.0)):
            cosine = sign * normals @ directions.T
            at, toward = np.nonzero(cosine > 0.02)
            origins = mesh.vertices + sign * 1e-3 * self.size * normals
            blocked = self.rays.blocked(origins[at], directions[toward].astype(np.float32))
            weight = cosine[at, toward]
            total = np.bincount(at, weight, len(normals))
            free = np.bincount(at[~blocked], weight[~blocked], len(normals))
            share[:, side] = free / np.where(total > 0, total, 1)
        return share

    @property
    def coarse_openness(self) -> Floats:
        """(V, 2) how much of the sky the vertices of the mesh itself see."""
        return self.openness[: len(self.mesh.vertices)]  # splitting keeps these first

    def view(self, camera: Camera, size: int, samples: int = 3) -> View:
        """What `camera` sees in an image whose longer side has `size` pixels.

        `samples` by `samples` rays go through each pixel.
        """
        width, height = np.maximum(np.round(size * camera.half / camera.half.max()), 1).astype(int)
        x = (np.arange(width * samples) + 0.5) / (width * samples) * 2 - 1
        y = 1 - (np.arange(height * samples) + 0.5) / (height * samples) * 2
        right, up, toward = camera.axes * np.append(camera.half, 2 * self.size)[:, None]
        grid = (y[:, None, None] * up + x[None, :, None] * right).reshape(-1, 3)
        origins = grid + (camera.centre + toward)
        directions = np.broadcast_to(-camera.axes[2].astype(np.float32), origins.shape).copy()
        hit, weights = self.rays.first(origins, directions)
        sample = np.flatnonzero(hit >= 0)
        return View(
            scene=self,
            camera=camera,
            shape=(int(height), int(width)),
            samples=samples,
            sample=sample,
            fine_face=hit[sample],
            fine_weights=weights[sample],
        )


class Fine(NamedTuple):
    """A mesh split into smaller faces.

    Attributes:
        mesh: the smaller faces.
        parent: (f,) the face that each is a part of.
        weights: (f, 3, 3) the weights of the parent's corners (last axis) at each corner.
    """

    mesh: Mesh
    parent: IntArray
    weights: FloatArray


def split(mesh: Mesh, least: int) -> Fine:
    """`mesh` with every face split in four until there are `least` faces."""
    parent = np.arange(len(mesh.faces))
    weights = np.broadcast_to(np.eye(3), (len(parent), 3, 3))
    while len(mesh.faces) < least:
        middle = len(mesh.vertices) + mesh.edge_of_halfedge.reshape(-1, 3)
        a, b, c = mesh.faces.T
        ab, bc, ca = middle.T
        pieces = [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        faces = np.stack([np.stack(piece, axis=1) for piece in pieces], axis=1).reshape(-1, 3)
        half = (np.eye(3) + np.roll(np.eye(3), 1, axis=1)) / 2  # rows: middle of ab, bc, ca
        one, two, three = np.eye(3)
        rows = [
            [one, half[0], half[2]],
            [half[0], two, half[1]],
            [half[2], half[1], three],
            half.tolist(),
        ]
        weights = np.einsum("pkj,fji->fpki", np.array(rows), weights).reshape(-1, 3, 3)
        parent = np.repeat(parent, 4)
        vertices = np.concatenate([mesh.vertices, mesh.vertices[mesh.edges].mean(axis=1)])
        mesh = Mesh(vertices, faces)
    return Fine(mesh, parent, weights)


@dataclass(frozen=True, eq=False)
class View:
    """What a camera sees of a scene, under no texture yet. S is the number of samples that hit.

    Attributes:
        scene: what is seen.
        camera: from where.
        shape: (height, width) of the image in pixels.
        samples: each pixel is the mean of `samples` by `samples`.
        sample: (S,) place of each hit in the sample grid, row by row.
        fine_face: (S,) the face of `scene.fine` seen.
        fine_weights: (S, 2) weights of its corners 1 and 2.
    """

    scene: Scene
    camera: Camera
    shape: tuple[int, int]
    samples: int
    sample: IntArray
    fine_face: IntArray
    fine_weights: Floats

    @cached_property
    def _corner_weights(self) -> Floats:
        """(S, 3) weights of the corners of `fine_face`."""
        second, third = self.fine_weights.T
        return np.stack([1 - second - third, second, third], axis=1)

    @cached_property
    def face(self) -> IntArray:
        """(S,) the face of the mesh seen."""
        return np.asarray(self.scene.fine.parent[self.fine_face])

    @cached_property
    def weights(self) -> Floats:
        """(S, 3) weights of the corners of `face`."""
        if len(self.scene.fine.parent) == len(self.scene.mesh.faces):
            return self._corner_weights
        at = self.scene.fine.weights.astype(np.float32)[self.fine_face]
        return np.asarray(np.einsum("sk,ski->si", self._corner_weights, at))

    @cached_property
    def light(self) -> tuple[Floats, Floats]:
        """(S,) light that a matt surface returns at each sample, and (S,) the gloss on top."""
        axes = self.camera.axes.astype(np.float32)
        normal = self.at_corners(self.scene.corner_normals) @ axes.T  # in the camera's frame
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), np.float32(1e-6))
        front = self.scene.face_normals[self.face] @ self.camera.axes[2] >= 0
        normal[~front] *= -1
        openness = self.scene.openness[self.scene.fine.mesh.faces[self.fine_face]]
        side = np.where(front[:, None], openness[..., 0], openness[..., 1])
        sky = np.einsum("sk,sk->s", self._corner_weights, side)
        facing = np.maximum(normal @ KEY_LIGHT, 0), np.maximum(normal @ FILL_LIGHT, 0)
        ambient = sky * (0.75 + 0.25 * normal[:, 1])
        light = 0.50 * ambient + 0.62 * facing[0] * (0.25 + 0.75 * sky) + 0.12 * facing[1] * sky
        light = np.where(front, light, 0.72 * light)  # the inner side is a shade darker
        halfway = KEY_LIGHT + np.eye(3, dtype=np.float32)[2]
        halfway /= np.linalg.norm(halfway)
        gloss = 0.10 * np.maximum(normal @ halfway, 0) ** 40 * sky
        return light.astype(np.float32), gloss.astype(np.float32)

    def at_corners(self, values: FloatArray | Floats) -> Floats:
        """(S, n) values (F, 3, n), given at the corners of the faces, at each sample."""
        given = values.astype(np.float32)[self.face]
        return np.asarray(np.einsum("sk,ski->si", self.weights, given))

    @property
    def shown_areas(self) -> FloatArray:
        """(2, F) how much of the image each face fills with its front, and with its back.

        In square units of the surface.
        """
        count = len(self.scene.mesh.faces)
        back = (self.scene.face_normals @ self.camera.axes[2] < 0)[self.face]
        samples = np.bincount(self.face + count * back, minlength=2 * count).reshape(2, count)
        return np.asarray(samples * (self._pixel_size / self.samples) ** 2)

    @cached_property
    def _pixel_size(self) -> float:
        """Width of a pixel, in units of the surface."""
        return float(2 * self.camera.half.max() / max(self.shape))

    @cached_property
    def _screen(self) -> Floats:
        """(F, 3, 2) corners of the faces on the screen, in pixels."""
        screen = self.camera.screen(self.scene.mesh.vertices)[:, :2] / self._pixel_size
        return screen.astype(np.float32)[self.scene.mesh.faces]

    def image(self, colours: Floats, *, lit: bool = True) -> Image:
        """The picture of the surface under linear `colours` (S, 3) in [0, 1]; flat unless `lit`."""
        if lit:
            light, gloss = self.light
            colours = colours * light[:, None] + gloss[:, None]
        return averaged(self.shape, self.samples, self.sample, colours)

    def checker(self, uv: FloatArray | Floats, squares: float) -> Floats:
        """(S, 3) a linear checkerboard, `squares` fields to a unit of `uv` (F, 3, 2), antialiased.

        Each sample is the exact mean of the board over its footprint, a box in uv.
        """
        uv32 = (uv * squares).astype(np.float32)
        at = self.at_corners(uv32)
        # A thousandth of a field at least: differences of the integral lose their digits below.
        width = np.maximum(self._footprint(uv32)[self.face] / np.float32(self.samples), 1e-3)
        half = width / np.float32(2)
        low, high = at - half, at + half
        sign = np.clip((_wave_integral(high) - _wave_integral(low)) / width, -1, 1)
        tone = 0.5 + 0.5 * sign[:, 0] * sign[:, 1]
        return np.asarray(DARK_TONE + (LIGHT_TONE - DARK_TONE) * tone[:, None], dtype=np.float32)

    def _footprint(self, uv: Floats) -> Floats:
        """(F, 2) the size in u and in v of one pixel of the screen, for each face."""
        screen = self._screen[:, 1:] - self._screen[:, :1]
        edges = uv[:, 1:] - uv[:, :1]
        (a, b), (c, d) = np.moveaxis(screen, 0, 2)
        det = a * d - b * c
        safe = np.where(np.abs(det) > 1e-9, det, np.float32(1e-9))
        across = (d[:, None] * edges[:, 0] - b[:, None] * edges[:, 1]) / safe[:, None]
        along = (-c[:, None] * edges[:, 0] + a[:, None] * edges[:, 1]) / safe[:, None]
        return np.asarray(np.minimum(np.abs(across) + np.abs(along), 1e6), dtype=np.float32)

    def edge_cover(self, pixels: float) -> Floats:
        """(S, 1) how much of a sample the edges of its face cover, drawn `pixels` wide.

        Where faces are small on the screen the lines get thinner, so that they never fill it.
        """
        edges = np.roll(self._screen, -2, axis=1) - np.roll(self._screen, -1, axis=1)
        first, second = edges[:, 0], edges[:, 1]
        double_area = np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])
        height = double_area[:, None] / np.maximum(np.linalg.norm(edges, axis=2), 1e-9)
        nearest = (self.weights * height[self.face]).min(axis=1)
        smallest = np.sqrt(double_area)[self.face]
        width = np.minimum(pixels, 0.14 * smallest)
        soft = 1 / self.samples  # the footprint of a sample
        cover = np.clip(width / 2 + soft / 2 - nearest, 0, np.minimum(width, soft)) / soft
        return np.asarray(cover[:, None], dtype=np.float32)

    def near_lines(self, segments: FloatArray, pixels: float) -> BoolArray:
        """(S,) whether a sample lies on one of the visible `segments` (n, 2, 3), `pixels` wide."""
        height, width = (self.samples * side for side in self.shape)
        marked = np.zeros(height * width, dtype=np.bool_)
        if len(segments) == 0:
            return marked[self.sample]
        depth = np.full(height * width, -np.inf)
        corners = self.scene.mesh.vertices[self.scene.mesh.faces] @ self.camera.axes[2]
        depth[self.sample] = np.einsum("sk,sk->s", self.weights, corners[self.face])
        step = self._pixel_size / self.samples  # a sample's width
        length = np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1)
        count = np.maximum(np.ceil(length / step).astype(np.int64), 1) + 1
        row = np.repeat(np.arange(len(segments)), count)
        place = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        t = (place / (count[row] - 1))[:, None]
        points = segments[row, 0] * (1 - t) + segments[row, 1] * t
        screen = self.camera.screen(points)
        x = np.floor(screen[:, 0] / step + width / 2).astype(np.int64)
        y = np.floor(height / 2 - screen[:, 1] / step).astype(np.int64)
        near = points @ self.camera.axes[2]
        reach = int(np.ceil(pixels * self.samples / 2))
        allowance = 2 * pixels * self._pixel_size
        for dy in range(-reach, reach + 1):
            for dx in range(-reach, reach + 1):
                if dx**2 + dy**2 > (pixels * self.samples / 2) ** 2:
                    continue
                inside = (x + dx >= 0) & (x + dx < width) & (y + dy >= 0) & (y + dy < height)
                cell = ((y + dy) * width + x + dx)[inside]
                marked[cell[np.abs(depth[cell] - near[inside]) < allowance]] = True
        return marked[self.sample]


def _wave_integral(x: Floats) -> Floats:
    """The integral of the square wave that is 1 on [0, 1) and -1 on [1, 2), from 0."""
    return np.asarray(1 - np.abs(np.mod(x, 2) - 1), dtype=np.float32)
