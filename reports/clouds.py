"""The paper's pictures of a learned map, made of points: cloud, uv, checkerboard, seams.

A results folder holds the uv of the vertices and no network: the uv of a point is interpolated in
its face, or, where the face spans a learned seam, that of its nearest corner.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from parapoint.surface import BoolArray, FloatArray, IntArray, Mesh
from reports import render
from reports.render import Floats, Image, View

SPARSE, DENSE = 10_000, 250_000
"""Points of the paper's input, and of its texture mapping."""

GREY = render.linear([0.62, 0.62, 0.62])

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


def images(
    view: View, uv: FloatArray, spanning: BoolArray, colours: Floats, squares: float
) -> Mapping[str, Image]:
    """The pictures by their kind.

    `uv` (F, 3, 2) at the corners, `spanning` (F,), `colours` (F, 3, 3) by normals, `squares` fields
    of the checkerboard to a unit of uv.
    """
    mesh = view.scene.mesh
    sparse, dense = surface_points(mesh, SPARSE), surface_points(mesh, DENSE)
    spacing = float(np.sqrt(mesh.face_areas.sum() / SPARSE))
    seen = view.at_corners(mesh.vertices[mesh.faces])
    distance, nearest = cKDTree(sparse.positions).query(seen, workers=-1)
    dots = distance < DOT * spacing
    tones = sparse.at(colours).astype(np.float32)
    _, densely = cKDTree(dense.positions).query(seen, workers=-1)
    field = np.floor(dense.uv(uv, spanning) * squares).sum(axis=1) % 2 == 0
    checker = np.where(field[:, None], render.LIGHT_TONE, render.DARK_TONE)
    return {
        "cloud": _part(view, dots).image(tones[nearest[dots]], lit=False),
        "cloud-uv": _planar(sparse.uv(uv, spanning), tones, view),
        "dense": view.image(checker[densely].astype(np.float32)),
        "seams": _seams(view, dense.positions[spanning[dense.face]], dots, seen, spacing),
    }


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
        distance, _ = cKDTree(seam).query(seen, workers=-1)
        green = distance < SEAM_DOT * spacing
    kept = dots | green
    colours = np.where(green[kept, None], render.SEAM_GREEN, GREY)
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
    return render.averaged(
        (int(height), int(width)), samples, np.flatnonzero(found), tones[nearest[found]]
    )
