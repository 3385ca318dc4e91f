"""What a file holds, and what its readers share: numbers from text, strips, welding."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from parapoint.errors import InputError
from parapoint.surfaces.places import places
from parapoint.surfaces.surface import FloatArray, IntArray

NO_UV = np.iinfo(np.int64).min
"""Row of `Content.uv_corners` at a corner without UV."""
NOT_A_NUMBER = re.compile(
    rb"[+-]?\d\.#(?:INF|IND|QNAN|SNAN|IO|QO|J|R|T)\d*|[+-]?nan\([a-z]*\)", re.IGNORECASE
)
"""What programs of Windows write for what is infinite or no number: 1.#QNAN, -1.#IND, -nan(ind)."""
FORTRAN_EXPONENT = re.compile(rb"[dD](?<=[\d.].)(?=[+-]?\d{1,3}(?![\w.]))")
"""The letter in 1.5D+03, a double as Fortran writes it."""


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
        rows: (V,) row of each point among those of the file, where some were left out.
        extras: what else a mesh file holds, in words.
    """

    vertices: FloatArray
    sizes: IntArray
    corners: IntArray
    normals: FloatArray | None = None
    uv: FloatArray | None = None
    uv_corners: IntArray | None = None
    attributes: dict[str, npt.NDArray[Any]] = field(default_factory=dict)
    rows: IntArray | None = None
    extras: tuple[str, ...] = ()


FACE_COLOURS = "colours of faces"
"""How `Content.extras` calls them."""


def points_content(
    points: FloatArray,
    normals: FloatArray | None = None,
    attributes: dict[str, npt.NDArray[Any]] | None = None,
) -> Content:
    """The content of a file without faces."""
    none = np.zeros(0, dtype=np.int64)
    return Content(points, none, none, normals, attributes=attributes or {})


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


def plain_numbers(text: bytes) -> bytes:
    """The text with its numbers spelled as most programs spell them: nan, and e in exponents."""
    if b".#" in text or b"(" in text:
        text = NOT_A_NUMBER.sub(b"nan", text)
    return FORTRAN_EXPONENT.sub(b"e", text)


def word_counts(text: bytes, line_count: int) -> IntArray:
    """(line_count,) number of words in each of the lines of a text."""
    if line_count == 0:
        return np.zeros(0, dtype=np.int64)
    characters = np.frombuffer(text, dtype=np.uint8)
    blank = characters <= 32
    first = ~blank & np.concatenate([[True], blank[:-1]])
    line = np.searchsorted(np.flatnonzero(characters == ord("\n")), np.flatnonzero(first))
    return np.bincount(line, minlength=line_count)


def numbers(text: bytes, kind: type[np.float64 | np.int64]) -> npt.NDArray[Any]:
    """All numbers of a text, read fast, since a mesh has a million of them.

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


def welded(points: FloatArray) -> tuple[FloatArray, IntArray]:
    """The distinct points in the order in which they first appear, and the row of each point.

    Points are one only where their coordinates are exactly equal: a reader changes nothing
    (`Mesh.welded` has a tolerance).
    """
    place = places(points)
    first = np.unique(place, return_index=True)[1]
    rank = np.argsort(np.argsort(first))
    return points[np.sort(first)], rank[place]
