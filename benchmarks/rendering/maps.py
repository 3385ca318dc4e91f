"""A map of a mesh as it is drawn: on the surface and in the plane, in checks or by distortion."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from matplotlib import colormaps

from benchmarks.metrics.distortion import FaceDistortion
from benchmarks.metrics.seams import spanning_edges
from benchmarks.metrics.state import MapState
from benchmarks.rendering.camera import Camera, camera
from benchmarks.rendering.colours import CLAY, FLIP_ORANGE, INK, SEAM_GREEN, Floats, Image, linear
from benchmarks.rendering.scene import Scene, View
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import BoolArray, FloatArray, Mesh, edge_table

SAMPLES = 2
"""Samples along a pixel: each is the mean of four."""

FIELDS = 44
"""Fields of the checkerboard along the diagonal of a model's bounding box."""

SPANNING_TONE = linear([0.90, 0.91, 0.90])

LEFT_OUT_TONE = linear([0.80, 0.80, 0.80])
"""Of faces that a map leaves out, and of what is not defined on a scale."""

ANGLE_SCALE, AREA_SCALE = ("magma_r", 0.0, 2.0), ("PuOr_r", -3.0, 3.0)
"""Colour map and range of log2(sigma1 / sigma2), and of log2(UV area / 3D area)."""


@dataclass(frozen=True, eq=False)
class Map:
    """A parameterization of a mesh, ready to be drawn.

    Faces that it leaves out (NaN) are drawn in one tone on the surface, and nowhere in the plane.

    Attributes:
        mesh: the surface.
        parameterization: its map.
    """

    mesh: Mesh
    parameterization: Parameterization

    @cached_property
    def _state(self) -> MapState:
        return MapState(self.mesh, self.parameterization)

    @cached_property
    def covered(self) -> BoolArray:
        """(F,) faces that the map does not leave out. `_state` knows these alone."""
        return self.parameterization.covered

    def _spread(self, values: FloatArray | BoolArray, rest: float) -> np.ndarray:
        """(F,) `values` of the `covered` faces, and `rest` for the others."""
        full = np.full(len(self.covered), rest, dtype=values.dtype)
        full[self.covered] = values
        return full

    @property
    def has_area(self) -> bool:
        """Whether any face has an area in the plane: else there is nothing to see."""
        return bool((self._state.triangles.uv_area != 0).any())

    @cached_property
    def spanning(self) -> BoolArray:
        """(F,) faces that span a learned seam; without a spanning edge there are none.

        Most maps have none: their overlaps, a fourth of the time of their pictures, are not needed.
        """
        of = self if self.covered.all() else self._state
        if spanning_edges(of.mesh, of.parameterization).any():
            return self._spread(self._state.spanning, False)
        return np.zeros(len(self.covered), dtype=np.bool_)

    @cached_property
    def flipped(self) -> BoolArray:
        """(F,) faces turned against the majority of their chart; spanning faces are not counted."""
        return self._spread(self._state.validity.flipped, False) & ~self.spanning

    @property
    def distortion(self) -> FaceDistortion:
        """Of the faces that do not span a seam."""
        state = self._state
        return state.distortion_without_spanning if self.spanning.any() else state.distortion

    @cached_property
    def uv(self) -> FloatArray:
        """(F, 3, 2) uv of the corners: area as on the surface, upright, seen from outside.

        A face that the map leaves out lies at one point in the middle.
        """
        uv = self.parameterization.uv[self.parameterization.corners]
        signed = self._spread(self._state.triangles.uv_area, 0.0)
        kept = self.covered & ~self.spanning
        kept = kept if (kept & (signed != 0)).any() else signed != 0
        area = float(np.abs(signed[kept]).sum())
        scale = np.sqrt(self.mesh.face_areas[kept].sum() / area) if area > 0 else 1.0
        known = uv[self.covered]
        middle = (known.min(axis=(0, 1)) + known.max(axis=(0, 1))) / 2
        uv = (uv - middle) * scale
        uv[~self.covered] = 0
        if signed[kept].sum() < 0:
            uv = uv * [-1, 1]
        if len(np.unique(self.parameterization.charts()[self.covered])) == 1:
            points = uv[kept].reshape(-1, 2)
            _, axes = np.linalg.eigh(np.cov(points.T))
            up = axes[:, 1] * (1 if axes[1, 1] >= 0 else -1)
            uv = uv @ np.array([[up[1], up[0]], [-up[0], up[1]]])
        return np.asarray(uv, dtype=np.float64)

    @cached_property
    def seams(self) -> FloatArray:
        """(S, 2, 3) the edges of the surface along which the map is cut.

        Those along which the vertices of the mesh itself are doubled are among them.
        """
        of = self if self.covered.all() and not self._state.welded else self._state
        return np.asarray(of.mesh.vertices[of.parameterization.seams(of.mesh)])

    def by_face(self, values: FloatArray) -> FloatArray:
        """(F,) `values` of the faces in `distortion`, NaN for the others."""
        full = np.full(np.count_nonzero(self.covered), np.nan)
        full[self.distortion.faces] = values
        return self._spread(full, np.nan)

    @cached_property
    def angle(self) -> FloatArray:
        """(F,) log2(sigma1 / sigma2), 0 where angles are kept; NaN where it is not defined."""
        found = self.distortion
        ratio = np.full(len(found.faces), np.inf)
        ratio[found.finite] = found.sigma1[found.finite] / found.sigma2[found.finite]
        return self.by_face(np.log2(ratio))

    @cached_property
    def area(self) -> FloatArray:
        """(F,) log2(UV area / 3D area), both with sum 1; NaN where it is not defined."""
        found = self.distortion
        ratio = np.where(found.finite, found.uv_area / found.area, 1.0)
        return self.by_face(np.where(found.finite & (ratio > 0), np.log2(ratio), -np.inf))


