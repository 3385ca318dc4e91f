"""A PLY file written anew with other UVs, all else as it was."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from parapoint.files.content import ranges
from parapoint.files.decoding import plain
from parapoint.files.meshes.ply import (
    INDICES,
    PICTURE,
    POLYGONS,
    UV_COLUMNS,
    Column,
    Table,
    header_of,
    opened,
)
from parapoint.files.polygons import corner_rows
from parapoint.files.targets import complete_file
from parapoint.files.writing.point_writers import PLY_NAMES
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import IntArray

NAMES = PLY_NAMES | {"i8": "int64", "u8": "uint64", "f2": "half"}
"""PLY's name of each type, and the usual ones of types that it lacks."""
FACE_UV = {"texcoord", "texnumber"}
"""Properties of faces that go with the old UVs."""


def is_rewritable(path: Path) -> bool:
    """Whether all polygons of a PLY file are rows of one element "face"."""
    header = header_of(plain(path.read_bytes()))
    elements = header[1] if header is not None else []
    return [name for name, count, _ in elements if name in POLYGONS and count] == ["face"]


def rewrite_ply(
    source: Path,
    out: Path,
    parameterization: Parameterization,
    places: IntArray,
    *,
    picture: str | None = None,
) -> int:
    """Copy a PLY file with new UVs: s and t at the vertices, and "texcoord" at the faces.

    Vertices and faces keep their order and all that is known of them. Behind the vertices stand
    copies of those on the seam, one for each further uv. A polygon stays one unless the seam runs
    through it: then it becomes its triangles. The new file is binary.

    Args:
        source: the PLY file that was read.
        out: the PLY file that is written; it appears only when it is complete.
        parameterization: a map of the mesh's triangles, in the order of the file.
        places: (F, 3) for each corner of the triangles, its place among the polygons' corners.
        picture: name of the picture beside it, or None.

    Returns:
        The number of polygons that became triangles.
    """
    comments, tables = opened(plain(source.read_bytes()))
    by_name = {table.name: table for table in tables if table.name not in POLYGONS or table.count}
    faces = by_name["face"]
    indices = next(name for name in faces.columns if name in INDICES)
    corners, sizes = faces.columns[indices].values.astype(np.int64), faces.columns[indices].sizes
    assert sizes is not None
    row, is_split = corner_rows(places, parameterization.corners)
    polygon = np.searchsorted(np.cumsum(sizes), places[:, 0], side="right")
    is_broken = np.zeros(len(sizes), dtype=bool)
    is_broken[polygon[is_split]] = True

    # Runs of corners: those of whole polygons, and those of the triangles of broken ones.
    whole = np.flatnonzero(~is_broken[np.repeat(np.arange(len(sizes)), sizes)])
    cut = np.flatnonzero(is_broken[polygon])
    vertex = np.concatenate([corners[whole], corners[places[cut]].reshape(-1)])
    uv_row = np.concatenate([row[whole], parameterization.corners[cut].reshape(-1)])
    of = np.concatenate([np.flatnonzero(~is_broken), polygon[cut]])
    length = np.concatenate([sizes[~is_broken], np.full(len(cut), 3)])
    starts = np.cumsum(length) - length
    order = np.argsort(of, kind="stable")
    run = ranges(starts[order], length[order])
    vertex, uv_row, of, length = vertex[run], uv_row[run], of[order], length[order]

    index, first = _copies(vertex, uv_row, by_name["vertex"].count)
    uv = np.zeros((len(first), 2))
    uv[index] = parameterization.uv[uv_row]
    vertices = by_name["vertex"].rows(first)
    old = next((set(pair) for pair in UV_COLUMNS if set(pair) <= set(vertices.columns)), set())
    for name in old:
        del vertices.columns[name]
    vertices.columns |= {name: Column(uv[:, k]) for k, name in enumerate("st")}
    kept = {name: of_all for name, of_all in faces.columns.items() if name not in FACE_UV}
    polygons = Table("face", faces.count, kept).rows(of)
    polygons.columns[indices] = Column(index.astype(np.int32), length)
    polygons.columns["texcoord"] = Column(uv[index].astype(np.float32).reshape(-1), 2 * length)

    lines = [PICTURE + picture] if picture else []
    lines += [line for line in comments if not line.startswith(PICTURE)]
    new = {"vertex": vertices, "face": polygons}
    data = encoded(lines, [new.get(table.name, table) for table in tables])
    with complete_file(out) as file:
        file.write(data)
    return int(is_broken.sum())


def _copies(vertex: IntArray, row: IntArray, count: int) -> tuple[IntArray, IntArray]:
    """The new vertex of each corner, and the old one of each new vertex.

    A vertex keeps its number for the first of its uv rows; others get numbers from `count` on.
    """
    pairs, pair = np.unique(np.stack([vertex, row], axis=1), axis=0, return_inverse=True)
    again = np.zeros(len(pairs), dtype=bool)
    again[1:] = pairs[1:, 0] == pairs[:-1, 0]
    number = np.where(again, count + np.cumsum(again) - 1, pairs[:, 0])
    return number[pair.reshape(-1)], np.concatenate([np.arange(count), pairs[again, 0]])


def encoded(comments: list[str], tables: list[Table]) -> bytes:
    """A binary PLY file."""
    header = []
    for table in tables:
        header.append(f"element {table.name} {table.count}")
        for name, column in table.columns.items():
            kind = NAMES[column.values.dtype.str[1:]]
            size = "uchar" if column.longest < 256 else "int"
            header.append(
                f"property {kind if column.sizes is None else f'list {size} {kind}'} {name}"
            )
    notes = "".join(f"comment {line}\n" for line in comments).encode(errors="surrogateescape")
    text = "\n".join([*header, "end_header", ""]).encode("latin-1")
    begin = b"ply\nformat binary_little_endian 1.0\n"
    return begin + notes + text + b"".join(_table_bytes(table) for table in tables)


def _table_bytes(table: Table) -> bytes:
    """The rows of an element, one after the other."""
    parts: list[tuple[npt.NDArray[Any], IntArray]] = []  # values, and how many a row
    one = np.ones(table.count, dtype=np.int64)
    for column in table.columns.values():
        if column.sizes is not None:
            parts.append((column.sizes.astype("u1" if column.longest < 256 else "<i4"), one))
        little = column.values.astype(column.values.dtype.newbyteorder("<"))
        parts.append((little, one if column.sizes is None else column.sizes))
    widths = [values.dtype.itemsize * sizes for values, sizes in parts]
    row_size = np.sum(widths, axis=0, dtype=np.int64) if widths else 0 * one
    at = np.cumsum(row_size) - row_size
    made = np.empty(int(row_size.sum()), dtype=np.uint8)
    for (values, _), width in zip(parts, widths, strict=True):
        made[ranges(at, width)] = np.frombuffer(np.ascontiguousarray(values).tobytes(), np.uint8)
        at = at + width
    return made.tobytes()
