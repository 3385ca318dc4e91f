"""Surfaces and maps from files.

Vertices and faces keep the order of the file (STL and glTF, which repeat vertices, are welded).
Every fault of a file becomes one InputError that names the file. On bytes that are no such file a
reader may raise InputError or any of UNREADABLE; whatever else is raised is a bug of ours.
"""

from __future__ import annotations

import logging
import struct
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from parapoint.errors import InputError
from parapoint.files.clouds.las import las
from parapoint.files.clouds.pcd import pcd
from parapoint.files.clouds.xyz import pts, xyz
from parapoint.files.content import NO_UV, Content
from parapoint.files.decoding import plain
from parapoint.files.meshes.gltf import gltf
from parapoint.files.meshes.obj import obj
from parapoint.files.meshes.off import off
from parapoint.files.meshes.ply import ply
from parapoint.files.meshes.stl import stl
from parapoint.files.npz import npz
from parapoint.files.polygons import triangle_rows
from parapoint.surfaces.normals import known_or_zero
from parapoint.surfaces.parameterization import Parameterization, PointParameterization
from parapoint.surfaces.surface import (
    BoolArray,
    FloatArray,
    IntArray,
    Mesh,
    PointCloud,
    Surface,
    read_only,
)

FORMATS: dict[str, Callable[[bytes, Path], Content]] = {
    ".obj": lambda data, _: obj(data),
    ".ply": lambda data, _: ply(data),
    ".off": lambda data, _: off(data),
    ".stl": lambda data, _: stl(data),
    ".glb": gltf,
    ".gltf": gltf,
    **dict.fromkeys((".xyz", ".txt", ".csv", ".asc"), lambda data, _: xyz(data)),
    ".pts": lambda data, _: pts(data),
    ".pcd": lambda data, _: pcd(data),
    ".las": lambda data, _: las(data),
    ".laz": lambda data, _: las(data),
    ".npz": lambda data, _: npz(data),
}
"""Reader of each file name ending; it gets the bytes and the folder of the file."""

UV_FORMATS = (".obj", ".ply", ".glb", ".gltf", ".npz")
"""Endings of files that can carry a UV map of a mesh."""

UNREADABLE = (
    *(ValueError, TypeError, LookupError, AttributeError, ArithmeticError, EOFError, RuntimeError),
    *(struct.error, zlib.error, zipfile.BadZipFile),
)
"""What the readers and their libraries raise on bytes that are no file of their kind."""

SMALLEST_MESH, LARGEST_MESH = 1e-70, 1e70
"""Sizes between which a mesh is read, in its own unit: areas and their squares are float64 numbers.
Clouds have no such bounds."""

logger = logging.getLogger("parapoint")


def read_surface(path: str | Path) -> Surface:
    """The surface in a file: a Mesh, or a PointCloud where the file has no faces.

    Polygons become triangles in place: a quad is cut along its first diagonal, or along the
    second if it would fold along the first; larger polygons that bend inwards are cut by ears.
    STL repeats each vertex in each triangle: equal ones are welded, so that the mesh is connected.
    Points with a NaN or infinite coordinate are dropped with a logged warning, vertices are not.

    Raises:
        InputError: there is no such file, its ending is unknown, or it cannot be read; coordinates
            of a mesh are not finite or an index is out of range; no point of a cloud is finite.
    """
    path = Path(path)
    with faults_of(path):
        content = _content(path)
        if not len(content.sizes):
            return _point_cloud(content, path)
        return _mesh(content)[0]


def read_welded(path: str | Path) -> Surface:
    """The surface in a file as `read_surface` has it, with vertices at one place taken as one.

    Writers double the vertices of a mesh where UVs or normals differ; the surface goes on there.
    A logged warning counts them. Rows of vertices are the file's, of which some are then unused.

    Raises:
        InputError: as for `read_surface`.
    """
    surface = read_surface(path)
    if not isinstance(surface, Mesh):
        return surface
    whole = surface.welded
    if count := int(surface.referenced.sum() - whole.referenced.sum()):
        logger.warning("doubled vertices taken as one: %d", count)
    return whole


