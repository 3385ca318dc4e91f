"""What the columns of a text mean: x, y and z by its heading or their order, and the rest."""

from __future__ import annotations

import logging
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from parapoint.errors import InputError
from parapoint.files.attributes import colours_of, named_attributes, taken_normals
from parapoint.files.clouds.headings import Heading
from parapoint.files.content import Content, points_content
from parapoint.surfaces.surface import FloatArray

logger = logging.getLogger("parapoint")

ELEMENTS = 118
"""The largest atomic number."""
RESERVED = {"colours", "normals", "points", "vertices", "faces", "corners", "uv", "file"}
"""What no single column is called, since these are arrays or arguments elsewhere."""
UNEVEN = (
    "has lines with more and with fewer columns, so it cannot be told where x, y and z are: "
    "write nan where a number is missing"
)


class Columns(NamedTuple):
    """The columns of a text that are read.

    Attributes:
        axes: those of x, y and z.
        others: further ones that hold numbers.
        names: of all columns, or [] where they are not told.
        is_whole: whether these are all columns, of numbers alone, as many in each line.
        may_vary: whether x, y and z are where they are also in lines of more or fewer columns.
    """

    axes: list[int]
    others: list[int]
    names: list[str]
    is_whole: bool
    may_vary: bool

    def content(self, values: FloatArray, *, has_intensity: bool) -> Content:
        """What the numbers (P, 3 + k) in the columns `axes` and `others` mean.

        Args:
            values: the numbers.
            has_intensity: whether the first single column is the intensity by rule, as in PTS.
        """
        filled = [k for k in range(3, values.shape[1]) if not np.isnan(values[:, k]).all()]
        if not self.names:
            known = values[:, [0, 1, 2, *filled]]
            return points_content(known[:, :3], *_further_columns(known, has_intensity))
        columns: dict[str, npt.NDArray[Any]] = {}
        for k in filled:
            at = self.others[k - 3]
            name = self.names[at]
            is_free = name and name not in RESERVED and name not in columns
            columns[name if is_free else f"column{at + 1}"] = values[:, k]
        return points_content(values[:, :3], taken_normals(columns), named_attributes(columns))


def columns_of(
    headings: list[Heading], sample: list[list[bytes]], step: int, is_exact: bool
) -> Columns:
    """Which columns to read.

    Args:
        headings: the lines before the rows.
        sample: the words of every so many rows, three or more of each.
        step: from one row of the sample to the next one.
        is_exact: whether marks part the cells, so that none is missing within a line.

    Raises:
        InputError: it cannot be told which columns are x, y and z.
    """
    widths = {len(words) for words in sample}
    least = min(widths)
    numeric = [k for k in range(least) if all(is_number(words[k]) for words in sample)]
    is_number_of_row = least > 3 and 0 in numeric and _counts(sample, step)
    axes, names = _named(headings, widths, is_exact, is_number_of_row or 0 not in numeric)
    if not axes:
        if {0, 1, 2} <= set(numeric):
            _say_unnamed(headings, widths)
        axes = [0, 1, 2]
        if is_number_of_row and not _are_whole(sample):
            logger.warning("the first column numbers the rows: the coordinates are behind it")
            axes = [1, 2, 3]
    may_vary = is_exact or sorted(axes) == [0, 1, 2]
    is_whole = len(numeric) == least
    if is_whole and not may_vary and any(is_number(row[least]) for row in sample if row[least:]):
        raise InputError(UNEVEN)
    others = [k for k in numeric if k not in axes and (k or names or axes != [1, 2, 3])]
    return Columns(axes, others, names, is_whole and len(widths) == 1, may_vary)


def is_number(word: bytes) -> bool:
    """Whether a word is a number, nan or infinite."""
    try:
        float(word)
    except ValueError:
        return False
    return True


def _counts(sample: list[list[bytes]], step: int) -> bool:
    """Whether the first column of these rows, every so many of a file, counts all its rows."""
    number = np.array([float(words[0]) for words in sample])
    return len(number) > 2 and bool((np.diff(number) == step).all())


def _are_whole(sample: list[list[bytes]], last: int = 4) -> bool:
    """Whether the columns from 2 to the last of these rows hold whole numbers alone."""
    words = (word for row in sample for word in row[1:last])
    return all(is_number(word) and float(word).is_integer() for word in words)


def are_atoms(head: list[bytes], count: int, sample: list[list[bytes]]) -> bool:
    """Whether rows are atoms: their count, a comment, then in each row a number of its element.

    Args:
        head: the lines before the rows.
        count: how many rows there are.
        sample: the words of some of them.
    """
    if len(head) != 2 or head[0].strip() != b"%d" % count or head[1].strip().isdigit():
        return False
    is_element = all(
        len(row) > 3 and row[0].isdigit() and 0 < int(row[0]) <= ELEMENTS for row in sample
    )
    return is_element and not _are_whole(sample, 2)


