"""PLY, text and binary: bytes in, `Content` out.

Ours, since trimesh takes PLY triangle strips for points and mixed binary polygons for garbage.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from parapoint.errors import InputError
from parapoint.files.attributes import GEOMETRY, named_attributes
from parapoint.files.content import (
    NO_UV,
    Content,
    floats,
    integers,
    plain_numbers,
    points_content,
    ranges,
    strip_triangles,
    whole,
)
from parapoint.surfaces.surface import FloatArray, IntArray

BLOCK = 1 << 20
"""Units of a file, bytes or numbers of a text file, among which rows are looked for at once."""
HEADER_END = re.compile(rb"[\r\n]end_header[ \t\r]*\n")
INDICES = {"vertex_indices", "vertex_index"}
UV_COLUMNS = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texcoord_u", "texcoord_v"))
"""Names under which the UV of vertices stand."""

PLY_TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("long", "int64"), "i8"),
    **dict.fromkeys(("ulong", "uint64"), "u8"),
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
    header = data.partition(b"end_header")[0].decode("latin-1").splitlines()
    comments = [line.partition(" ")[2] for line in header if line.startswith("comment ")]
    at = 0
    tables = []
    for name, count, properties in elements:
        columns, at = _columns(body, at, count, properties)
        kinds = zip(properties, columns, strict=True)
        named = {
            item.name: Column(values.astype(item.type.newbyteorder("=")), sizes)
            for item, (values, sizes) in kinds
        }
        tables.append(Table(name, count, named))
    return comments, tables


def _columns(
    body: _Body, at: int, count: int, properties: list[_Property]
) -> tuple[list[tuple[FloatArray, IntArray | None]], int]:
    """Values and sizes of each property, and the unit behind the element."""
    starts, sizes, end = _walk(body, at, count, properties)
    return [
        (
            _run_of_values(body, starts[:, k], sizes[:, k], item.type),
            None if item.count_type is None else sizes[:, k],
        )
        for k, item in enumerate(properties)
    ], end


def _parts(data: bytes) -> tuple[list[tuple[str, int, list[_Property]]], _Body]:
    """The elements and the body of a PLY file."""
    closing = HEADER_END.search(data)
    if not data.startswith(b"ply") or data[3:4].strip() or closing is None:
        raise InputError("has no PLY header")
    end, body_begin = closing.span()
    encoding, elements = _ply_header(data[3:end].decode("latin-1").splitlines())
    raw = data[body_begin:]
    body = _Body(raw, None if encoding else floats(plain_numbers(raw).split(), 1).reshape(-1))
    return elements, body


def ply_pieces(path: Path, size: int) -> Iterator[Content] | None:
    """What `ply` reads of a binary file that holds points alone, at most `size` at a time.

    None where it is no such file.

    Raises:
        InputError: it ends early.
    """
    with path.open("rb") as stream:
        head = stream.read(BLOCK)
    closing = HEADER_END.search(head)
    if not head.startswith(b"ply") or closing is None:
        return None
    encoding, elements = _ply_header(head[3 : closing.start()].decode("latin-1").splitlines())
    if not encoding or not elements or any(count for _, count, _ in elements[1:]):
        return None
    name, count, properties = elements[0]
    width = sum(item.type.itemsize for item in properties)
    if name != "vertex" or any(item.count_type is not None for item in properties):
        return None
    if path.stat().st_size < closing.end() + count * width:
        raise _ends_early(count)
    return _pieces_of_rows(path, closing.end(), count, properties, size)


def _pieces_of_rows(
    path: Path, begin: int, count: int, properties: list[_Property], size: int
) -> Iterator[Content]:
    """The `count` rows of a file from a byte on, `size` at a time."""
    width = sum(item.type.itemsize for item in properties)
    with path.open("rb") as stream:
        stream.seek(begin)
        for first in range(0, count, size):
            rows = min(size, count - first)
            body = _Body(stream.read(rows * width), None)
            columns, _ = _ply_table(body, 0, rows, properties)
            yield points_content(*_points_of(columns))


def ply(data: bytes) -> Content:
    """PLY, text or binary of either byte order: polygons and triangle strips, vertex normals."""
    elements, body = _parts(data)
    at = 0
    columns: dict[str, npt.NDArray[Any]] = {}
    sizes = corners = np.zeros(0, dtype=np.int64)
    wedges: tuple[IntArray, FloatArray] | None = None
    for name, count, properties in elements:
        if name == "vertex":
            columns, at = _ply_table(body, at, count, properties)
        else:
            begin = at
            sizes_here, values, at = _ply_lists(body, begin, count, properties, INDICES)
            if name == "face":
                sizes, corners = sizes_here, whole(values)
                if any(item.name == "texcoord" for item in properties):
                    wedges = _ply_lists(body, begin, count, properties, {"texcoord"})[:2]
            elif name == "tristrips":
                triangles = strip_triangles(sizes_here, whole(values))
                sizes, corners = np.full(len(triangles), 3), triangles.reshape(-1)
    uv, uv_corners = _ply_uv(columns, corners, sizes, wedges) if len(sizes) else (None, None)
    vertices, normals, attributes = _points_of(columns)
    return Content(vertices, sizes, corners, normals, uv, uv_corners, attributes)


def _points_of(
    columns: dict[str, npt.NDArray[Any]],
) -> tuple[FloatArray, FloatArray | None, dict[str, npt.NDArray[Any]]]:
    """The positions, the normals if there are any, and the attributes of the rows of a table."""
    if not all(axis in columns for axis in "xyz"):
        raise InputError("has no vertex element with x, y and z")
    normals = None
    if all(axis in columns for axis in ("nx", "ny", "nz")):
        normals = _stacked(columns, "nx", "ny", "nz")
    return _stacked(columns, "x", "y", "z"), normals, named_attributes(columns)


def _ply_uv(
    columns: dict[str, npt.NDArray[Any]],
    corners: IntArray,
    sizes: IntArray,
    wedges: tuple[IntArray, FloatArray] | None,
) -> tuple[FloatArray | None, IntArray | None]:
    """UV and their rows at the corners: of the vertices, or of each face's list "texcoord"."""
    for names in UV_COLUMNS:
        if all(name in columns for name in names):
            pair = [columns.pop(name).astype(np.float64) for name in names]
            return np.stack(pair, axis=1), corners
    if wedges is None or len(wedges[1]) == 0:
        return None, None
    counts, values = wedges
    if ((counts != 2 * sizes) & (counts != 0)).any():
        return None, None  # of something else than corners
    has_uv = np.repeat(counts > 0, sizes)
    rows = np.where(has_uv, np.cumsum(has_uv) - 1, NO_UV)
    return values.reshape(-1, 2), rows


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


