"""Points in text, XYZ and PTS: bytes in, `Content` without faces out."""

from __future__ import annotations

import logging
import re
from typing import Any

import numpy as np
import numpy.typing as npt

from parapoint.errors import InputError
from parapoint.files.attributes import colours_of
from parapoint.files.content import Content, plain_numbers, points_content
from parapoint.surfaces.surface import FloatArray

logger = logging.getLogger("parapoint")

LOOKED_AT = 20_000
"""Lines, spread over the file, by which the meaning of its commas is told."""
DECIMAL_COMMA = re.compile(rb"[+-]?\d*,\d+(?:[eE][+-]?\d+)?$|[+-]?\d+$")
"""A word with one comma at most, as it is written where the comma marks decimals."""
GROUPED = re.compile(rb"[+-]?\d{1,3}(?:,\d{3})+\.\d*$")
"""A number whose thousands are parted by commas; 1,234.5."""
GROUPED_WHOLE = re.compile(rb"[+-]?\d{1,3}(?:,\d{3})+$")
"""The same without a fraction; beside others that have one."""
GROUPED_BY_POINTS = re.compile(rb"[+-]?\d{1,3}(?:\.\d{3})+,\d*$")
"""The same as it is written where the comma marks decimals; 1.234,5."""

AXES = {
    **dict.fromkeys(("easting", "east"), "x"),
    **dict.fromkeys(("northing", "north"), "y"),
    **dict.fromkeys(("elevation", "height", "altitude"), "z"),
}
"""What surveyors write over the columns of x, y and z."""


def table(lines: list[bytes], columns: tuple[int, ...]) -> FloatArray:
    """(n, len(columns)) numbers in these columns of text lines; empty for no lines."""
    if not lines:
        return np.zeros((0, len(columns)))
    text = (line.decode("latin-1") for line in lines)  # no second copy of millions of lines
    return np.loadtxt(text, comments="#", usecols=columns, ndmin=2, dtype=np.float64)


