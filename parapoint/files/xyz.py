"""Points in text, XYZ and PTS: bytes in, `Content` without faces out."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from parapoint.errors import InputError
from parapoint.files.attributes import colours_of
from parapoint.files.content import Content, points_content
from parapoint.surfaces.surface import FloatArray


def table(lines: list[bytes], columns: tuple[int, ...]) -> FloatArray:
    """(n, len(columns)) numbers in these columns of text lines; empty for no lines."""
    if not lines:
        return np.zeros((0, len(columns)))
    text = (line.decode("latin-1") for line in lines)  # no second copy of millions of lines
    return np.loadtxt(text, comments="#", usecols=columns, ndmin=2, dtype=np.float64)


def text_lines(data: bytes) -> list[bytes]:
    """Lines that hold more than blanks and comments, commas turned into blanks."""
    return [
        line
        for line in data.replace(b",", b" ").splitlines()
        if line.strip() and not line.lstrip().startswith((b"#", b"//"))
    ]


def xyz(data: bytes) -> Content:
    """Text with x y z in each line, and whatever columns a scanner adds; see `_further_columns`."""
    lines = text_lines(data)
    if lines and len(lines[0].split()) == 1:
        lines = lines[1:]  # a count on its own, as scanners write it
    if not lines:
        raise InputError("has no point")
    try:
        values = table(lines, tuple(range(len(lines[0].split()))))
    except ValueError:  # words, or not in all lines: the coordinates alone
        values = table(lines, (0, 1, 2))
    if values.shape[1] < 3:
        raise InputError("has fewer than three numbers in a line")
    return points_content(values[:, :3], *_further_columns(values))


def _further_columns(
    values: FloatArray,
) -> tuple[FloatArray | None, dict[str, npt.NDArray[Any]]]:
    """Normals, or None, and attributes in the columns behind x y z of (P, 3 + k) numbers.

    Three columns together are normals where all have length 1, and colours where all are whole
    numbers from 0 to 255 or fractions from 0 to 1. Single columns come before them, as in PTS: the
    first is the intensity.
    """
    finite = np.isfinite(values).all(axis=1)
    normals: FloatArray | None = None
    attributes: dict[str, npt.NDArray[Any]] = {}
    columns = values.shape[1]
    single = (columns - 3) % 3
    for at in range(3, 3 + single):
        attributes["intensity" if at == 3 else f"column{at + 1}"] = values[:, at]
    for at in range(3 + single, columns, 3):
        three = values[:, at : at + 3]
        length = np.linalg.norm(np.clip(three[finite], -2, 2), axis=1)  # clipped: no overflow
        colours = colours_of(three)
        if normals is None and len(length) and (np.abs(length - 1) < 1e-3).all():
            normals = three
        elif "colours" not in attributes and colours is not None and colours.dtype != np.uint16:
            attributes["colours"] = colours
        else:
            attributes |= {f"column{at + k + 1}": three[:, k] for k in range(3)}
    return normals, attributes


def pts(data: bytes) -> Content:
    """PTS: lines "p x y z" (Hoppe), or a count and then x y z and what a scanner adds."""
    lines = text_lines(data)
    marked = [line for line in lines if line.startswith(b"p ")]
    return points_content(table(marked, (1, 2, 3))) if marked else xyz(data)