def _ends_early(count: int) -> InputError:
    return InputError(f"ends early: {count} vertices are announced")


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
        raise _ends_early(count)
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
    body: _Body, at: int, count: int, properties: list[_Property], names: set[str]
) -> tuple[IntArray, FloatArray, int]:
    """Lengths and values of an element's list of these names, and the unit behind the element."""
    if all(item.count_type is None for item in properties):
        end = at + count * sum(body.width(item.type) for item in properties)
        return np.zeros(0, dtype=np.int64), np.zeros(0), end
    starts, sizes, end = _walk(body, at, count, properties)
    for k, item in enumerate(properties):
        if item.name in names and item.count_type is not None:
            return sizes[:, k], _run_of_values(body, starts[:, k], sizes[:, k], item.type), end
    return np.zeros(0, dtype=np.int64), np.zeros(0), end


def _run_of_values(
    body: _Body, starts: IntArray, sizes: IntArray, kind: np.dtype[Any]
) -> FloatArray:
    """All values of lists that start at these units and have these sizes."""
    within = ranges(np.zeros_like(sizes), sizes)
    return body.values(np.repeat(starts, sizes) + body.width(kind) * within, kind)


def _walk(
    body: _Body, at: int, count: int, properties: list[_Property]
) -> tuple[IntArray, IntArray, int]:
    """(count, properties) the unit at which the values start, and their number; the unit behind.

    Raises:
        InputError: the body ends before the element does, or a list has a negative length.
    """
    rows, end = _row_starts(body, at, count, properties)
    starts = np.zeros((count, len(properties)), dtype=np.int64)
    sizes = np.ones((count, len(properties)), dtype=np.int64)
    for k, item in enumerate(properties):
        if item.count_type is not None:
            sizes[:, k] = body.values(rows, item.count_type)
            rows = rows + body.width(item.count_type)
        starts[:, k] = rows
        rows = rows + sizes[:, k] * body.width(item.type)
    return starts, sizes, end


def _row_starts(
    body: _Body, at: int, count: int, properties: list[_Property]
) -> tuple[IntArray, int]:
    """(count,) the unit at which each row of an element starts, and the unit behind the last."""
    if count == 0 or not properties:
        return np.full(count, at), at
    if count > body.size - at:  # a row takes a unit at least
        raise InputError("ends early, in a list")
    stride = int(_row_ends(body, np.array([at]), properties)[0]) - at
    even = at + stride * np.arange(count)
    fits = 0 < stride <= (body.size - at) // count
    if fits and (_row_ends(body, even, properties) == even + stride).all():
        return even, at + stride * count
    starts: list[int] = []
    while len(starts) < count:
        # The ends of the rows that would start at each of many units, true rows or not, take a
        # few calls; then one look a row leads from each true row to the next.
        begin, behind = at, min(at + BLOCK, body.size)
        ends = _row_ends(body, np.arange(begin, behind), properties).tolist()
        while at < behind and len(starts) < count:
            starts.append(at)
            at = ends[at - begin]
            if at <= starts[-1]:
                raise InputError("has a list of negative length")
        if at > body.size or (at == body.size and len(starts) < count):
            raise InputError("ends early, in a list")
    return integers(starts), at


def _row_ends(body: _Body, at: IntArray, properties: list[_Property]) -> IntArray:
    """(n,) the units behind rows that start at these units (n,).

    It is beyond the body if the row would be, and -1 if a list has a negative length.
    """
    beyond = body.size + 1
    is_negative = np.zeros(len(at), dtype=bool)
    for item in properties:
        size: IntArray | int = 1
        if item.count_type is not None:
            width = body.width(item.count_type)
            known = at + width <= body.size
            counts = np.full(len(at), float(beyond))
            counts[known] = np.fmin(body.values(at[known], item.count_type), beyond)
            is_negative |= counts < 0
            size = np.maximum(counts, 0).astype(np.int64)
            at = at + width
        at = np.minimum(at + size * body.width(item.type), beyond)
    return np.where(is_negative, -1, at)