def text_lines(data: bytes) -> list[bytes]:
    """Lines that hold more than blanks and comments, with points for decimals, blanks between.

    Raises:
        InputError: commas part numbers or mark decimals, and it cannot be told which.
    """
    data = plain_numbers(data)
    lines = [
        line
        for line in data.translate(None, b'"').replace(b";", b" ").splitlines()
        if line.strip() and not line.lstrip().startswith((b"#", b"//"))
    ]
    if b"," not in data:
        return lines
    looked_at = [line for line in lines[:: len(lines) // LOOKED_AT + 1] if re.search(rb"\d", line)]
    # A comma with a blank behind it parts numbers, whatever those inside words do.
    words = [re.sub(rb",(?=\s|$)", b" ", line).split() for line in looked_at]
    with_comma = [word for line in words for word in line if b"," in word]
    if with_comma and _marks_decimals(words, with_comma):
        points = any(GROUPED_BY_POINTS.match(word) for word in with_comma)
        spaced = (re.sub(rb",(?=\s|$)", b" ", line) for line in lines)
        if points:
            spaced = (line.replace(b".", b"") for line in spaced)
        return [line.replace(b",", b".") for line in spaced]
    grouped = any(GROUPED.match(word) for word in with_comma) and all(
        GROUPED.match(word) or GROUPED_WHOLE.match(word) for word in with_comma
    )
    if grouped and min(map(len, words)) >= 3:
        return [re.sub(rb",(?=\d)", b"", line).replace(b",", b" ") for line in lines]
    return [line.replace(b",", b" ") for line in lines]


def _marks_decimals(words: list[list[bytes]], with_comma: list[bytes]) -> bool:
    """Whether the commas inside words mark decimals.

    Args:
        words: of each line.
        with_comma: those that hold a comma.
    """
    fewest = min(map(len, words))
    if fewest >= 3:
        if all(DECIMAL_COMMA.match(word) or GROUPED_BY_POINTS.match(word) for word in with_comma):
            return True
        if any(b"." in word or word.count(b",") > 1 for word in with_comma):
            return False
    # One run of whole numbers: 1,5,2,5,3,5 may be three numbers or six.
    parts = [word.split(b",") for word in with_comma]
    if {len(line) for line in words if not any(b"," in word for word in line)} & set(
        map(len, parts)
    ):
        return False  # other lines have as many numbers, parted by blanks
    is_whole = all(part.lstrip(b"+-").isdigit() for word in parts for part in word)
    signed = any(part.startswith((b"+", b"-")) for word in parts for part in word[1::2])
    if is_whole and not signed and (fewest > 1 or max(map(len, parts)) >= 6):
        raise InputError(
            "has commas of which it cannot be told whether they part numbers or mark decimals; "
            "write decimals with points, and blanks between the numbers"
        )
    return False


def point_lines(data: bytes) -> tuple[list[bytes], list[str]]:
    """Lines with numbers, and the names of their columns, [] where none are given.

    Left out are a heading, a line of units below it, and the counts before each scan.

    Raises:
        InputError: there is no point, or it is PTX; see `text_lines`.
    """
    lines = text_lines(data)
    _refuse_ptx(lines)
    lines = [line for line in lines if not line.strip().isdigit()]
    comment = data.lstrip().split(b"\n", 1)[0]
    heading = comment if comment.startswith((b"#", b"//")) else b""
    for _ in range(2):
        if lines and not any(map(_is_number, lines[0].split())):
            heading = heading if _names(heading) else lines[0]
            lines = lines[1:]
    if not lines:
        raise InputError("has no point")
    return lines, _names(heading)


def _refuse_ptx(lines: list[bytes]) -> None:
    """Refuse Leica's PTX, where the pose of a scan in ten lines would be read as points."""
    words = [line.split() for line in lines[:10]]
    if [len(line) for line in words] == [1, 1, 3, 3, 3, 3, 4, 4, 4, 4] and all(
        line[0].isdigit() for line in words[:2]
    ):
        raise InputError("is PTX, whose scans have places of their own; export it as PTS or PLY")


def _is_number(word: bytes) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _names(heading: bytes) -> list[str]:
    """The names of columns in a line that has x, y and z among them; [] of any other line.

    Units in brackets are left out; what surveyors call the axes is x, y and z.
    """
    text = re.sub(r"[\[(][^\])]*[\])]", "", heading.decode("latin-1").lower())
    words = re.findall(r"[^\s,;\"]+", text.lstrip("#/ \t"))
    names = [AXES.get(word, word) for word in words]
    return names if {"x", "y", "z"} <= set(names) else []


def xyz(data: bytes) -> Content:
    """Text with x y z in each line, and whatever columns a scanner adds; see `_further_columns`."""
    lines, names = point_lines(data)
    try:
        values = table(lines, tuple(range(len(lines[0].split()))))
    except ValueError:  # words, or not in all lines: the coordinates alone
        values = table(lines, (0, 1, 2))
    if values.shape[1] < 3:
        raise InputError("has fewer than three numbers in a line")
    values = values[:, _coordinates_first(names, values)]
    return points_content(values[:, :3], *_further_columns(values))


def _coordinates_first(names: list[str], values: FloatArray) -> list[int]:
    """The columns in the order x, y, z and others, by their names if all have one.

    Without names a first column that numbers the rows is left out, and a warning says so.
    """
    columns = list(range(values.shape[1]))
    if len(names) == len(columns):
        at = [names.index(name) for name in "xyz"]
        return at + [column for column in columns if column not in at]
    number = values[:, 0]
    if len(columns) > 3 and len(number) > 2 and number[0] in {0, 1}:
        others_are_whole = (values[:, 1:4] == np.floor(values[:, 1:4])).all()
        if (np.diff(number) == 1).all() and not others_are_whole:
            logger.warning("the first column numbers the rows: the coordinates are behind it")
            return columns[1:]
    return columns


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
    """PTS: lines "p x y z" (Hoppe), or of each scan a count, x y z and what a scanner adds.

    Raises:
        InputError: a scan has fewer points than its count announces; see `xyz`.
    """
    lines = text_lines(data)
    marked = [line for line in lines if line.startswith(b"p ")]
    if marked:
        return points_content(table(marked, (1, 2, 3)))
    _refuse_ptx(lines)
    counts = [at for at, line in enumerate(lines) if line.strip().isdigit()]
    if counts[:1] == [0]:
        for at, after in zip(counts, [*counts[1:], len(lines)], strict=True):
            announced, found = int(lines[at]), after - at - 1
            if found < announced:
                raise InputError(f"ends early: {announced} points are announced, {found} are there")
    return xyz(data)
