"""Wavefront OBJ: bytes in, `Content` out."""

from __future__ import annotations

import logging
import re
from typing import Any

import numpy as np
import numpy.typing as npt

from parapoint.errors import InputError
from parapoint.files.attributes import COLOUR_COLUMNS, named_attributes
from parapoint.files.content import NO_UV, Content, numbers, plain_numbers, word_counts
from parapoint.surfaces.surface import FloatArray, IntArray

V, VT, VN = (b"v ", b"v\t"), (b"vt ", b"vt\t"), (b"vn ", b"vn\t")
F = (b"f ", b"f\t")
FO = (b"fo ", b"fo\t")
"""Beginnings of the lines that are read."""
NO_SURFACE = tuple(
    word + blank for word in (b"l", b"surf", b"curv", b"curv2") for blank in (b" ", b"\t")
)
"""Beginnings of lines of curves and free-form surfaces, which are not read."""
NOT_SMOOTH = (b"s off", b"s 0")
"""Lines that end a smoothing group and begin none."""
EXTRAS = {
    b"vn": "normals",
    b"o": "objects",
    b"g": "groups",
    b"s": "smoothing groups",
    b"usemtl": "materials",
    b"l": "lines",
    b"p": "points",
    b"curv": "curves",
    b"curv2": "curves",
    b"surf": "free-form surfaces",
}
"""First words of lines whose content no mesh holds, and what that is called."""
CONTINUED = re.compile(
    rb"\\[ \t]*(?:#[^\r\n]*)?(?:\r\n|\r|\n|\Z)([ \t]*(?:v[tnp]?|fo?|l|p|usemtl|mtllib)[ \t])?"
    rb"|#[^\r\n]*"
)
"""A backslash at the end of a line, and the word behind it where no line goes on; a comment."""

logger = logging.getLogger("parapoint")


def obj_lines(data: bytes) -> list[bytes]:
    """The lines of an OBJ file or a material library; those that go on after a backslash are one.

    No comment goes on, though it may end in a backslash.
    """
    if b"\\" in data:
        data = CONTINUED.sub(_joined, data)
    return data.splitlines()


def _joined(found: re.Match[bytes]) -> bytes:
    """What takes the place of a match of CONTINUED."""
    if found[0].startswith(b"#"):
        return found[0]
    return b" " if found[1] is None else b"\n" + found[1]


def obj(data: bytes) -> Content:
    """Wavefront OBJ: v, vt, f, fo; negative indices, polygons, UV on some corners or all.

    Colours behind the coordinates are attributes; vn lines are normals where there is no face.
    """
    lines = [line.split(b"#", 1)[0].strip() for line in obj_lines(plain_numbers(data))]
    # "fo" is what faces with a border were called before 1993; they are faces as others.
    lines = [b"f" + line[2:] if line.startswith(FO) else line for line in lines]
    has_faces = any(line.startswith(F) for line in lines)
    if not has_faces and any(line.startswith(NO_SURFACE) for line in lines):
        raise InputError(
            "holds lines, curves or free-form surfaces and no face; export it as a mesh"
        )
    points, point_sizes = _rows([line[1:] for line in lines if line.startswith(V)])
    if not len(point_sizes):
        raise InputError(f"has no point: {_why_pointless(data)}")
    uvs, uv_sizes = _rows([line[2:] for line in lines if line.startswith(VT)])
    if point_sizes.min() < 3:
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
    content = Content(vertices, sizes, corners - 1, attributes=_colours(points, point_sizes))
    words = {line.split(None, 1)[0] for line in lines if line and line not in NOT_SMOOTH}
    content.extras = tuple(dict.fromkeys(name for word, name in EXTRAS.items() if word in words))
    if not has_faces:
        normals = [line[2:] for line in lines if line.startswith(VN)]
        content.normals = _normals(normals, len(vertices))
    if len(uv_sizes):
        starts = np.cumsum(uv_sizes) - uv_sizes
        second = np.where(uv_sizes > 1, starts + 1, starts)
        content.uv = np.stack([uvs[starts], np.where(uv_sizes > 1, uvs[second], 0.0)], axis=1)
        content.uv_corners = np.where(uv_corners == 0, NO_UV, uv_corners - 1)
    elif uv_corners.any():
        raise InputError("faces refer to texture coordinates, but the file has no vt line")
    return content


def _why_pointless(data: bytes) -> str:
    """Why no line of a file is a v line, as far as its first lines show it."""
    if b"\0" in data[:2]:
        return "it looks like UTF-16 without a byte order mark; save it in UTF-8"
    if re.search(rb"(?:^|[\r\n])[ \t]*V[ \t]", data):
        return "its keywords are in upper case; write v, vt and f"
    first = data.split(None, 1)[0][:20].decode("latin-1")
    return f"no line begins with v; the file begins with {first!r}. Is it an OBJ file?"


def _colours(points: FloatArray, sizes: IntArray) -> dict[str, npt.NDArray[Any]]:
    """What stands behind the coordinates of all v lines: r g b or r g b a; a weight is left."""
    if (sizes < 6).all():
        return {}
    width = int(sizes[0])
    if width > 7 or (sizes != width).any():
        logger.warning("colours of vertices are left out: not all v lines hold x y z r g b")
        return {}
    columns = points.reshape(-1, width)[:, 3:].T
    return named_attributes(dict(zip(COLOUR_COLUMNS[0], columns, strict=False)))


def _normals(lines: list[bytes], count: int) -> FloatArray | None:
    """(count, 3) normals of points, where there is one for each; None where there is none."""
    normals, sizes = _rows(lines)
    if not len(sizes):
        return None
    if len(sizes) != count or (sizes != 3).any():
        logger.warning("normals are left out: not each of %d points has a vn line x y z", count)
        return None
    return normals.reshape(-1, 3)


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
