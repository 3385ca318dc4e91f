"""Geomview OFF, text and binary: bytes in, `Content` out.

Ours, since trimesh does not know binary OFF.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Sequence
from itertools import chain
from typing import Any

import numpy as np
import numpy.typing as npt

from parapoint.errors import InputError
from parapoint.files.attributes import named_colours
from parapoint.files.content import FACE_COLOURS, Content, floats, integers, plain_numbers, ranges
from parapoint.surfaces.surface import FloatArray

logger = logging.getLogger("parapoint")

KINDS = re.compile(rb"(?:ST|C|N)*OFF")
"""First words of files with three coordinates: C tells of colours behind them, N of normals, ST of
texture coordinates. MeshLab orders the letters otherwise than Geomview."""
Rows = list[list[bytes]]


def off(data: bytes) -> Content:
    """Geomview OFF, text or binary: vertices with normals and colours, and faces without colours.

    A text has a vertex or a face in each line, or is laid out freely.
    """
    first, _, body = data.partition(b"\n")
    if first.split()[1:2] == [b"BINARY"]:
        return _binary_off(body)
    lines = [
        words
        for line in plain_numbers(data).splitlines()
        if (words := line.split(b"#", 1)[0].split())
    ]
    kind = b"OFF"
    if lines and lines[0][0].upper().endswith(b"OFF"):
        kind, *lines[0] = lines[0]  # the counts may stand beside the keyword
        if KINDS.fullmatch(kind.upper()) is None or b"nOFF" in kind:
            raise InputError(f"{kind[:20]!r} is no kind of OFF that has three coordinates")
    lines = [words for words in lines[:1] if words] + lines[1:]
    if not lines:
        raise InputError("has no OFF header")
    points, faces = _rows(lines, kind.upper())
    sizes = [int(face[0]) for face in faces]
    normals, attributes = _behind(kind.upper(), points)
    corners = (face[1 : 1 + size] for size, face in zip(sizes, faces, strict=True))
    return Content(
        floats(chain.from_iterable(point[:3] for point in points), 3),
        integers(sizes),
        integers(chain.from_iterable(corners)),
        normals,
        attributes=attributes,
        extras=(
            *([FACE_COLOURS] if any(face[1 + int(face[0]) :] for face in faces) else []),
            *(["old UVs"] if b"ST" in kind.upper() else []),
        ),
    )


def _rows(lines: Rows, kind: bytes) -> tuple[Rows, Rows]:
    """The words of each vertex and of each face.

    Raises:
        InputError: there are not as many as the first line announces.
    """
    vertex_count, face_count = _counts(lines[0])
    count = vertex_count + face_count
    points, faces = lines[1 : 1 + vertex_count], lines[1 + vertex_count : 1 + count]
    fault = ""
    if count > len(lines) - 1:
        fault = (
            f"ends early: {vertex_count} vertices and {face_count} faces are announced, "
            f"{len(lines) - 1} lines follow"
        )
    elif any(len(point) < 3 for point in points):
        fault = "a vertex has fewer than three coordinates"
    elif any(not 0 <= int(face[0]) < len(face) for face in faces):
        fault = "a face has fewer corners than it announces"
    left = len(lines) - 1 - count
    if left or fault:
        words = [*lines[0][3:], *chain.from_iterable(lines[1:])]
        width = 3 + 3 * (b"N" in kind) + 4 * (b"C" in kind) + 2 * (b"ST" in kind)
        free = _free_rows(words, vertex_count, face_count, width)
        if free is not None:
            return free
    if fault:
        raise InputError(fault)
    if left:
        logger.warning("lines behind the last face left out: %d", left)
    return points, faces


def _free_rows(
    words: list[bytes], vertex_count: int, face_count: int, width: int
) -> tuple[Rows, Rows] | None:
    """The same of words that stand in any lines; None where they do not fill them exactly.

    Args:
        words: those behind the counts.
        vertex_count: number of vertices.
        face_count: number of faces, which have no colours.
        width: words of a vertex.
    """
    at = vertex_count * width
    if at > len(words):
        return None
    points = [words[k : k + width] for k in range(0, at, width)]
    faces: Rows = []
    while at < len(words) and len(faces) < face_count and words[at].isdigit():
        faces.append(words[at : at + 1 + int(words[at])])
        at += 1 + int(words[at])
    return (points, faces) if at == len(words) and len(faces) == face_count else None


def _behind(kind: bytes, points: Rows) -> tuple[FloatArray | None, dict[str, npt.NDArray[Any]]]:
    """Normals and colours, which stand in this order behind the coordinates; MeshLab turns it."""
    widths = {len(point) for point in points}
    if max(widths, default=3) == 3:
        return None, {}
    width = min(widths) - 3 - 2 * (b"ST" in kind)
    colour = width - 3 * (b"N" in kind)
    if len(widths) > 1 or colour not in ({3, 4} if b"C" in kind else {0}):
        logger.warning(
            "numbers behind the coordinates left out: they do not fit the kind %s", kind.decode()
        )
        return None, {}
    values = floats(chain.from_iterable(point[3 : 3 + width] for point in points), max(width, 1))
    normals = None
    if b"N" in kind:
        is_turned = b"C" in kind and not _are_unit(values[:, :3]) and _are_unit(values[:, -3:])
        values = np.roll(values, 3, axis=1) if is_turned else values
        normals, values = values[:, :3], values[:, 3:]
    colours = named_colours(values) if b"C" in kind else None
    return normals, {} if colours is None else {"colours": colours}


def _are_unit(vectors: FloatArray) -> bool:
    """Whether all vectors (n, 3) have length 1."""
    return bool((np.abs(np.linalg.norm(vectors, axis=1) - 1) < 1e-2).all())


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
            has_colours = coloured and len(words) - start > sizes.sum() + 2 * face_count
            return Content(
                words[3:start].view(f"{order}f4").astype(np.float64).reshape(-1, 3),
                sizes,
                words[start + ranges(starts, sizes)].astype(np.int64),
                extras=(FACE_COLOURS,) if has_colours else (),
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