def _named(
    headings: list[Heading], widths: set[int], is_exact: bool, is_row_named: bool
) -> tuple[list[int], list[str]]:
    """The columns of x, y and z by a heading, and the names of all; [] for what is not told.

    Args:
        headings: the lines before the rows.
        widths: the numbers of columns of the rows.
        is_exact: see `columns_of`.
        is_row_named: whether the first column is the number of the row, or a word.

    Raises:
        InputError: a heading has these names, but does not fit the rows.
    """
    least = min(widths)
    for heading in reversed(headings):
        if not heading.axes:
            continue
        axes, names = _fitted(heading, widths, is_exact, is_row_named)
        if axes and heading.is_degrees:
            logger.warning("x and y are longitude and latitude, but degrees are no lengths")
        if axes:
            return axes, names
        if least > 3 and not heading.is_comment:
            raise InputError(
                f"has a heading of {len(heading.names)} names over {least} columns; "
                "give each column a name, and write no blanks in it"
            )
    return [], []


def _fitted(
    heading: Heading, widths: set[int], is_exact: bool, is_row_named: bool
) -> tuple[list[int], list[str]]:
    """The same by one heading that names x, y and z."""
    axes, names, least = heading.axes, heading.names, min(widths)
    count = len(names)
    if count in widths and not heading.is_sentence:
        return axes, names
    if count + 1 == least and 0 in axes and is_row_named:  # as R writes tables
        return [axis + 1 for axis in axes], ["", *names]
    if is_exact and heading.is_table and max(axes) < least:
        return axes, names + [""] * max(widths)
    if sorted(axes) == [0, 1, 2]:
        return axes, []
    if len(widths) == 1 and least < count == min(axes) + 3 and not heading.is_sentence:
        return [axis + least - count for axis in axes], []  # "Point ID X Y Z"
    return [], []


def _say_unnamed(headings: list[Heading], widths: set[int]) -> None:
    """Warn that the first three columns are taken though there is a heading.

    Raises:
        InputError: it names more columns than three, which may be in another order.
    """
    for heading in headings:
        if heading.is_sentence:
            continue
        fits = min(widths) > 3 and len(heading.names) in widths
        if fits and (heading.is_table or not heading.is_comment):
            raise InputError(
                "has a heading that does not say which columns are x, y and z "
                f"({' '.join(heading.names)[:100]}); write each over one column"
            )
        if fits or not heading.is_comment or heading.axes:
            logger.warning(
                "the heading does not tell the columns: 1, 2 and 3 are taken as x, y and z"
            )
            return


def _further_columns(
    values: FloatArray, has_intensity: bool
) -> tuple[FloatArray | None, dict[str, npt.NDArray[Any]]]:
    """Normals, or None, and attributes in the columns behind x y z of (P, 3 + k) numbers.

    Three columns together are normals where all have length 1, and colours where all are whole
    numbers from 0 to 255 or fractions from 0 to 1. Single columns come before them, as in PTS: the
    first is the intensity. Where that is no rule, a column behind three of colours that holds the
    largest part of a colour alone is their alpha, and is left out.
    """
    alpha = None if has_intensity else _opaque(values)
    if alpha is not None:
        values = np.delete(values, alpha, axis=1)
    elif not has_intensity and _are_four(values):
        logger.warning(
            "columns 4 to 7 are taken as intensity, red, green and blue; if they are red, green, "
            "blue and alpha, say so in a first line: x y z r g b a"
        )
    finite = np.isfinite(values).all(axis=1)
    normals: FloatArray | None = None
    attributes: dict[str, npt.NDArray[Any]] = {}
    columns = values.shape[1]
    single = (columns - 3) % 3
    for at in range(3, 3 + single):
        attributes["intensity" if at == 3 else f"column{at + 1}"] = values[:, at]
    for at in range(3 + single, columns, 3):
        three = values[:, at : at + 3]
        colours = colours_of(three)
        if normals is None and _are_unit(three[finite]):
            normals = three
        elif (
            "colours" not in attributes
            and colours is not None
            and (at + 3 == alpha or colours.dtype != np.uint16)
        ):
            attributes["colours"] = colours
        else:
            attributes |= {f"column{at + k + 1}": three[:, k] for k in range(3)}
    return normals, attributes


def _are_unit(vectors: FloatArray) -> bool:
    """Whether there are vectors (n, 3), and all have length 1."""
    length = np.linalg.norm(np.clip(vectors, -2, 2), axis=1)  # clipped: no overflow
    return len(length) > 0 and bool((np.abs(length - 1) < 1e-3).all())


def _are_four(values: FloatArray) -> bool:
    """Whether columns 4 to 7 are taken as an intensity and a colour, and may be one with alpha."""
    if values.shape[1] < 7 or (values.shape[1] - 3) % 3 != 1:
        return False
    colours = colours_of(values[:, 3:7])
    return colours is not None and colours.dtype != np.uint16 and not _are_unit(values[:, 4:7])


def _opaque(values: FloatArray) -> int | None:
    """The column of an alpha that hides nothing, behind the first or the last colours; else None.

    Where the two parts before it are no less throughout, it is the blue of white.
    """
    columns = values.shape[1]
    if columns < 7 or (columns - 3) % 3 != 1:
        return None
    for at in (3, columns - 4):
        four = values[:, at : at + 4]
        colours = colours_of(four)
        if colours is None or _are_unit(four[np.isfinite(four).all(axis=1), 1:]):
            continue
        most = 1 if colours.dtype.kind == "f" else np.iinfo(colours.dtype).max
        full = (colours == most)[np.isfinite(colours).all(axis=1)]
        if full[:, 3].all() and not full[:, 1:3].all():
            return at + 3
    return None
