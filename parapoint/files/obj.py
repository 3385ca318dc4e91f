"""Wavefront OBJ: bytes in, `Content` out."""

from __future__ import annotations

import re

import numpy as np

from parapoint.errors import InputError
from parapoint.files.content import NO_UV, Content, numbers, plain_numbers, word_counts
from parapoint.surfaces.surface import FloatArray, IntArray

V, VT, F = (b"v ", b"v\t"), (b"vt ", b"vt\t"), (b"f ", b"f\t")
FO = (b"fo ", b"fo\t")
FREE_FORM = (b"surf ", b"surf\t", b"curv ", b"curv\t", b"curv2 ", b"curv2\t")
"""Beginnings of the lines that are read."""


def obj(data: bytes) -> Content:
    """Wavefront OBJ: v, vt, f, fo; negative indices, polygons, UV on some corners or all."""
    text = plain_numbers(data)
    text = re.sub(rb"#[^\r\n]*", b"", text) if b"#" in text else text
    lines = [
        line.strip() for line in text.replace(b"\\\r\n", b" ").replace(b"\\\n", b" ").splitlines()
    ]
    # "fo" is what faces with a border were called before 1993; they are faces as others.
    lines = [b"f" + line[2:] if line.startswith(FO) else line for line in lines]
    if any(line.startswith(FREE_FORM) for line in lines) and not any(
        line.startswith(F) for line in lines
    ):
        raise InputError("holds curves or free-form surfaces and no face; export it as a mesh")
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
