"""PLY, text and binary: bytes in, `Content` out.

Ours, since trimesh takes PLY triangle strips for points and mixed binary polygons for garbage.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from parapoint.errors import InputError
from parapoint.files.attributes import (
    GEOMETRY,
    named_attributes,
    named_colours,
    spelled_colours,
    taken_normals,
    unit_colours,
)
from parapoint.files.content import (
    FACE_COLOURS,
    NO_UV,
    Content,
    points_content,
    ranges,
    strip_triangles,
    whole,
)
from parapoint.files.decoding import plain
from parapoint.files.meshes.ply_body import (
    BLOCK,
    Body,
    Property,
    declared,
    row_starts,
    run_of_values,
    text_body,
    walked,
)
from parapoint.surfaces.surface import FloatArray, IntArray

logger = logging.getLogger("parapoint")

HEADER_END = re.compile(rb"[\r\n]end_header[ \t\r]*\n")
CR_BEGIN, CR_HEADER_END = re.compile(rb"ply[ \t]*\r(?!\n)"), re.compile(rb"\rend_header[ \t]*\r")
"""How a header begins and ends whose lines end with CR alone."""
INDICES = {"vertex_indices", "vertex_index"}
LISTS = {*INDICES, "texcoord"}
"""Lists that are read."""
POLYGONS = {"face", "tristrips"}
"""Elements that hold polygons."""
PICTURE = "TextureFile "
"""How the comment begins that names a picture, as MeshLab writes it."""
UV_COLUMNS = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texcoord_u", "texcoord_v"))
"""Names under which the UV of vertices stand."""

ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
"""The byte order of each format of a PLY file, as numpy writes it; none of text."""
PLY_TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("long", "int64"), "i8"),
    **dict.fromkeys(("ulong", "uint64"), "u8"),
    **dict.fromkeys(("half", "float16"), "f2"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}


@dataclass
class Column:
    """A property of all rows of an element.

    Attributes:
        values: (N,) of scalars; of lists, all values in one run.
        sizes: (N,) how many values each list has; None for scalars.
    """

    values: npt.NDArray[Any]
    sizes: IntArray | None = None

    @property
    def longest(self) -> int:
        """Values of the longest list; 0 for scalars."""
        return 0 if self.sizes is None else int(self.sizes.max(initial=0))

    def rows(self, chosen: IntArray) -> Column:
        """Some rows."""
        if self.sizes is None:
            return Column(self.values[chosen])
        starts = np.cumsum(self.sizes) - self.sizes
        return Column(self.values[ranges(starts[chosen], self.sizes[chosen])], self.sizes[chosen])


@dataclass
class Table:
    """An element of a PLY file: its name, the number of its rows, and its properties."""

    name: str
    count: int
    columns: dict[str, Column]

    def rows(self, chosen: IntArray) -> Table:
        """Some rows."""
        columns = {name: column.rows(chosen) for name, column in self.columns.items()}
        return Table(self.name, len(chosen), columns)


def opened(data: bytes) -> tuple[list[str], list[Table]]:
    """The comments of a PLY file, and its elements, whatever they are."""
    elements, body = _parts(data)
    at = 0
    tables = []
    for name, count, properties in elements:
        columns, at = _columns(body, at, count, properties)
        pairs = zip(properties, columns, strict=True)
        tables.append(Table(name, count, {item.name: Column(*one) for item, one in pairs}))
    body.check_end(at)
    return comments_of(data), tables


def comments_of(data: bytes) -> list[str]:
    """The comments in the header of a PLY file."""
    header = data.partition(b"end_header")[0].splitlines()
    notes = [line.partition(b" ")[2] for line in header if line.startswith(b"comment ")]
    return [line.decode(errors="surrogateescape") for line in notes]


def named_pictures(data: bytes) -> list[str]:
    """The pictures that a PLY file names, in order."""
    comments = comments_of(data)
    return [line.removeprefix(PICTURE).strip() for line in comments if line.startswith(PICTURE)]


def pictures_of(path: Path) -> tuple[list[str], IntArray]:
    """The pictures that a PLY file names, and (N,) the number of the one on each polygon."""
    data = plain(path.read_bytes())
    names, (_, tables) = named_pictures(data), opened(data)
    first, *others = (table for table in tables if table.name in POLYGONS and table.count)
    if not others and "texnumber" in first.columns:
        return names, first.columns["texnumber"].values.astype(np.int64)
    return names, np.zeros(len(ply(data).sizes), dtype=np.int64)


def _columns(
    body: Body, at: int, count: int, properties: list[Property]
) -> tuple[list[tuple[npt.NDArray[Any], IntArray | None]], int]:
    """Values and sizes of each property, and the unit behind the element."""
    starts, sizes, end = walked(body, at, count, properties)
    return [
        (
            declared(run_of_values(body, starts[:, k], sizes[:, k], item.type), item.type),
            None if item.count_type is None else sizes[:, k],
        )
        for k, item in enumerate(properties)
    ], end


List = tuple[IntArray, npt.NDArray[Any]]
"""Lengths of the lists of all rows, and their values in one run."""
Element = tuple[str, int, list[Property]]
"""Name, count and properties of an element."""


def header_of(data: bytes) -> tuple[str, list[Element], int] | None:
    """The byte order ("" for text, "<" or ">"), the elements, and where the body begins.

    None where the data begin with no header.

    Raises:
        InputError: the header says what PLY does not have.
    """
    closing = (CR_HEADER_END if CR_BEGIN.match(data) else HEADER_END).search(data)
    if not data.startswith(b"ply") or data[3:4].strip() or closing is None:
        return None
    encoding, elements = _ply_header(data[3 : closing.start()].decode("latin-1").splitlines())
    return encoding, elements, closing.end()


def _parts(data: bytes) -> tuple[list[Element], Body]:
    """The elements and the body of a PLY file."""
    header = header_of(data)
    if header is None:
        raise InputError("has no PLY header")
    encoding, elements, begin = header
    raw = data[begin:]
    return elements, Body(raw) if encoding else text_body(raw, len(data[:begin].splitlines()) + 1)


def ply_pieces(path: Path, size: int) -> Iterator[Content] | None:
    """What `ply` reads of a binary file that holds points alone, at most `size` at a time.

    None where it is no such file.

    Raises:
        InputError: it ends early.
    """
    with path.open("rb") as stream:
        head = stream.read(BLOCK)
    header = header_of(head)
    if header is None:
        return None
    encoding, elements, begin = header
    if not encoding or not elements or any(count for _, count, _ in elements[1:]):
        return None
    name, count, properties = elements[0]
    width = sum(item.type.itemsize for item in properties)
    if name != "vertex" or any(item.count_type is not None for item in properties):
        return None
    if path.stat().st_size < begin + count * width:
        raise _ends_early(count)
    return _pieces_of_rows(path, begin, count, properties, size)


def _pieces_of_rows(
    path: Path, begin: int, count: int, properties: list[Property], size: int
) -> Iterator[Content]:
    """The `count` rows of a file from a byte on, `size` at a time."""
    width = sum(item.type.itemsize for item in properties)
    with path.open("rb") as stream:
        stream.seek(begin)
        for first in range(0, count, size):
            rows = min(size, count - first)
            body = Body(stream.read(rows * width))
            columns, _ = _ply_table(body, 0, rows, properties)
            yield points_content(*_points_of(columns))


def ply(data: bytes) -> Content:
    """PLY, text or binary of either byte order: polygons and triangle strips, vertex normals."""
    elements, body = _parts(data)
    at = 0
    columns: dict[str, npt.NDArray[Any]] = {}
    none, no_uv = np.zeros(0, dtype=np.int64), np.zeros(0)
    parts = [(none, none, none, no_uv)]
    for name, count, properties in elements:
        if name == "vertex":
            columns, at = _ply_table(body, at, count, properties)
            continue
        lists, at = _ply_lists(body, at, count, properties)
        indices = next((of for key, of in lists.items() if key in INDICES), None)
        if name not in POLYGONS:
            if indices is not None and count:
                logger.warning("rows of the unknown element %r left out: %d", name, count)
        elif indices is not None:
            parts.append(_polygons(name, indices, lists.get("texcoord")))
        elif count:
            named = ", ".join(item.name for item in properties) or "nothing"
            raise InputError(f"has {count} rows of {name} with {named}, but without vertex_indices")
    body.check_end(at)
    sizes, corners, uv_sizes, uv = (np.concatenate(part) for part in zip(*parts, strict=True))
    wedges = _ply_uv(columns, corners, sizes, uv_sizes, uv) if len(sizes) else (None, None)
    vertices, normals, attributes = _points_of(columns)
    extras = _extras(elements)
    return Content(vertices, sizes, corners, normals, *wedges, attributes, extras=extras)


def _extras(elements: list[Element]) -> tuple[str, ...]:
    """What no mesh holds of these elements, in words: properties of faces, and further elements."""
    found = []
    for name, count, properties in elements:
        if name not in POLYGONS and name != "vertex" and count:
            found.append(f"the element {name}")
        elif name in POLYGONS and count:
            left = [item.name for item in properties if item.name not in {*LISTS, "texnumber"}]
            if colours := spelled_colours(left):
                found.append(FACE_COLOURS)
            found += [f"{name} of faces" for name in left if name not in colours]
    return tuple(found)


def face_colours(path: Path) -> npt.NDArray[np.uint8] | None:
    """(N, 3) the colours of the faces of a PLY file; None where not all its polygons have one."""
    tables = [one for one in opened(plain(path.read_bytes()))[1] if one.name in POLYGONS]
    first, *others = (table for table in tables if table.count)
    known = {name: of.values for name, of in first.columns.items() if of.sizes is None}
    names = spelled_colours(list(known))
    if others or not names:
        return None
    colours = named_colours(np.stack([known[name] for name in names], axis=1))
    if colours is None:
        return None
    shares = np.nan_to_num(unit_colours(colours[:, :3]), nan=1.0)
    return np.rint(255 * shares).astype(np.uint8)


def _polygons(
    name: str, indices: List, texcoord: List | None
) -> tuple[IntArray, IntArray, IntArray, FloatArray]:
    """Sizes and corners of the polygons of an element, and sizes and values of their UV."""
    sizes, corners = indices[0], whole(indices[1])
    if name == "tristrips":
        triangles = strip_triangles(sizes, corners)
        sizes, corners, texcoord = np.full(len(triangles), 3), triangles.reshape(-1), None
    if texcoord is None:
        return sizes, corners, np.zeros_like(sizes), np.zeros(0)
    return sizes, corners, texcoord[0], texcoord[1].astype(np.float64)


def _points_of(
    columns: dict[str, npt.NDArray[Any]],
) -> tuple[FloatArray, FloatArray | None, dict[str, npt.NDArray[Any]]]:
    """The positions, the normals if there are any, and the attributes of the rows of a table."""
    if not all(axis in columns for axis in "xyz"):
        raise InputError("has no vertex element with x, y and z")
    normals = taken_normals(columns)
    return _stacked(columns, "x", "y", "z"), normals, named_attributes(columns)


def _ply_uv(
    columns: dict[str, npt.NDArray[Any]],
    corners: IntArray,
    sizes: IntArray,
    counts: IntArray,
    values: FloatArray,
) -> tuple[FloatArray | None, IntArray | None]:
    """UV and their rows at the corners: of the vertices, or of each face's list "texcoord".

    `counts` and `values` are the lengths of these lists, and their numbers in one run.
    """
    for names in UV_COLUMNS:
        if all(name in columns for name in names):
            pair = [columns.pop(name).astype(np.float64) for name in names]
            return np.stack(pair, axis=1), corners
    if len(values) == 0 or ((counts != 2 * sizes) & (counts != 0)).any():
        return None, None  # of something else than corners
    has_uv = np.repeat(counts > 0, sizes)
    rows = np.where(has_uv, np.cumsum(has_uv) - 1, NO_UV)
    return values.reshape(-1, 2), rows


def _stacked(columns: dict[str, npt.NDArray[Any]], *names: str) -> FloatArray:
    """(n, 3) of three columns."""
    return np.stack([columns[name] for name in names], axis=1, dtype=np.float64, casting="unsafe")


def _ply_header(lines: list[str]) -> tuple[str, list[Element]]:
    """The byte order ("" for text, "<" or ">"), and name, count and properties of each element."""
    encoding = ""
    elements: list[Element] = []
    for line in lines:
        words = line.split()
        match words:
            case ["format", kind, *_]:
                if kind not in ORDERS:
                    raise InputError(f"is of the format {kind!r}; known are {', '.join(ORDERS)}")
                encoding = ORDERS[kind]
            case ["element", name, count]:
                elements.append((name, int(count), []))
            case ["property", "list", count_kind, kind, name]:
                kinds = _type(encoding, kind, line), _type(encoding, count_kind, line)
                elements[-1][2].append(Property(name, *kinds))
            case ["property", kind, name]:
                elements[-1][2].append(Property(name, _type(encoding, kind, line), None))
            case ["comment" | "obj_info", *_] | []:
                pass
            case _:
                raise InputError(f"has an unknown header line {line[:60]!r}")
    if any(count < 0 for _, count, _ in elements):
        raise InputError("has a negative element count")
    return encoding, elements


def _type(encoding: str, kind: str, line: str) -> np.dtype[Any]:
    """The type of this name in PLY."""
    if kind not in PLY_TYPES:
        raise InputError(f"has a type that PLY does not know in its header line {line[:60]!r}")
    return np.dtype(encoding + PLY_TYPES[kind])


def _ends_early(count: int) -> InputError:
    return InputError(f"ends early: {count} vertices are announced")


def _ply_table(
    body: Body, at: int, count: int, properties: list[Property]
) -> tuple[dict[str, npt.NDArray[Any]], int]:
    """Columns of an element without lists, by property name, and the unit behind it."""
    if any(item.count_type is not None for item in properties):
        raise InputError("has lists among its vertex properties, which is not read")
    if not properties:
        return {}, at
    if body.numbers is not None:
        _, end = row_starts(body, at, count, properties)
        rows = body.numbers[at:end].reshape(count, len(properties))
        return {
            item.name: rows[:, k] if item.name in GEOMETRY else declared(rows[:, k], item.type)
            for k, item in enumerate(properties)
        }, end
    end = at + count * sum(item.type.itemsize for item in properties)
    if end > body.size:
        raise _ends_early(count)
    kind = np.dtype([(f"{k}", item.type) for k, item in enumerate(properties)])
    table = np.frombuffer(body.raw, kind, count, at)
    return {
        item.name: table[f"{k}"].astype(item.type.newbyteorder("="))
        for k, item in enumerate(properties)
    }, end


def _ply_lists(
    body: Body, at: int, count: int, properties: list[Property]
) -> tuple[dict[str, List], int]:
    """Lengths and values of an element's lists of LISTS, and the unit behind the element."""
    if body.numbers is None and all(item.count_type is None for item in properties):
        return {}, at + count * sum(item.type.itemsize for item in properties)
    starts, sizes, end = walked(body, at, count, properties)
    return {
        item.name: (sizes[:, k], run_of_values(body, starts[:, k], sizes[:, k], item.type))
        for k, item in enumerate(properties)
        if item.count_type is not None and item.name in LISTS
    }, end
