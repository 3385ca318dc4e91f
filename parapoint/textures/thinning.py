"""A cloud thinned while it is read: no denser than a texture can show, however many points come."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from parapoint.errors import InputError
from parapoint.files.attributes import colours_of
from parapoint.surfaces.areas import signed_areas
from parapoint.surfaces.parameterization import Charted
from parapoint.surfaces.surface import FloatArray, IntArray, PointCloud
from parapoint.textures.known import SHOWN, check_bakeable, has_value, warn_of_unknown

CUBES_OF_A_TEXEL = 2
"""Cubes along a texel's side at least. Of the points in a cube the first one stays, so that a texel
keeps four or more."""
CELLS = 64
"""Cells along the longest side of the model's box, in each of which all cubes are of one size."""
LEVELS = 8
"""Sizes of cubes, each twice as large as the one before."""
MOST_CUBES = 2**20
"""Cubes along a side of the space around the model: three such numbers and a level fit 63 bits."""


def thinned(
    pieces: Iterable[PointCloud], kind: str, charted: Charted, size: int
) -> tuple[PointCloud, int]:
    """The points that a texture can show, with what it shows of them, and how many there were.

    The result is the same however the cloud is divided into pieces.

    Args:
        pieces: parts of a cloud, in order.
        kind: what is baked, one of MAPS.
        charted: the mesh that the texture is for, and its map in the unit square.
        size: texels along a side of the texture.

    Raises:
        InputError: there are no points, or they have not what the map shows.
    """
    cubes = _Cubes(charted, size)
    kept: list[PointCloud] = []
    taken: IntArray = np.zeros(0, dtype=np.int64)
    kinds: set[np.dtype[Any]] = set()
    count, unknown, has_shown = 0, 0, kind not in SHOWN
    for piece in pieces:
        check_bakeable(piece, kind)
        count += len(piece.points)
        known = np.flatnonzero(has_value(piece, kind))
        if kind in SHOWN:
            values = piece.attributes[SHOWN[kind]]
            kinds.add(values.dtype)
            alike = values[known, :3] if kind == "colour" else values[known]  # alpha shows nothing
            has_shown |= bool(alike.any())
        numbers, first = np.unique(cubes.of(piece.points[known]), return_index=True)
        fresh = np.append(taken, -1)[np.searchsorted(taken, numbers)] != numbers
        if fresh.any():
            taken = np.sort(np.concatenate([taken, numbers[fresh]]), kind="stable")  # merges two
            kept.append(_rows(piece, known[np.sort(first[fresh])], kind))
        unknown += len(piece.points) - len(known)
    if count == 0:
        raise InputError("has no point with finite coordinates")
    warn_of_unknown(unknown, count, kind)
    if not has_shown:
        fault = (
            "all of its points are black" if kind == "colour" else "it is 0 at all of its points"
        )
        raise InputError(f"has no {SHOWN[kind]} to bake: {fault}")
    return _joined(kept, kind, kinds), count


class _Cubes:
    """Cubes as large as half a texel at most, at each place of a surface and around it.

    Their sides are powers of two, from the finest that the map asks for on to one 2 to the power of
    LEVELS - 1 times as large.
    """

    def __init__(self, charted: Charted, size: int) -> None:
        mesh = charted.mesh
        corners = mesh.vertices[mesh.faces]
        low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
        self.extent = max(float((high - low).max()), 1e-300)
        self.low = low - self.extent  # the space around has three times the model's side
        image = np.abs(signed_areas(charted.map.uv, charted.map.corners))
        shown = (image > 0) & (mesh.face_areas > 0)
        texel = np.sqrt(mesh.face_areas[shown] / image[shown]) / size
        level = np.floor(np.log2(texel / CUBES_OF_A_TEXEL))
        least = np.ceil(np.log2(3 * self.extent / MOST_CUBES))
        # A few slivers that are shown very large decide nothing.
        self.finest = max(
            float(level.min()), np.floor(float(np.median(level))) - LEVELS // 2, least
        )
        places = np.concatenate([corners[shown].mean(axis=1), *corners[shown].transpose(1, 0, 2)])
        cell = tuple(self._cell(places).T)
        grid = np.full((CELLS,) * 3, np.inf)
        np.minimum.at(grid, cell, np.tile(level, 4))
        # A cell without a corner of a face goes by the nearest that has one.
        nearest = ndimage.distance_transform_edt(
            np.isinf(grid), return_distances=False, return_indices=True
        )
        self.level = np.clip(grid[tuple(nearest)] - self.finest, 0, LEVELS - 1).astype(np.int64)

    def of(self, points: FloatArray) -> IntArray:
        """(N,) the number of each point's cube; points far from the model share the outermost."""
        level = self.level[tuple(self._cell(points).T)]
        side = np.exp2(self.finest + level)
        with np.errstate(over="ignore"):
            place = (points - self.low) / side[:, None]
        cube = np.clip(np.floor(place), 0, MOST_CUBES - 1).astype(np.int64)
        return np.asarray(cube @ (MOST_CUBES ** np.arange(3)) + MOST_CUBES**3 * level)

    def _cell(self, points: FloatArray) -> IntArray:
        """(N, 3) the cell of each point, or the nearest one."""
        with np.errstate(over="ignore"):
            place = (points - self.low - self.extent) * (CELLS / self.extent)
        return np.asarray(np.clip(np.floor(place), 0, CELLS - 1).astype(np.int64))


def _rows(cloud: PointCloud, rows: IntArray, kind: str) -> PointCloud:
    """Some points of a cloud, with what a map shows of them."""
    normals = cloud.normals[rows] if kind == "normal" and cloud.normals is not None else None
    shown = {name: of[rows] for name, of in cloud.attributes.items() if name == SHOWN.get(kind)}
    return PointCloud(cloud.points[rows], normals, attributes=shown)


def _joined(parts: list[PointCloud], kind: str, kinds: set[np.dtype[Any]]) -> PointCloud:
    """One cloud of all parts.

    Args:
        parts: what was kept of each piece.
        kind: what is baked.
        kinds: the types of what is shown in all pieces, also where none of it was kept.

    Raises:
        InputError: some colours are fractions from 0 to 1, and others greater and not whole.
    """
    points = np.concatenate([part.points for part in parts])
    normals = [part.normals for part in parts if part.normals is not None]
    shown: dict[str, npt.NDArray[Any]] = {}
    if (name := SHOWN.get(kind)) is not None:
        shown[name] = np.concatenate([part.attributes[name] for part in parts])
        whole = [one for one in kinds if one.kind == "u"]
        if kind == "colour" and whole:
            # Pieces with small numbers alone pass for 8 bits, or for fractions.
            if shown[name].dtype.kind == "f" and colours_of(shown[name]) is None:
                raise InputError("has no colours to bake: some are fractions, others are not")
            shown[name] = shown[name].astype(max(whole, key=lambda one: one.itemsize))
    return PointCloud(points, np.concatenate(normals) if normals else None, attributes=shown)
