"""Coloured clouds as textured meshes: our bake, and the one that is usual today."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import igl
import numpy as np
from scipy.spatial import cKDTree

from baselines.meshed import Meshed, carried
from parapoint.computed.computed_map import ComputedMap
from parapoint.files.attributes import unit_colours
from parapoint.method import UnsupportedError
from parapoint.surfaces.parameterization import Charted, PointParameterization
from parapoint.surfaces.surface import BoolArray, FloatArray, PointCloud, Surface
from parapoint.textures.baking import Pixels, baked
from parapoint.textures.packing import packed
from parapoint.textures.texels import texels

HELD_OUT = 0.2
"""Share of the points that no texture is baked from, and that test it."""

GAP = 2
"""Texels between the charts of a texture, and around them: bilinear reading needs one."""
LEAST_ERROR = 1e-10
"""Mean squared error of colours from 0 to 1 that counts as none: 100 dB."""
STREAM = 20240317
"""Any number; it keeps the draw of the points held out apart from all others."""


@dataclass(frozen=True)
class Textured:
    """A coloured cloud as a textured mesh, tested by the colours of points that it has not seen.

    A cloud without colours is painted with its coordinates.

    A share of the points is held out (HELD_OUT, drawn by the seed). Of the others a mesh with a map
    is made, and a texture is baked. The points held out are projected onto the mesh and read their
    colours from the texture, bilinearly; the report has the peak signal-to-noise ratio.

    Attributes:
        pipeline: "computed" is what `parapoint unwrap` does with a cloud: the computed map, and
            moving least squares at each texel. The others are today's way: the mesh that MeshLab
            reconstructs, xatlas's atlas of it, the colour of the nearest point at each texel.
        texels: along a side of the texture.
    """

    pipeline: Literal["computed", "poisson", "ball_pivoting"] = "computed"
    texels: int = 2048

    requires: ClassVar[frozenset[str]] = frozenset({"points"})
    packages: ClassVar[tuple[str, ...]] = ("pymeshlab", "libigl", "xatlas", "scipy", "shapely")

    def parameterize(self, surface: Surface, *, seed: int) -> PointParameterization:
        """The map of the mesh, at all points of the cloud.

        Raises:
            UnsupportedError: the surface is a mesh; pymeshlab is not installed.
            FlatteningError, ReconstructionError: no mesh or no map could be made.
        """
        if not isinstance(surface, PointCloud):
            raise UnsupportedError("takes a point cloud; the surface is a mesh")
        colours = surface.attributes.get("colours", _places(surface.points))[:, :3]
        is_seen = seen_points(len(surface.points), seed)
        normals = None if surface.normals is None else surface.normals[is_seen]
        seen = PointCloud(
            surface.points[is_seen], normals, attributes={"colours": colours[is_seen]}
        )
        if self.pipeline == "computed":
            made = ComputedMap().charted(seen, seed=seed)
        else:
            meshed = Meshed(reconstruction=self.pipeline, flattening="xatlas")
            made = meshed.charted(seen, seed=seed)
        charted = packed(made, GAP / self.texels)
        begun = time.process_time()
        if self.pipeline == "computed":
            texture = baked(charted, seen, "colour", self.texels).pixels
        else:
            texture = nearest_baked(charted, seen, self.texels)
        seconds = time.process_time() - begun
        read = looked_up(charted, texture, surface.points[~is_seen])
        wrong = read - unit_colours(colours[~is_seen])
        uv, _ = carried(surface.points, charted.mesh, charted.map)
        report: dict[str, object] = {
            "bake_psnr": -10 * float(np.log10(max((wrong**2).mean(), LEAST_ERROR))),
            "bake_cpu_seconds": seconds,
            "held_out": int((~is_seen).sum()),
            "charts": int(charted.map.charts().max()) + 1,
        }
        return PointParameterization(uv, report=report)


def _places(points: FloatArray) -> FloatArray:
    """(N, 3) the places of points in their bounding cube, from 0 to 1."""
    low = points.min(axis=0)
    return np.asarray((points - low) / max(float((points - low).max()), 1e-300))


def seen_points(count: int, seed: int) -> BoolArray:
    """(count,) which points a texture is baked from.

    The draw has a stream of its own: with that of the cloud's own sampling whole regions of its
    surface were held out.
    """
    return np.asarray(np.random.default_rng((STREAM, seed)).random(count) > HELD_OUT)


def nearest_baked(charted: Charted, cloud: PointCloud, size: int) -> Pixels:
    """(size, size, 3) a texture in which each texel has the colour of the nearest point."""
    shown = texels(charted, size)
    corners = charted.mesh.vertices[charted.mesh.faces[shown.faces]]
    places = np.einsum("nc,ncd->nd", shown.weights(slice(None)), corners)
    colours = np.rint(255 * unit_colours(cloud.attributes["colours"])).astype(np.uint8)
    pixels = np.zeros((size * size, 3), dtype=np.uint8)
    pixels[shown.places] = colours[cKDTree(cloud.points).query(places)[1]]
    return pixels.reshape(size, size, 3)


def looked_up(charted: Charted, texture: Pixels, points: FloatArray) -> FloatArray:
    """(N, 3) colours of the texture, interpolated where the mesh is nearest to each point."""
    mesh, held = charted
    _, face, place = igl.point_mesh_squared_distance(points, mesh.vertices, mesh.faces)
    corners = [np.ascontiguousarray(mesh.vertices[mesh.faces[face, k]]) for k in range(3)]
    share = np.nan_to_num(igl.barycentric_coordinates(np.ascontiguousarray(place), *corners))
    uv = np.einsum("nc,ncd->nd", share, held.uv[held.corners[face]])
    size = len(texture)
    at = np.stack([(1 - uv[:, 1]) * size, uv[:, 0] * size], axis=1) - 0.5
    low = np.floor(at).astype(np.int64)
    part = (at - low)[:, :, None]
    total: Any = 0.0
    for line in (0, 1):
        for column in (0, 1):
            weight = np.abs(1 - line - part[:, 0]) * np.abs(1 - column - part[:, 1])
            row, place_in_row = np.clip(low + np.array([line, column]), 0, size - 1).T
            total = total + weight * texture[row, place_in_row]
    return np.asarray(total / 255)
