"""Readers of mesh files, one for each format: bytes in, `Content` out, everything in file order.

Written here, since the readers at hand lose something a benchmark needs. trimesh (which still
reads STL) merges or reorders OBJ vertices that carry UV, does not know binary OFF, takes PLY
triangle strips for points and mixed binary polygons for garbage, and drops the UV of glTF
primitives that have no material.

Each reader raises InputError, ValueError, IndexError, KeyError, OverflowError, struct.error or
TypeError on bytes that are no such file; `parapoint.files.surfaces` turns all of them into one
line.
"""

from __future__ import annotations

import base64
import io
import json
import math
import re
import struct
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from itertools import chain, pairwise
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from parapoint.errors import InputError
from parapoint.surfaces.surface import FloatArray, IntArray

NO_UV = np.iinfo(np.int64).min
"""Row of `Content.uv_corners` at a corner without UV."""


@dataclass
class Content:
    """What a file holds, before it is checked and its polygons are cut into triangles.

    Attributes:
        vertices: (V, 3) positions.
        sizes: (N,) number of corners of each polygon.
        corners: (sum of sizes,) row of `vertices` at each polygon corner.
        normals: (V, 3) vertex normals, or None.
        uv: (T, 2) texture coordinates, or None.
        uv_corners: like `corners`, rows of `uv`; NO_UV where a corner has none.
        attributes: whatever else is known at each vertex, (V,) or (V, k) by name; see `PointCloud`.
    """

    vertices: FloatArray
    sizes: IntArray
    corners: IntArray
    normals: FloatArray | None = None
    uv: FloatArray | None = None
    uv_corners: IntArray | None = None
    attributes: dict[str, npt.NDArray[Any]] = field(default_factory=dict)


def points_content(
    points: FloatArray,
    normals: FloatArray | None = None,
    attributes: dict[str, npt.NDArray[Any]] | None = None,
) -> Content:
    """The content of a file without faces."""
    none = np.zeros(0, dtype=np.int64)
    return Content(points, none, none, normals, attributes=attributes or {})


def named_attributes(columns: dict[str, npt.NDArray[Any]]) -> dict[str, npt.NDArray[Any]]:
    """Attributes of columns (P,) by name: red, green, blue (and alpha) are one, "colours".

    Coordinates and normals are left out. Scanners' names of the intensity become "intensity".
    """
    left = {name: of for name, of in columns.items() if name not in GEOMETRY}
    attributes = {}
    for names in COLOUR_COLUMNS:
        if all(name in left for name in names):
            chosen = [left.pop(name) for name in names]
            colours = colours_of(np.stack(chosen, axis=1))
            if colours is not None:
                attributes["colours"] = colours
            break
    for name, values in left.items():
        attributes["intensity" if name.lower() in INTENSITIES else name] = values
    return attributes


def colours_of(values: npt.NDArray[Any]) -> npt.NDArray[Any] | None:
    """(P, 3 or 4) numbers of any type as colours (see `PointCloud`); None where they are none.

    Numbers of 16 bits none of which is over 255 are of 8 bits; so are whole floats over 1.
    """
    least, most = (float(of(values, initial=0)) for of in (np.min, np.max))
    if not (least >= 0 and math.isfinite(most)):  # not so either where one is NaN
        return None
    if values.dtype.kind == "f":
        if most <= 1:
            return values
        if most > 65535 or (np.floor(values) != values).any():
            return None
    elif most > 65535:
        return None
    if values.dtype == np.uint8:
        return values
    return values.astype(np.uint8 if most <= 255 else np.uint16)


def floats(words: Iterable[Any], columns: int) -> FloatArray:
    """(n, columns) numbers from a flat run of words."""
    return np.fromiter(map(float, words), dtype=np.float64).reshape(-1, columns)


def integers(words: Iterable[Any]) -> IntArray:
    """(n,) whole numbers from a flat run of words."""
    return np.fromiter(map(int, words), dtype=np.int64)