class Polygons(NamedTuple):
    """A mesh and the polygons that it was read from.

    Attributes:
        mesh: its triangles.
        places: (F, 3) for each corner of the triangles, its place among the polygons' corners.
        polygon_of: (F,) the polygon that each triangle is part of.
        extras: what else the file holds, in words: what a writer of the mesh alone leaves out.
        uv: (F, 3, 2) the UVs of the file at the corners, NaN where it has none; None without any.
        colours: (V, 3 or 4) of the vertices, as `PointCloud` has them, or None.
    """

    mesh: Mesh
    places: IntArray
    polygon_of: IntArray
    extras: tuple[str, ...]
    uv: FloatArray | None = None
    colours: npt.NDArray[Any] | None = None


def read_polygons(path: str | Path) -> Polygons | PointCloud:
    """The mesh in a file with its polygons, or the cloud where the file has no faces.

    Raises:
        InputError: as for `read_surface`.
    """
    path = Path(path)
    with faults_of(path):
        content = _content(path)
        if not len(content.sizes):
            return _point_cloud(content, path)
        mesh, places = _mesh(content)
        extras = [
            "normals" if content.normals is not None else "",
            "old UVs" if content.uv is not None else "",
            "polygons" if (content.sizes > 3).any() else "",
            *content.attributes,
            *content.extras,
        ]
        polygon_of = np.searchsorted(np.cumsum(content.sizes), places[:, 0], side="right")
        named = tuple(name for name in dict.fromkeys(extras) if name)
        colours = content.attributes.get("colours")
        return Polygons(mesh, places, polygon_of, named, _corner_uv(content, places), colours)


def read_parameterized(path: str | Path) -> tuple[Mesh, Parameterization]:
    """The mesh in an OBJ (with vt), PLY, glTF or NPZ file, and the UV map that it carries.

    Rows of `uv` are the file's, but for two habits of exporters, so that a seam is a place where
    the map is cut. Where several rows hold the same UV for the same vertex, all corners use the
    first. A row that serves several places of the surface, as where each UV is written once
    and charts lie over each other, is repeated at the end, once for each further place.

    Raises:
        InputError: as for `read_surface`; the format carries no UV, the file has none or not for
            all faces; a UV is not finite or its index is out of range.
    """
    path = Path(path)
    with faults_of(path):
        if path.suffix.lower() in FORMATS and path.suffix.lower() not in UV_FORMATS:
            raise InputError(
                "this format carries no UV map; give an OBJ with vt lines, a PLY, GLB or NPZ file"
            )
        content = _content(path)
        if len(content.sizes) == 0:
            raise InputError("has no faces; a UV map needs a mesh")
        if content.uv is None or content.uv_corners is None:
            raise InputError("has no UV coordinates")
        mesh, rows = _mesh(content)
        corners = content.uv_corners[rows]
        bare = (corners == NO_UV).any(axis=1)
        if bare.any():
            raise InputError(
                f"{int(bare.sum())} of {len(bare)} triangles have no UV; each must have one"
            )
        outside = (corners < 0) | (corners >= len(content.uv))
        if outside.any():
            raise InputError(
                f"triangle {int(np.flatnonzero(outside.any(axis=1))[0])} has a UV index out of "
                f"range; the file has {len(content.uv)} UV coordinates"
            )
        uv = read_only(content.uv, np.float64, "uv", 2)
        corners = _shared_corners(mesh, uv, corners)
        return mesh, Parameterization(*_rows_of_one_place(mesh, uv, corners))


@contextmanager
def faults_of(path: Path) -> Iterator[None]:
    """What is wrong with a file while it is read becomes one InputError that names the file."""
    try:
        yield
    except InputError as error:
        named = str(error).startswith(f"{path}: ")
        raise InputError(str(error) if named else f"{path}: {error}") from None
    except MemoryError:
        raise InputError(f"{path}: is too large for the memory of this machine") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error


