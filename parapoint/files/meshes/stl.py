"""STL, text and binary: bytes in, `Content` out.

Ours, since trimesh takes what is cut off or counted wrongly for a file without triangles.
"""

from __future__ import annotations

import logging
import re

import numpy as np

from parapoint.errors import InputError
from parapoint.files.content import Content, numbers, plain_numbers, welded
from parapoint.surfaces.surface import FloatArray

logger = logging.getLogger("parapoint")

NAMED = re.compile(rb"^([ \t]*(?:end)?solid)\b.*", re.MULTILINE)
"""A line of a text STL that may end with the name of the solid, which may hold the words of the
format."""
SOLID = re.compile(rb"^[ \t]*solid\b", re.MULTILINE | re.IGNORECASE)
HEADER = 84
"""Bytes before the triangles of a binary file; the last four are their number."""
TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", 9), ("attribute", "<u2")])


def stl(data: bytes) -> Content:
    """STL, text or binary: a soup of triangles, whose corners are welded where they are equal."""
    announced = int.from_bytes(data[80:HEADER], "little")
    size = HEADER + TRIANGLE.itemsize * announced
    is_text = len(data) != size and b"facet" in data.lower()
    if HEADER < size < len(data) and b"facet" not in data[:size].lower():
        is_text = False  # some tools append what they know of the part
        logger.warning("bytes behind the last triangle left out: %d", len(data) - size)
    soup = _text(data.lower()) if is_text else _binary(data, announced)
    vertices, corners = welded(soup.reshape(-1, 3))
    content = Content(vertices, np.full(len(corners) // 3, 3), corners)
    if not is_text and np.frombuffer(data, TRIANGLE, announced, HEADER)["attribute"].any():
        content.extras = ("attributes of triangles",)
    elif is_text and len(SOLID.findall(data)) > 1:
        content.extras = ("solids",)
    return content


def _binary(data: bytes, announced: int) -> FloatArray:
    """(9 n,) the corners in a binary file that announces this many triangles."""
    if len(data) < HEADER:
        raise InputError("has no triangle")
    found = (len(data) - HEADER) // TRIANGLE.itemsize
    if announced > found or (announced == 0 and found):
        raise InputError(
            f"as a binary STL it announces {announced} triangles, and has room for {found}: "
            "it is cut off, or the count is wrong"
        )
    if not announced:
        raise InputError("has no triangle")
    return np.frombuffer(data, TRIANGLE, announced, HEADER)["corners"].astype(np.float64)


def _text(text: bytes) -> FloatArray:
    """(9 n,) the corners in a text in lower case."""
    text = NAMED.sub(rb"\1", plain_numbers(text.replace(b"\r\n", b"\n").replace(b"\r", b"\n")))
    facets = text.count(b"facet") - text.count(b"endfacet")
    if text.rfind(b"endsolid") < text.rfind(b"facet"):
        raise InputError("ends early: no 'endsolid' is behind its last facet")
    words = (part.split(None, 3)[:3] for part in text.split(b"vertex")[1:])
    corners = numbers(b" ".join(word for three in words for word in three), np.float64)
    if len(corners) != 9 * facets:
        raise InputError(f"has {len(corners)} coordinates in {facets} facets, where 9 each belong")
    if not facets:
        raise InputError("has no triangle")
    return corners