def ranges(starts: IntArray, sizes: IntArray) -> IntArray:
    """The numbers start, start + 1, ... of each run, one run after the other."""
    places = np.arange(int(sizes.sum()), dtype=np.int64)
    return np.asarray(places + np.repeat(starts - (np.cumsum(sizes) - sizes), sizes))


def whole(values: FloatArray | IntArray) -> IntArray:
    """Indices that were read as numbers of any kind."""
    if not ((np.abs(values) < 2**53) & (np.floor(values) == values)).all():
        raise InputError("an index is no whole number")
    return values.astype(np.int64)


# OBJ ------------------------------------------------------------------------------------------

V, VT, F = (b"v ", b"v\t"), (b"vt ", b"vt\t"), (b"f ", b"f\t")
"""Beginnings of the lines that are read."""


def obj(data: bytes) -> Content:
    """Wavefront OBJ: v, vt and f; indices may be negative, faces polygons, UV on some corners."""
    text = re.sub(rb"#[^\r\n]*", b"", data) if b"#" in data else data
    lines = [
        line.strip() for line in text.replace(b"\\\r\n", b" ").replace(b"\\\n", b" ").splitlines()
    ]
    points, point_sizes = _rows([line[1:] for line in lines if line.startswith(V)])
    uvs, uv_sizes = _rows([line[2:] for line in lines if line.startswith(VT)])
    if len(point_sizes) and point_sizes.min() < 3:
        raise InputError("a v line has fewer than three coordinates")
    if len(uv_sizes) and uv_sizes.min() < 1:
        raise InputError("a vt line has no coordinate")
    starts = np.cumsum(point_sizes) - point_sizes
    vertices = points[starts[:, None] + np.arange(3)]
    sizes, corners, uv_corners = _obj_faces([line[1:] for line in lines if line.startswith(F)])
    if (corners < 0).any() or (uv_corners < 0).any():  # counted backwards from the face's line
        is_face = np.array([line.startswith(F) for line in lines])
        for key, indices in (V, corners), (VT, uv_corners):
            seen = np.cumsum([line.startswith(key) for line in lines])[is_face]
            before = np.repeat(seen, sizes)
            backwards = indices < 0
            indices[backwards] = np.maximum(before[backwards] + indices[backwards] + 1, -1)
    content = Content(vertices, sizes, corners - 1)
    if len(uv_sizes):
        starts = np.cumsum(uv_sizes) - uv_sizes
        second = np.where(uv_sizes > 1, starts + 1, starts)
        content.uv = np.stack([uvs[starts], np.where(uv_sizes > 1, uvs[second], 0.0)], axis=1)
        content.uv_corners = np.where(uv_corners == 0, NO_UV, uv_corners - 1)
    elif uv_corners.any():
        raise InputError("faces refer to texture coordinates, but the file has no vt line")
    return content


def _obj_faces(lines: list[bytes]) -> tuple[IntArray, IntArray, IntArray]:
    """Corners of each f line, and for each corner its v and vt index as written (0: no vt)."""
    text = b"\n".join(lines)
    sizes = word_counts(text, len(lines))
    if b"/" not in text:
        indices = numbers(text, np.int64)
        return sizes, indices, np.zeros_like(indices)
    text = re.sub(rb"/(?=[/\s]|$)", b"/0", text)  # v//vn and v/: an index that is not there
    characters = np.frombuffer(text, dtype=np.uint8)
    blank = characters <= 32
    words = np.flatnonzero(~blank & np.concatenate([[True], blank[:-1]]))
    slashes = np.flatnonzero(characters == ord("/"))
    parts = 1 + np.bincount(np.searchsorted(words, slashes) - 1, minlength=len(words))
    indices = numbers(text.replace(b"/", b" "), np.int64)
    if len(indices) != parts.sum() or parts.max() > 3:
        raise InputError("a corner of a face is not v, v/vt, v//vn or v/vt/vn")
    starts = np.cumsum(parts) - parts
    second = np.minimum(starts + 1, len(indices) - 1)
    return sizes, indices[starts], np.where(parts > 1, indices[second], 0)


