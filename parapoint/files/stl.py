"""STL, text and binary, by trimesh: bytes in, `Content` out."""

from __future__ import annotations

import io
import re

import numpy as np

from parapoint.errors import InputError
from parapoint.files.content import Content, welded

NAMED = re.compile(rb"^([ \t]*(?:end)?solid)\b.*", re.IGNORECASE | re.MULTILINE)
"""A line of a text STL that may end with the name of the solid."""


def stl(data: bytes) -> Content:
    """STL, text or binary: a soup of triangles, whose corners are welded where they are equal."""
    from trimesh.exchange.stl import load_stl

    size = 84 + 50 * int.from_bytes(data[80:84], "little")
    if 84 < size < len(data) and b"facet" not in data[:size].lower():
        data = data[:size]  # some tools append what they know of the part
    elif len(data) != size and data.lstrip()[:5].lower() == b"solid":
        lines = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
        data = NAMED.sub(rb"\1", lines)  # a name may hold the words of the format
    parts = load_stl(io.BytesIO(data))
    solids = list(parts["geometry"].values()) if "geometry" in parts else [parts]
    soup = [np.asarray(solid["vertices"])[solid["faces"]].reshape(-1, 3) for solid in solids]
    if not any(map(len, soup)):
        raise InputError("has no triangle")
    vertices, corners = welded(np.concatenate(soup).astype(np.float64))
    return Content(vertices, np.full(len(corners) // 3, 3), corners)
