"""A surface kept as an image of its points, and how near the surface read back is."""

from __future__ import annotations

import igl
import numpy as np

from parapoint.planar.domains import Domain
from parapoint.surfaces.surface import FloatArray

LEAST_NOISE = 1e-12
"""Distance, in diagonals, that counts for surfaces that are the same up to rounding: 240 dB."""


def image(disk: Domain, uv: FloatArray, side: int) -> FloatArray:
    """(side, side, 3) the surface at a grid of points in the unit square, by linear interpolation.

    Args:
        disk: the surface.
        uv: (V, 2) its map to the square.
        side: pixels on a side; the outer ones lie on the square's sides.
    """
    steps = np.linspace(0, 1, side)
    grid = np.stack(np.meshgrid(steps, steps, [0.0]), axis=-1).reshape(-1, 3)
    flat = np.pad(uv, ((0, 0), (0, 1)))
    _, face, place = igl.point_mesh_squared_distance(grid, flat, disk.faces)
    corners = [np.ascontiguousarray(flat[disk.faces[face, k]]) for k in range(3)]
    share = np.nan_to_num(igl.barycentric_coordinates(np.ascontiguousarray(place), *corners))
    points = (share[:, :, None] * disk.vertices[disk.faces[face]]).sum(axis=1)
    return np.asarray(points.reshape(side, side, 3))


def psnr(disk: Domain, points: FloatArray) -> float:
    """Peak signal-to-noise ratio, in decibels, of the surface that an image is read back to.

    20 log10(diagonal of the box / root mean square distance): of the vertices from the image's
    surface or of the pixels from the vertices' one, whichever is greater.

    Args:
        disk: the surface.
        points: (side, side, 3) the image.
    """
    side = len(points)
    a = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).reshape(-1, 1)
    faces = np.concatenate([a + np.array(of) for of in ([0, 1, side + 1], [0, side + 1, side])])
    pixels = np.ascontiguousarray(points.reshape(-1, 3))
    there = igl.point_mesh_squared_distance(disk.vertices, pixels, faces)[0].mean()
    back = igl.point_mesh_squared_distance(pixels, disk.vertices, disk.faces)[0].mean()
    diagonal = np.linalg.norm(np.ptp(disk.vertices, axis=0))
    noise = max(np.sqrt(max(there, back)) / diagonal, LEAST_NOISE)
    return float(-20 * np.log10(noise))
