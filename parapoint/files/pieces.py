"""The points of a file a piece at a time, for clouds that are larger than the memory."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from parapoint.errors import InputError
from parapoint.files.clouds.las import las_pieces
from parapoint.files.content import Content
from parapoint.files.meshes.ply import ply_pieces
from parapoint.files.reading import (
    check_fits_together,
    faults_of,
    read_surface,
    unreadable,
    warn_of_dropped,
)
from parapoint.surfaces.normals import known_or_zero
from parapoint.surfaces.surface import BoolArray, Mesh, PointCloud

PIECE = 1_000_000
"""Points that are read at a time; they take 50 to 100 MB."""
SPLIT: dict[str, Callable[[Path, int], Iterator[Content] | None]] = {
    ".ply": ply_pieces,
    ".las": las_pieces,
    ".laz": las_pieces,
}
"""How files of an ending are read in pieces; those of other endings are read whole."""


def point_pieces(path: str | Path) -> Iterator[PointCloud]:
    """The finite points of a file in its order, PIECE at a time where its kind allows that.

    Colours and other attributes may be of a narrower type in one piece than in another; the values
    are the same.

    Raises:
        InputError: as for `read_surface`; the file holds a mesh.
    """
    path = Path(path)
    with faults_of(path), unreadable(path):
        split = SPLIT.get(path.suffix.lower()) if path.is_file() else None
        contents = None if split is None else split(path, PIECE)
        count = dropped = 0
        for content in contents or ():
            check_fits_together(content)
            is_finite: BoolArray = np.asarray(np.isfinite(content.vertices).all(axis=1))
            count, dropped = count + len(is_finite), dropped + int((~is_finite).sum())
            if is_finite.any():
                yield _chosen(content, is_finite)
        if dropped:
            warn_of_dropped(path, dropped, count)
    if contents is None:
        surface = read_surface(path)
        if isinstance(surface, Mesh):
            raise InputError(f"{path}: is a mesh; a cloud of points is baked")
        yield surface


def _chosen(content: Content, rows: BoolArray) -> PointCloud:
    """Some points, with their normals, 0 where these are not finite."""
    normals = None if content.normals is None else content.normals[rows]
    known = None if normals is None else known_or_zero(normals)
    attributes = {name: values[rows] for name, values in content.attributes.items()}
    return PointCloud(content.vertices[rows], known, attributes=attributes)