def _rows(lines: list[bytes]) -> tuple[FloatArray, IntArray]:
    """All numbers of these lines in one run, and how many each line has."""
    text = b"\n".join(lines)
    return numbers(text, np.float64), word_counts(text, len(lines))


def word_counts(text: bytes, line_count: int) -> IntArray:
    """(line_count,) number of words in each of the lines of a text."""
    if line_count == 0:
        return np.zeros(0, dtype=np.int64)
    characters = np.frombuffer(text, dtype=np.uint8)
    blank = characters <= 32
    first = ~blank & np.concatenate([[True], blank[:-1]])
    line = np.concatenate([[0], np.cumsum(characters == ord("\n"))[:-1]])
    return np.bincount(line[first], minlength=line_count)


def numbers(text: bytes, kind: type[np.float64 | np.int64]) -> npt.NDArray[Any]:
    """All numbers of a text; fast, since a mesh has a million of them.

    Raises:
        ValueError: a word is no number; the message names it.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)
        try:
            return np.fromstring(text, kind, sep=" ") if text.strip() else np.zeros(0, kind)
        except (DeprecationWarning, ValueError):  # numpy stops at a word without naming it
            words = map(float if kind is np.float64 else int, text.split())
            return np.fromiter(words, dtype=kind)


# OFF ------------------------------------------------------------------------------------------


def off(data: bytes) -> Content:
    """Geomview OFF, text or binary; what follows x y z or a face's indices (colours) is left."""
    first, _, body = data.partition(b"\n")
    if first.split()[1:2] == [b"BINARY"]:
        return _binary_off(body)
    lines = [words for line in data.splitlines() if (words := line.split(b"#", 1)[0].split())]
    if lines and lines[0][0].upper().endswith(b"OFF"):
        if lines[0][0].upper() not in {b"OFF", b"COFF", b"NOFF", b"CNOFF", b"STOFF"}:
            raise InputError(f"{lines[0][0][:20]!r} is no kind of OFF that has three coordinates")
        lines[0] = lines[0][1:]  # the counts may stand beside the keyword
    lines = [words for words in lines[:1] if words] + lines[1:]
    if not lines:
        raise InputError("has no OFF header")
    vertex_count, face_count = _counts(lines[0])
    if vertex_count + face_count > len(lines) - 1:
        raise InputError(
            f"ends early: {vertex_count} vertices and {face_count} faces are announced, "
            f"{len(lines) - 1} lines follow"
        )
    points = lines[1 : 1 + vertex_count]
    faces = lines[1 + vertex_count : 1 + vertex_count + face_count]
    if any(len(point) < 3 for point in points):
        raise InputError("a vertex has fewer than three coordinates")
    sizes = integers(face[0] for face in faces)
    if any(not 0 <= size < len(face) for size, face in zip(sizes.tolist(), faces, strict=True)):
        raise InputError("a face has fewer corners than it announces")
    return Content(
        floats(chain.from_iterable(point[:3] for point in points), 3),
        sizes,
        integers(
            chain.from_iterable(
                face[1 : 1 + size] for size, face in zip(sizes.tolist(), faces, strict=True)
            )
        ),
    )


def _counts(words: Sequence[bytes]) -> tuple[int, int]:
    """Numbers of vertices and faces in the line that announces them."""
    try:
        vertex_count, face_count = int(words[0]), int(words[1])
    except (IndexError, ValueError):
        vertex_count = face_count = -1
    if vertex_count < 0 or face_count < 0:
        raise InputError("has no line with the numbers of vertices and faces")
    return vertex_count, face_count


