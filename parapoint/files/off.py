"""Geomview OFF, text and binary: bytes in, `Content` out.

Ours, since trimesh does not know binary OFF.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain

import numpy as np

from parapoint.errors import InputError
from parapoint.files.content import Content, floats, integers, plain_numbers, ranges


def off(data: bytes) -> Content:
    """Geomview OFF, text or binary; what follows x y z or a face's indices (colours) is left."""
    first, _, body = data.partition(b"\n")
    if first.split()[1:2] == [b"BINARY"]:
        return _binary_off(body)
    lines = [
        words
        for line in plain_numbers(data).splitlines()
        if (words := line.split(b"#", 1)[0].split())
    ]
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