def read_point_map(path: str | Path) -> tuple[PointCloud, PointParameterization]:
    """The points in a PLY (u and v), NPZ (points, uv) or OBJ file (a vt for each v), and their map.

    Raises:
        InputError: as for `read_surface`; the file has faces or no UV; a row of them is neither
            finite nor of two NaN.
    """
    path = Path(path)
    with faults_of(path):
        content = _content(path)
        if len(content.sizes):
            raise InputError("has faces; it is no point cloud")
        uv = content.attributes.get("uv")
        if uv is None and {"u", "v"} <= set(content.attributes):
            uv = np.stack([content.attributes[name] for name in "uv"], axis=1)
        if uv is None and content.uv is not None and len(content.uv) == len(content.vertices):
            uv = content.uv
        if uv is None:
            raise InputError(
                "has no uv for each point; a map of points is u and v in PLY, the array 'uv' in "
                "NPZ, and as many vt as v lines in OBJ"
            )
        return PointCloud(content.vertices), PointParameterization(uv)


def has_faces(path: str | Path) -> bool:
    """Whether a file holds a mesh.

    Raises:
        InputError: as for `read_surface`.
    """
    with faults_of(Path(path)):
        return len(_content(Path(path)).sizes) > 0


def _content(path: Path) -> Content:
    """What the file holds, by the reader of its ending."""
    check_file(path)
    if path.suffix.lower() not in FORMATS:
        raise InputError(f"has an unknown ending; known are {', '.join(FORMATS)}")
    reader = FORMATS[path.suffix.lower()]
    data = path.read_bytes()
    with unreadable(path):
        content = reader(data if path.suffix.lower() == ".npz" else plain(data), path.parent)
    check_fits_together(content)
    return content


def check_file(path: Path) -> None:
    """Check that there is a file that can be read more than once.

    Raises:
        InputError: there is none, or a folder, a pipe or a device.
    """
    if path.is_dir():
        raise InputError("is a folder, not a file")
    if str(path) == "-" or (path.exists() and not path.is_file()):
        raise InputError("pipes and devices are not read; write to a file, and name that")
    if not path.exists():
        raise InputError("no such file")


@contextmanager
def unreadable(path: Path) -> Iterator[None]:
    """What readers and their libraries raise on bytes of another kind becomes an InputError."""
    try:
        yield
    except InputError:
        raise
    except UNREADABLE as error:
        kind = path.suffix.lstrip(".").upper()
        detail = " ".join(str(error).split())[:200] or type(error).__name__
        raise InputError(f"is no {kind} file that can be read ({detail})") from error


def check_fits_together(content: Content) -> None:
    """Check that what a file holds is numbers of the shapes that `Content` has, a mesh finite."""
    count = len(content.vertices)
    infinite = ~np.isfinite(content.vertices).all(axis=1)
    if len(content.sizes) and infinite.any():
        row = int(infinite.argmax())
        raise InputError(f"vertices must be finite; row {row} is {content.vertices[row].tolist()}")
    uv_count = 0 if content.uv is None else content.uv.size // 2
    for name, values, shape in (
        ("normals", content.normals, (count, 3)),
        ("UVs", content.uv, (uv_count, 2)),
        ("UVs of corners", content.uv_corners, content.corners.shape),
    ):
        if values is not None and (values.shape != shape or values.dtype.kind not in "fiu"):
            raise InputError(
                f"has {name} of shape {values.shape} and type {values.dtype}, which do not fit its "
                f"{count} vertices and {len(content.sizes)} faces"
            )


def _mesh(content: Content) -> tuple[Mesh, IntArray]:
    """The triangle mesh, and for each triangle corner its place (F, 3) among polygon corners."""
    small = content.sizes < 3
    if small.any():
        face = int(np.flatnonzero(small)[0])
        raise InputError(f"face {face} has {int(content.sizes[face])} corners; it needs three")
    vertices = content.vertices
    outside = (content.corners < 0) | (content.corners >= len(vertices))
    if outside.any():
        corner = int(np.flatnonzero(outside)[0])
        face = int(np.searchsorted(np.cumsum(content.sizes), corner, side="right"))
        raise InputError(
            f"face {face} has a vertex index out of range; the file has {len(vertices)} vertices"
        )
    size = float(np.ptp(vertices[content.corners] / 2, axis=0).max(initial=0)) * 2
    if size and not SMALLEST_MESH < size < LARGEST_MESH:
        raise InputError(
            f"its size is {size:g}, and areas of it are beyond a float64: scale it to between "
            f"{SMALLEST_MESH:g} and {LARGEST_MESH:g}"
        )
    rows = triangle_rows(vertices, content.sizes, content.corners)
    return Mesh(vertices, content.corners[rows]), rows


