"""A picture of a textured mesh: the surface from two sides, beside the layout of its map."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from parapoint.files.png import png
from parapoint.files.targets import complete_file, sealed_png
from parapoint.surfaces.parameterization import Charted
from parapoint.surfaces.sides import parted
from parapoint.surfaces.surface import FloatArray, IntArray, Mesh, vertex_normals
from parapoint.textures.texels import texels

SIDE = 512
"""Pixels along a side of each of the three pictures."""
SAMPLES = 2_000_000
"""Points that are drawn on the surface: some ten a pixel, so that one in thousands is missed."""
DIRECTION = (0.45, -0.75, 0.48)
"""From where the surface is seen, and, from the opposite side, seen again."""
R2 = (0.7548776662466927, 0.5698402909980532)
"""1 / g and 1 / g² with g³ = g + 1."""
AMBIENT = 0.35
"""Share of the light that comes from all sides."""
BEHIND = 4.0
"""How far points that face away are put back, in pixels, so that the side of a sheet that faces the
viewer hides the other one, which lies in the same place."""
PAPER = 255
AROUND = np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]], dtype=bool)
"""The eight pixels around one."""

Picture = npt.NDArray[np.uint8]


def write_preview(path: Path, charted: Charted, texture: Picture, *, is_y_up: bool = False) -> None:
    """Write the picture as PNG; see `preview`.

    Raises:
        OSError: the file cannot be written; nothing is left behind.
    """
    with complete_file(path) as file:
        file.write(sealed_png(png(preview(charted, texture, is_y_up=is_y_up))))


def preview(charted: Charted, texture: Picture, *, is_y_up: bool = False) -> Picture:
    """(SIDE, 3 SIDE, 3) the surface from two opposite sides, and the layout in its texture.

    Args:
        charted: the mesh, and its map in the unit square.
        texture: (N, N, 3) pixels, first row at the top.
        is_y_up: whether the y axis points upwards, and not z.
    """
    mesh, held = parted(charted.mesh), charted.map
    face, weights = _evenly_spread(mesh)
    points, normals, uv = (
        np.einsum("nc,ncd->nd", weights, values[rows[face]])
        for values, rows in (
            (mesh.vertices, mesh.faces),
            (vertex_normals(mesh), mesh.faces),
            (held.uv, held.corners),
        )
    )
    if is_y_up:
        points, normals = (of[:, [0, 2, 1]] * [1.0, -1.0, 1.0] for of in (points, normals))
    colours = _looked_up(texture, uv)
    sides = [_seen(points, normals, colours, np.array(DIRECTION) * side) for side in (1, -1)]
    return np.concatenate([*sides, _layout(charted, texture)], axis=1)


def _evenly_spread(mesh: Mesh) -> tuple[IntArray, FloatArray]:
    """(n,) faces and (n, 3) barycentric coordinates of SAMPLES points spread evenly by area.

    Each face gets its share to within one; inside of it the points follow the sequence R2 of
    Roberts (2018), which leaves no gaps as random ones do.
    """
    areas = np.cumsum(mesh.face_areas)
    step = np.arange(SAMPLES)
    face = np.searchsorted(areas, (step + 0.5) / SAMPLES * areas[-1])
    root, along = np.sqrt(step * R2[0] % 1), step * R2[1] % 1
    return face, np.stack([1 - root, root * (1 - along), root * along], axis=1)


def _looked_up(texture: Picture, uv: FloatArray) -> Picture:
    """(n, 3) the texels in which points (n, 2) of the unit square lie."""
    height, width = texture.shape[:2]
    column = np.clip((uv[:, 0] * width).astype(np.int64), 0, width - 1)
    line = np.clip(((1 - uv[:, 1]) * height).astype(np.int64), 0, height - 1)
    return np.asarray(texture[line, column])


def _seen(points: FloatArray, normals: FloatArray, colours: Picture, side: FloatArray) -> Picture:
    """(SIDE, SIDE, 3) the points seen from one side, shaded, the nearest in front.

    Of two sides of a sheet that is one that faces there.
    """
    towards = side / np.linalg.norm(side)
    right = np.cross([0.0, 0.0, 1.0], towards)
    right /= np.linalg.norm(right)
    placed = points @ np.stack([right, np.cross(towards, right), towards]).T
    low, high = placed.min(axis=0), placed.max(axis=0)
    extent = max(float((high - low)[:2].max()), 1e-300)
    at = 0.5 + 0.92 * (placed - (low + high) / 2)[:, :2] / extent
    column, line = (SIDE * at[:, 0]).astype(np.int64), (SIDE * (1 - at[:, 1])).astype(np.int64)
    facing = normals @ towards
    light = AMBIENT + (1 - AMBIENT) * np.abs(facing)
    placed[:, 2] -= np.where(facing < 0, BEHIND / SIDE * extent, 0)
    order = np.argsort(placed[:, 2], kind="stable")  # of one pixel the last one, the nearest, stays
    line, column = line[order], column[order]
    picture = np.full((SIDE, SIDE, 3), PAPER, dtype=np.uint8)
    picture[line, column] = (colours * light[:, None])[order]
    depth = np.full((SIDE, SIDE), -np.inf)
    depth[line, column] = placed[order, 2]
    # Where no point was drawn on what is in front, a single pixel lies behind all around it.
    missed = depth < ndimage.minimum_filter(depth, footprint=AROUND)
    picture[missed] = np.roll(picture, 1, axis=1)[missed]
    return picture


def _layout(charted: Charted, texture: Picture) -> Picture:
    """(SIDE, SIDE, 3) the charts with their texture, on white."""
    shown = texels(charted, SIDE)
    places = shown.places[shown.inside]
    line, column = np.divmod(places, SIDE)
    layout = np.full((SIDE * SIDE, 3), PAPER, dtype=np.uint8)
    uv = np.stack([column + 0.5, SIDE - line - 0.5], axis=1) / SIDE
    layout[places] = _looked_up(texture, uv)
    return layout.reshape(SIDE, SIDE, 3)