def heat(values: FloatArray, scale: tuple[str, float, float]) -> Floats:
    """(F, 3) linear colours of `values` on a scale; grey for NaN."""
    name, low, high = scale
    known = ~np.isnan(values)
    place = np.clip((np.where(known, values, low) - low) / (high - low), 0, 1)
    colours = colormaps[name](place)[:, :3]
    return np.where(known[:, None], linear(colours), LEFT_OUT_TONE)


def textured(view: View, found: Map) -> Image:
    """The checkerboard on the surface; flips in orange, seams and faces that span one in green."""
    colours = view.checker(found.uv - found.uv.min(axis=(0, 1)), FIELDS / view.scene.size)
    colours = _mixed(colours, FLIP_ORANGE, found.flipped[view.face], 0.75)
    colours = _mixed(colours, SEAM_GREEN, found.spanning[view.face], 0.8)
    colours = _mixed(colours, LEFT_OUT_TONE, ~found.covered[view.face], 1.0)
    return view.image(_mixed(colours, SEAM_GREEN, view.near_lines(found.seams, 2.6), 1.0))


def _mixed(colours: Floats, colour: Floats, where: BoolArray, share: float) -> Floats:
    """`colours` (S, 3) with `share` of `colour` where said."""
    mixed = colours.copy()
    mixed[where] = (1 - share) * colours[where] + share * colour
    return mixed


def meshed(view: View) -> Image:
    """The bare surface with the edges of its mesh."""
    cover = view.edge_cover(1.1)
    return view.image(np.asarray(CLAY * (1 - cover) + INK * cover, np.float32))


class Layout:
    """The map in the plane. Faces that span a seam lie below the others, pale."""

    def __init__(self, found: Map, size: int) -> None:
        """The layout of `found`, its longer side of `size` pixels."""
        low = 1e-3 * float(np.ptp(found.uv, axis=(0, 1)).max() or 1)
        height = np.where(found.spanning, -low, np.where(found.flipped, low, 0.0))
        corners = np.concatenate(
            [found.uv, np.broadcast_to(height[:, None, None], (len(height), 3, 1))], axis=2
        )
        flat = Mesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
        above = camera(flat, np.eye(3)[2], np.eye(3)[1])
        self._map = found
        self._view = Scene(flat, shadows=False).view(above, size, SAMPLES)
        self._outline = self._view.near_lines(_outline(found), 1.6)

    def image(self, colours: Floats) -> Image:
        """The layout under `colours` (F, 3) of faces or (F, 3, 3) of corners, charts outlined."""
        view, found = self._view, self._map
        at = colours[view.face] if colours.ndim == 2 else view.at_corners(colours)
        at = np.where(found.spanning[view.face, None], SPANNING_TONE, at).astype(np.float32)
        return view.image(_mixed(at, INK, self._outline, 1.0), lit=False)


def _outline(found: Map) -> FloatArray:
    """(n, 2, 3) the edges around the charts, at the height of `Layout`."""
    kept = found.covered & ~found.spanning
    _, edge, count = edge_table(found.parameterization.corners[kept])
    uv = found.uv[kept]
    ends = np.stack([uv, np.roll(uv, -1, axis=1)], axis=2).reshape(-1, 2, 2)[count[edge] == 1]
    return np.concatenate([ends, np.zeros((len(ends), 2, 1))], axis=2)


def normal_colours(scene: Scene, camera: Camera) -> Floats:
    """(F, 3, 3) colours of the corners by their normals as the camera sees them, shaded.

    Seen in the plane they tell which part of the surface lies where.
    """
    axes = camera.axes.astype(np.float32)
    normals = scene.corner_normals @ axes.T
    sky = scene.coarse_openness[scene.mesh.faces, :1]
    colours = (0.5 + 0.42 * normals) * (0.30 + 0.70 * sky)
    return linear(np.clip(colours, 0, 1))