def _binary_off(body: bytes) -> Content:
    """Binary OFF: numbers of vertices, faces and edges, float32 positions, and the faces.

    Geomview defines it big-endian, with a number of colours behind the corners of each face. CGAL
    writes it in the byte order of its machine, without that number. Whichever of the four fills
    the file exactly is meant.
    """
    for order in ">", "<":
        words = np.frombuffer(body[: len(body) // 4 * 4], dtype=f"{order}i4")
        vertex_count, face_count = int(words[0]), int(words[1])
        start = 3 + 3 * vertex_count
        if min(vertex_count, face_count) < 0 or start + face_count > len(words):
            continue
        for coloured in True, False:
            faces = _binary_off_faces(words[start:].tolist(), face_count, coloured=coloured)
            if faces is None:
                continue
            starts, sizes = map(integers, faces)
            return Content(
                words[3:start].view(f"{order}f4").astype(np.float64).reshape(-1, 3),
                sizes,
                words[start + ranges(starts, sizes)].astype(np.int64),
            )
    raise InputError("ends early, or its faces are not those of a binary OFF")


def _binary_off_faces(
    words: list[int], count: int, *, coloured: bool
) -> tuple[list[int], list[int]] | None:
    """First word and number of corners of each face, or None if they do not fill the words."""
    starts, sizes, at = [], [], 0
    for _ in range(count):
        if at >= len(words) or words[at] < 0:
            return None
        starts.append(at + 1)
        sizes.append(words[at])
        at += 1 + words[at]
        if coloured:
            if at >= len(words) or words[at] < 0:
                return None
            at += 1 + words[at]
    return (starts, sizes) if at == len(words) else None


# PLY ------------------------------------------------------------------------------------------

GEOMETRY = {"x", "y", "z", "nx", "ny", "nz"}
COLOUR_COLUMNS = (
    ("red", "green", "blue", "alpha"),
    ("red", "green", "blue"),
    ("diffuse_red", "diffuse_green", "diffuse_blue"),
    ("r", "g", "b"),
)
"""Names under which the parts of a colour stand."""
INTENSITIES = {"intensity", "scalar_intensity", "reflectance", "scalar_reflectance"}
"""Names under which the strength of a scanner's echo stands, in lower case."""

PLY_TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}


@dataclass
class _Property:
    """A scalar of a PLY element, or a list where `count_type` is given (numpy type codes)."""

    name: str
    type: np.dtype[Any]
    count_type: np.dtype[Any] | None


@dataclass
class _Body:
    """The data of a PLY file: bytes, or the numbers of a text file, where each is one unit wide."""

    raw: bytes
    numbers: FloatArray | None

    @property
    def size(self) -> int:
        """Length in units."""
        return len(self.raw) if self.numbers is None else len(self.numbers)

    def width(self, kind: np.dtype[Any]) -> int:
        """Units of one value."""
        return kind.itemsize if self.numbers is None else 1

    def values(self, at: IntArray, kind: np.dtype[Any]) -> FloatArray:
        """The values that start at these units."""
        if self.numbers is not None:
            return np.asarray(self.numbers[at], dtype=np.float64)
        pool = np.frombuffer(self.raw, dtype=np.uint8)
        chosen = pool[at[:, None] + np.arange(kind.itemsize)]
        return np.asarray(chosen.view(kind).reshape(-1), dtype=np.float64)

    def count_at(self, kind: np.dtype[Any]) -> Callable[[int], int]:
        """A function that reads a list's length at a unit."""
        if self.numbers is not None:
            numbers = self.numbers
            return lambda at: int(numbers[at])
        code = struct.Struct(kind.byteorder.replace("|", "=").replace("=", "<") + kind.char)
        return lambda at: int(code.unpack_from(self.raw, at)[0])


def ply(data: bytes) -> Content:
    """PLY, text or binary of either byte order: polygons and triangle strips, vertex normals."""
    match = re.match(rb"ply\s*?\r?\n(.*?)end_header[ \t]*\r?\n", data, re.DOTALL)
    if match is None:
        raise InputError("has no PLY header")
    encoding, elements = _ply_header(match[1].decode("latin-1").splitlines())
    raw = data[match.end() :]
    body = _Body(raw, None if encoding else floats(raw.split(), 1).reshape(-1))
    at = 0
    columns: dict[str, npt.NDArray[Any]] = {}
    sizes = corners = np.zeros(0, dtype=np.int64)
    for name, count, properties in elements:
        if name == "vertex":
            columns, at = _ply_table(body, at, count, properties)
        else:
            sizes_here, corners_here, at = _ply_lists(body, at, count, properties)
            if name == "face":
                sizes, corners = sizes_here, corners_here
            elif name == "tristrips":
                triangles = strip_triangles(sizes_here, corners_here)
                sizes, corners = np.full(len(triangles), 3), triangles.reshape(-1)
    if not all(axis in columns for axis in "xyz"):
        raise InputError("has no vertex element with x, y and z")
    vertices = _stacked(columns, "x", "y", "z")
    normals = None
    if all(axis in columns for axis in ("nx", "ny", "nz")):
        normals = _stacked(columns, "nx", "ny", "nz")
    return Content(vertices, sizes, corners, normals, attributes=named_attributes(columns))


def _stacked(columns: dict[str, npt.NDArray[Any]], *names: str) -> FloatArray:
    """(n, 3) of three columns."""
    return np.stack([columns[name] for name in names], axis=1, dtype=np.float64, casting="unsafe")


def _ply_header(lines: list[str]) -> tuple[str, list[tuple[str, int, list[_Property]]]]:
    """The byte order ("" for text, "<" or ">"), and name, count and properties of each element."""
    encoding = ""
    elements: list[tuple[str, int, list[_Property]]] = []
    for line in lines:
        words = line.split()
        match words:
            case ["format", kind, *_]:
                orders = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
                encoding = orders[kind]
            case ["element", name, count]:
                elements.append((name, int(count), []))
            case ["property", "list", count_kind, kind, name]:
                elements[-1][2].append(
                    _Property(
                        name,
                        np.dtype(encoding + PLY_TYPES[kind]),
                        np.dtype(encoding + PLY_TYPES[count_kind]),
                    )
                )
            case ["property", kind, name]:
                elements[-1][2].append(_Property(name, np.dtype(encoding + PLY_TYPES[kind]), None))
            case ["comment" | "obj_info", *_] | []:
                pass
            case _:
                raise InputError(f"has an unknown header line {line[:60]!r}")
    if any(count < 0 for _, count, _ in elements):
        raise InputError("has a negative element count")
    return encoding, elements


def _ply_table(
    body: _Body, at: int, count: int, properties: list[_Property]
) -> tuple[dict[str, npt.NDArray[Any]], int]:
    """Columns of an element without lists, by property name, and the unit behind it."""
    if any(item.count_type is not None for item in properties):
        raise InputError("has lists among its vertex properties, which is not read")
    if not properties:
        return {}, at
    width = sum(body.width(item.type) for item in properties)
    end = at + count * width
    if end > body.size:
        raise InputError(f"ends early: {count} vertices are announced")
    if body.numbers is not None:
        rows = body.numbers[at:end].reshape(count, width)
        return {
            item.name: rows[:, k].astype(item.type if item.name not in GEOMETRY else np.float64)
            for k, item in enumerate(properties)
        }, end
    kind = np.dtype([(f"{k}", item.type) for k, item in enumerate(properties)])
    table = np.frombuffer(body.raw, kind, count, at)
    return {
        item.name: table[f"{k}"].astype(item.type.newbyteorder("="))
        for k, item in enumerate(properties)
    }, end


def _ply_lists(
    body: _Body, at: int, count: int, properties: list[_Property]
) -> tuple[IntArray, IntArray, int]:
    """Lengths and values of an element's vertex index list, and the unit behind the element."""
    none = np.zeros(0, dtype=np.int64)
    if all(item.count_type is None for item in properties):
        return none, none, at + count * sum(body.width(item.type) for item in properties)
    steps: list[tuple[int, int, int, Callable[[int], int] | None, bool]] = []
    index_type = np.dtype("i4")
    for item in properties:
        if item.count_type is None:
            steps.append((body.width(item.type), 0, 0, None, False))
            continue
        wanted = item.name in {"vertex_indices", "vertex_index"}
        if wanted:
            index_type = item.type
        steps.append(
            (
                0,
                body.width(item.count_type),
                body.width(item.type),
                body.count_at(item.count_type),
                wanted,
            )
        )
    sizes: list[int] = []
    starts: list[int] = []
    for _ in range(count):
        for skip, count_width, width, count_at, wanted in steps:
            if count_at is None:
                at += skip
                continue
            size = count_at(at)
            at += count_width
            if size < 0:
                raise InputError("has a list of negative length")
            if wanted:
                sizes.append(size)
                starts.append(at)
            at += size * width
        if at > body.size:
            raise InputError("ends early, in a list")
    run = integers(sizes)
    width = body.width(index_type)
    places = np.repeat(integers(starts), run) + width * ranges(np.zeros_like(run), run)
    return run, whole(body.values(places, index_type)), at


def strip_triangles(sizes: IntArray, corners: IntArray) -> IntArray:
    """(F, 3) triangles of strips; -1 ends a strip, every second triangle is turned round.

    Triangles with a vertex twice only steer the strip, and are left out.
    """
    ends = np.cumsum(sizes)
    run = np.insert(corners, ends, -1)  # the end of a list ends its strip as well
    place = np.arange(len(run))
    begin = np.maximum.accumulate(np.where(run < 0, place, -1)) + 1
    windows = np.stack([run[:-2], run[1:-1], run[2:]], axis=1)
    odd = ((place - begin)[:-2] % 2).astype(bool)
    windows[odd] = windows[odd][:, [1, 0, 2]]
    a, b, c = windows.T
    return np.asarray(windows[(windows >= 0).all(axis=1) & (a != b) & (b != c) & (c != a)])


# STL ------------------------------------------------------------------------------------------


def stl(data: bytes) -> Content:
    """STL, text or binary: a soup of triangles, whose corners are welded where they are equal."""
    from trimesh.exchange.stl import load_stl

    parts = load_stl(io.BytesIO(data))
    solids = list(parts["geometry"].values()) if "geometry" in parts else [parts]
    soup = [np.asarray(solid["vertices"])[solid["faces"]].reshape(-1, 3) for solid in solids]
    if not any(map(len, soup)):
        raise InputError("has no triangle")
    vertices, corners = welded(np.concatenate(soup).astype(np.float64))
    return Content(vertices, np.full(len(corners) // 3, 3), corners)


def welded(points: FloatArray) -> tuple[FloatArray, IntArray]:
    """The distinct points in the order in which they first stand, and the row of each point.

    Points are one only where their coordinates are exactly equal; there is no tolerance that
    would be right for every file.
    """
    order = np.lexsort(points.T)
    ordered = points[order]
    fresh = np.ones(len(points), dtype=bool)
    fresh[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    group = np.empty(len(points), dtype=np.int64)
    group[order] = np.cumsum(fresh) - 1
    first = order[fresh]  # lexsort is stable: the first of its group in the file
    rank = np.argsort(np.argsort(first))
    return points[np.sort(first)], rank[group]


# glTF -----------------------------------------------------------------------------------------

GLTF_TYPES = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
GLTF_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


def glb(data: bytes, folder: Path) -> Content:
    """Binary glTF 2: a header and two chunks, JSON and data."""
    magic, version, _ = struct.unpack_from("<4sII", data)
    if magic != b"glTF" or version != 2:
        raise InputError("is no binary glTF 2 file")
    length, kind = struct.unpack_from("<I4s", data, 12)
    if kind != b"JSON":
        raise InputError("has no JSON chunk")
    tail = data[20 + length :]
    chunk = b""
    if len(tail) >= 8:
        size, _ = struct.unpack_from("<I4s", tail)
        chunk = tail[8 : 8 + size]
    return gltf(data[20 : 20 + length], folder, chunk)


def gltf(data: bytes, folder: Path, chunk: bytes = b"") -> Content:
    """The triangles (or, without any, the points) of a glTF 2 scene, moved to their places.

    glTF splits a vertex wherever a normal or a UV differs, so vertices are welded where their
    positions are exactly equal: seams of the UV are seams, not boundaries of the mesh. The UV are
    those of the first set, with v upwards as in OBJ.
    """
    return _Gltf(json.loads(data), folder, chunk).content()


class _Gltf:
    """One glTF file while it is read."""

    def __init__(self, tree: Any, folder: Path, chunk: bytes) -> None:
        if not isinstance(tree, dict) or not tree.get("meshes"):
            raise InputError("has no mesh")
        self.tree = tree
        self.buffers = [self._buffer(item, folder, chunk) for item in tree.get("buffers", [])]

    @staticmethod
    def _buffer(item: dict[str, Any], folder: Path, chunk: bytes) -> bytes:
        """The bytes of a buffer: the file's own chunk, in the text, or a file in its folder."""
        uri = item.get("uri")
        if uri is None:
            return chunk
        if uri.startswith("data:"):
            return base64.b64decode(uri.partition(",")[2])
        path = (folder / unquote(uri)).resolve()
        if not path.is_relative_to(folder.resolve()) or not path.is_file():
            raise InputError(f"its buffer {uri[:80]!r} is not a file beside it")
        return path.read_bytes()

    def accessor(self, index: int) -> FloatArray | IntArray:
        """(n, width) values; normalized whole numbers become fractions."""
        item = self.tree["accessors"][index]
        if "sparse" in item or "bufferView" not in item:
            raise InputError("has sparse or compressed data, which is not read; export it plain")
        view = self.tree["bufferViews"][item["bufferView"]]
        kind = np.dtype(GLTF_TYPES[item["componentType"]])
        width = GLTF_WIDTHS[item["type"]]
        stride = view.get("byteStride", width * kind.itemsize)
        start = view.get("byteOffset", 0) + item.get("byteOffset", 0)
        raw = self.buffers[view["buffer"]]
        count = item["count"]
        if count < 1 or start < 0 or stride < width * kind.itemsize:
            raise InputError("has an accessor of impossible size")
        if start + (count - 1) * stride + width * kind.itemsize > len(raw):
            raise InputError("ends early, in a buffer")
        array = np.ndarray((count, width), kind, raw, start, (stride, kind.itemsize))
        if kind.kind == "f":
            return array.astype(np.float64)
        if item.get("normalized"):
            return np.maximum(array / float(np.iinfo(kind).max), -1.0)
        return array.astype(np.int64)

    def placed_primitives(self) -> list[tuple[dict[str, Any], FloatArray]]:
        """Each primitive of the scene with its (4, 4) transform."""
        nodes = self.tree.get("nodes", [])
        if not nodes:
            return [(p, np.eye(4)) for mesh in self.tree["meshes"] for p in mesh["primitives"]]
        scenes = self.tree.get("scenes", [])
        children = {child for node in nodes for child in node.get("children", [])}
        roots = (
            scenes[self.tree.get("scene", 0)].get("nodes", [])
            if scenes
            else [index for index in range(len(nodes)) if index not in children]
        )
        placed = []
        waiting = [(index, np.eye(4)) for index in reversed(roots)]
        visited: set[int] = set()  # nodes form trees; a file in which they do not must not hang
        while waiting:
            index, outer = waiting.pop()
            if index in visited:
                raise InputError("has a node that hangs in two places")
            visited.add(index)
            node = nodes[index]
            transform = outer @ _node_transform(node)
            if "mesh" in node:
                primitives = self.tree["meshes"][node["mesh"]]["primitives"]
                placed += [(primitive, transform) for primitive in primitives]
            waiting += [(child, transform) for child in reversed(node.get("children", []))]
        return placed

    def content(self) -> Content:
        """The scene as one content."""
        positions, corners, uvs, uv_corners, points = [], [], [], [], []
        vertex_count = uv_count = 0
        for primitive, transform in self.placed_primitives():
            attributes = primitive["attributes"]
            local = self.accessor(attributes["POSITION"])
            if not np.isfinite(local).all():
                raise InputError("has a position that is not finite")
            place = local @ transform[:3, :3].T + transform[:3, 3]
            mode = primitive.get("mode", 4)
            if mode == 0:
                points.append(place)
            if mode not in {4, 5, 6}:
                continue
            run = (
                whole(self.accessor(primitive["indices"])).reshape(-1)
                if "indices" in primitive
                else np.arange(len(place))
            )
            triangles = _mode_triangles(mode, run).reshape(-1)
            if len(triangles) and (triangles.min() < 0 or triangles.max() >= len(place)):
                raise InputError(f"a vertex index is out of range (0 to {len(place) - 1})")
            positions.append(place)
            corners.append(triangles + vertex_count)
            vertex_count += len(place)
            if "TEXCOORD_0" in attributes:
                uv = np.asarray(self.accessor(attributes["TEXCOORD_0"]), dtype=np.float64)
                if len(uv) != len(place):
                    raise InputError(f"{len(uv)} UV for {len(place)} vertices")
                uvs.append(np.stack([uv[:, 0], 1 - uv[:, 1]], axis=1))
                uv_corners.append(triangles + uv_count)
                uv_count += len(uv)
            else:
                uv_corners.append(np.full(len(triangles), NO_UV))
        if not corners:
            if points:
                return points_content(np.concatenate(points))
            raise InputError("has no triangle and no point")
        vertices, row = welded(np.concatenate(positions))
        flat = np.concatenate(corners)
        content = Content(vertices, np.full(len(flat) // 3, 3), row[flat])
        if uvs:
            content.uv, content.uv_corners = np.concatenate(uvs), np.concatenate(uv_corners)
        return content


def _node_transform(node: dict[str, Any]) -> FloatArray:
    """(4, 4) transform of a glTF node: its matrix, or translation, rotation and scale."""
    if "matrix" in node:
        matrix = np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
        if not np.isfinite(matrix).all():
            raise InputError("has a transform that is not finite")
        return matrix
    turn = np.array(node.get("rotation", (0, 0, 0, 1)), dtype=np.float64)
    stretch = np.array(node.get("scale", (1, 1, 1)), dtype=np.float64)
    transform = np.eye(4)
    shift = np.array(node.get("translation", (0, 0, 0)), dtype=np.float64)
    if not np.isfinite(np.concatenate([turn, stretch, shift])).all():
        raise InputError("has a transform that is not finite")
    transform[:3, :3] = Rotation.from_quat(turn).as_matrix() * stretch
    transform[:3, 3] = shift
    return transform


def _mode_triangles(mode: int, run: IntArray) -> IntArray:
    """(F, 3) triangles of a glTF primitive: mode 4 a list, 5 a strip, 6 a fan."""
    if mode == 4:
        return run.reshape(-1, 3)
    if mode == 5:
        return strip_triangles(np.array([len(run)]), run)
    return np.array([(run[0], *pair) for pair in pairwise(run[1:])], np.int64).reshape(-1, 3)
