"""Points in text, XYZ and PTS: bytes in, `Content` without faces out."""

from __future__ import annotations

import numpy as np

from parapoint.errors import InputError
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
    """Text with x y z in each line; three further columns are normals if all have length 1."""
    lines = text_lines(data)
    if lines and len(lines[0].split()) == 1:
        lines = lines[1:]  # a count on its own, as scanners write it
    if not lines:
        raise InputError("has no point")
    if len(lines[0].split()) < 6:
        return points_content(table(lines, (0, 1, 2)))
    values = table(lines, (0, 1, 2, 3, 4, 5))
    normals = values[:, 3:]
    finite = np.isfinite(values).all(axis=1)
    length = np.linalg.norm(np.clip(normals[finite], -2, 2), axis=1)  # clipped: no overflow
    unit = bool(len(length)) and bool((np.abs(length - 1) < 1e-3).all())
    return points_content(values[:, :3], normals if unit else None)


def pts(data: bytes) -> Content:
    """PTS: lines "p x y z" (Hoppe), or a count and then x y z and what a scanner adds."""
    lines = text_lines(data)
    marked = [line for line in lines if line.startswith(b"p ")]
    return points_content(table(marked, (1, 2, 3))) if marked else xyz(data)
