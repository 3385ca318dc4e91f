"""Which place of a surface each texel shows: the charts rasterized, with a rim around them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np
import numpy.typing as npt

from parapoint.files.content import ranges
from parapoint.surfaces.parameterization import Charted
from parapoint.surfaces.surface import BoolArray, FloatArray, IntArray

RIM = 1.4
"""Width, in texels, of the rim around a chart in which texels continue the triangle beside them:
bilinear sampling at the edge of the chart reads texels as far outside as this."""
EXTENDED = 1.5
"""How far from its middle a triangle is continued at most, in barycentric coordinates."""
FLAT = 1e-9
"""Doubled area, in texels, below which a triangle counts as without area."""
CANDIDATES = 2_000_000
"""Pairs of a texel and a triangle that are compared at a time, which bounds the memory to some
200 MB."""


@dataclass(frozen=True, eq=False)
class Texels:
    """The K texels of a square image that show a surface.

    Attributes:
        charted: the mesh and its map, which fills part of the unit square; v runs upwards.
        size: texels along a side of the image.
        places: (K,) row-major index of the texel, first row at the top.
        faces: (K,) the triangle it shows.
        inside: (K,) whether its centre lies in the triangle; the others are the rim.
    """

    charted: Charted
    size: int
    places: IntArray
    faces: npt.NDArray[np.int32]
    inside: BoolArray

    def weights(self, rows: slice) -> FloatArray:
        """(k, 3) barycentric coordinates of some texels' centres in their triangles.

        On the rim some are negative; a sliver is not continued far (EXTENDED).
        """
        places, faces = self.places[rows], self.faces[rows]
        centres = np.stack([places % self.size, self.size - 1 - places // self.size], axis=1) + 0.5
        weights = self._plane.weights(centres, faces)
        from_middle = weights - 1 / 3
        farthest = np.abs(from_middle).max(axis=1, keepdims=True)
        return np.asarray(1 / 3 + from_middle * np.minimum(1, EXTENDED / np.maximum(farthest, 1)))

    @cached_property
    def _plane(self) -> _Triangles:
        return _Triangles.of(self.charted, self.size)


class _Triangles(NamedTuple):
    """Triangles in the plane, in texels.

    Attributes:
        corners: (F, 3, 2).
        gradients: (F, 3, 2) of the barycentric coordinates; 0 of triangles without area.
        flat: (F,) which have no area.
    """

    corners: FloatArray
    gradients: FloatArray
    flat: BoolArray

    @classmethod
    def of(cls, charted: Charted, size: int) -> Self:
        corners = charted.map.uv[charted.map.corners] * size
        edges = np.roll(corners, -2, axis=1) - np.roll(corners, -1, axis=1)  # opposite each corner
        doubled = edges[:, 2, 0] * -edges[:, 1, 1] - edges[:, 2, 1] * -edges[:, 1, 0]
        flat = np.abs(doubled) < FLAT
        gradients = np.stack([-edges[..., 1], edges[..., 0]], axis=2)
        gradients = np.where(flat, 0.0, 1 / np.where(flat, 1.0, doubled))[:, None, None] * gradients
        return cls(corners, gradients, flat)

    def weights(self, at: npt.NDArray[np.floating], faces: npt.NDArray[np.integer]) -> FloatArray:
        """(n, 3) barycentric coordinates of points (n, 2) in these triangles."""
        offset = at - self.corners[faces, 1]
        first = (self.gradients[faces, 0] * offset).sum(axis=1)
        third = (self.gradients[faces, 2] * offset).sum(axis=1)
        return np.stack([first, 1 - first - third, third], axis=1)


def texels(charted: Charted, size: int) -> Texels:
    """The texels of an image of `size` by `size` whose unit square holds the map; v runs upwards.

    Where triangles lie on one another the texel shows the one in which its centre lies deepest.
    Triangles without area in the plane show nowhere.
    """
    plane = _Triangles.of(charted, size)
    low = np.clip(np.floor(plane.corners.min(axis=1) - RIM), 0, size).astype(np.int64)
    high = np.clip(np.ceil(plane.corners.max(axis=1) + RIM), 0, size).astype(np.int64)
    extent = np.where(plane.flat[:, None], 0, high - low)
    steepness = np.linalg.norm(plane.gradients, axis=2)
    depth = np.full(size * size, -RIM, dtype=np.float32)
    face_of = np.full(size * size, -1, dtype=np.int32)
    # The lines of texels across the box of each triangle, some at a time.
    face_of_line = np.repeat(np.arange(len(extent)), extent[:, 1])
    lines = ranges(low[:, 1], extent[:, 1])
    ends = np.cumsum(extent[face_of_line, 0])
    begin = 0
    while begin < len(lines):
        before = ends[begin - 1] if begin else 0
        end = max(begin + 1, int(np.searchsorted(ends, before + CANDIDATES, side="right")))
        of_line = face_of_line[begin:end]
        run = extent[of_line, 0]
        face, line = np.repeat(of_line, run), np.repeat(lines[begin:end], run)
        column = ranges(low[of_line, 0], run)
        weights = plane.weights(np.stack([column, line], axis=1) + 0.5, face)
        # Distance to the nearest side, in texels; negative outside.
        near = (weights / steepness[face]).min(axis=1).astype(np.float32)
        place = (size - 1 - line) * size + column
        better = np.flatnonzero(near > depth[place])
        better = better[np.argsort(near[better], kind="stable")]  # of one texel the last one stays
        depth[place[better]], face_of[place[better]] = near[better], face[better]
        begin = end
    places = np.flatnonzero(face_of >= 0)
    return Texels(charted, size, places, face_of[places], depth[places] >= 0)
