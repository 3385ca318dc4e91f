"""Which place of a surface each texel shows: the charts rasterized, with a rim around them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from parapoint.files.mesh_formats import ranges
from parapoint.surfaces.parameterization import Charted
from parapoint.surfaces.surface import BoolArray, FloatArray, IntArray

RIM = 1.5
"""Texels around a chart that continue the triangle beside them: bilinear sampling at the chart's
edge reads texels up to so far outside of it."""
EXTENDED = 1.0
"""How far a triangle is continued at most, in its own barycentric coordinates."""
CANDIDATES = 2_000_000
"""Pairs of a texel and a triangle that are compared at a time, which bounds the memory to some
200 MB."""


class Texels(NamedTuple):
    """The K texels of a square image that show a surface.

    Attributes:
        size: texels along a side of the image.
        places: (K,) row-major index of the texel, first row at the top.
        faces: (K,) the triangle it shows.
        weights: (K, 3) barycentric coordinates of its centre in that triangle; on the rim some are
            negative.
        inside: (K,) whether the centre lies in the triangle; the others are the rim.
    """

    size: int
    places: IntArray
    faces: IntArray
    weights: FloatArray
    inside: BoolArray

    def interpolated(self, corner_values: FloatArray) -> FloatArray:
        """(K, k) values at the texels of values (F, 3, k) at the corners of the triangles."""
        return np.asarray(np.einsum("nc,nck->nk", self.weights, corner_values[self.faces]))


def texels(charted: Charted, size: int) -> Texels:
    """The texels of an image of `size` by `size` whose unit square holds the map; v runs upwards.

    Where triangles lie on one another the texel shows the one in which its centre lies deepest.
    Triangles without area in the plane show nowhere.
    """
    uv = charted.map.uv * size
    triangles = uv[charted.map.corners]  # (F, 3, 2) in texels
    low = np.clip(np.floor(triangles.min(axis=1) - RIM), 0, size).astype(np.int64)
    high = np.clip(np.ceil(triangles.max(axis=1) + RIM), 0, size).astype(np.int64)
    extent = np.maximum(high - low, 0)
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    doubled = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    flat = np.abs(doubled) < 1e-12 * size
    count = np.where(flat, 0, extent.prod(axis=1))
    # One triangle's gradients of the barycentric coordinates, (F, 3, 2).
    edges = np.stack([c - b, a - c, b - a], axis=1)
    gradients = np.stack([-edges[..., 1], edges[..., 0]], axis=2)
    gradients /= np.where(flat, 1.0, doubled)[:, None, None]
    steepness = np.linalg.norm(gradients, axis=2)

    depth = np.full(size * size, -RIM, dtype=np.float32)
    face_of = np.full(size * size, -1, dtype=np.int64)
    ends = np.cumsum(count)
    begin = 0
    while begin < len(count):
        before = ends[begin - 1] if begin else 0
        end = max(begin + 1, int(np.searchsorted(ends, before + CANDIDATES, side="right")))
        some = np.arange(begin, end)
        begin = end
        face = np.repeat(some, count[some])
        at = ranges(np.zeros(len(some), dtype=np.int64), count[some])
        column = low[face, 0] + at % np.maximum(extent[face, 0], 1)
        line = low[face, 1] + at // np.maximum(extent[face, 0], 1)
        weights = _weights(np.stack([column, line], axis=1) + 0.5, b, face, gradients)
        # Distance to the nearest side, in texels; negative outside.
        near = (weights / steepness[face]).min(axis=1).astype(np.float32)
        place = (size - 1 - line) * size + column
        better = np.flatnonzero(near > depth[place])
        better = better[np.argsort(near[better], kind="stable")]  # of one texel the last one stays
        depth[place[better]], face_of[place[better]] = near[better], face[better]
    places = np.flatnonzero(face_of >= 0)
    faces = face_of[places]
    centres = np.stack([places % size, size - 1 - places // size], axis=1) + 0.5
    weights = _weights(centres, b, faces, gradients)
    weights = np.clip(weights, -EXTENDED, 1 + EXTENDED)
    weights /= weights.sum(axis=1, keepdims=True)
    return Texels(size, places, faces, weights, depth[places] >= 0)


def _weights(at: FloatArray, second: FloatArray, face: IntArray, gradients: FloatArray) -> FloatArray:
    """(n, 3) barycentric coordinates of places (n, 2) in their triangles."""
    offset = at - second[face]
    first = (gradients[face, 0] * offset).sum(axis=1)
    third = (gradients[face, 2] * offset).sum(axis=1)
    return np.stack([first, 1 - first - third, third], axis=1)