def _corner_uv(content: Content, places: IntArray) -> FloatArray | None:
    """(F, 3, 2) the UVs at corners, NaN where there is none; None where all lack one."""
    if content.uv is None or content.uv_corners is None:
        return None
    rows = content.uv_corners[places]
    known = (rows >= 0) & (rows < len(content.uv))
    uv = np.full((*rows.shape, 2), np.nan)
    uv[known] = content.uv[rows[known]]
    return uv if known.any() else None


def _shared_corners(mesh: Mesh, uv: FloatArray, corners: IntArray) -> IntArray:
    """`corners` with the first of all rows that hold the same UV for the same vertex."""
    flat = corners.reshape(-1)
    order = np.lexsort((flat, uv[flat, 1], uv[flat, 0], mesh.faces.reshape(-1)))
    keys = np.column_stack([mesh.faces.reshape(-1), uv[flat]])[order]
    fresh = np.ones(len(flat), dtype=bool)
    fresh[1:] = (keys[1:] != keys[:-1]).any(axis=1)
    shared = np.empty_like(flat)
    shared[order] = flat[order][fresh][np.cumsum(fresh) - 1]
    return shared.reshape(-1, 3)


def _rows_of_one_place(
    mesh: Mesh, uv: FloatArray, corners: IntArray
) -> tuple[FloatArray, IntArray]:
    """`uv` and `corners` with a further row for each further place that a row serves."""
    row, position = corners.reshape(-1), mesh.vertices[mesh.faces.reshape(-1)]
    served = np.zeros((len(uv), 3))
    served[row] = position
    if np.array_equal(served[row], position):
        return uv, corners
    places, place = np.unique(mesh.vertices, axis=0, return_inverse=True)
    # One number for a row and a place: numbers sort far faster than pairs.
    pairs, pair = np.unique(
        row * len(places) + place.reshape(-1)[mesh.faces.reshape(-1)], return_inverse=True
    )
    pair_row = pairs // len(places)
    again = np.zeros(len(pairs), dtype=bool)
    again[1:] = pair_row[1:] == pair_row[:-1]
    new_row = np.where(again, len(uv) + np.cumsum(again) - 1, pair_row)
    return np.concatenate([uv, uv[pair_row[again]]]), new_row[pair.reshape(-1)].reshape(-1, 3)


def warn_of_dropped(path: Path, dropped: int, count: int) -> None:
    """Say how many points of a file are left out."""
    logger.warning(
        "%s: %d of %d points dropped: their coordinates are not finite", path, dropped, count
    )


def _point_cloud(content: Content, path: Path) -> PointCloud:
    """The finite points, with their normals, which are 0 where they are not finite."""
    finite: BoolArray = np.asarray(np.isfinite(content.vertices).all(axis=1))
    if not finite.any():
        raise InputError(
            "has no point" if len(finite) == 0 else "has no point with finite coordinates"
        )
    if not finite.all():
        warn_of_dropped(path, int((~finite).sum()), len(finite))
    normals = None if content.normals is None else content.normals[finite]
    if normals is not None:
        known = np.asarray(np.isfinite(normals).all(axis=1))
        if not known.all():
            logger.warning("%s: normals that are not finite, left out: %d", path, (~known).sum())
            normals = known_or_zero(normals) if known.any() else None
    attributes = {name: values[finite] for name, values in content.attributes.items()}
    rows = content.rows
    if not finite.all():
        rows = np.flatnonzero(finite) if rows is None else rows[finite]
    return PointCloud(content.vertices[finite], normals, int((~finite).sum()), attributes, rows)
