"""Where the rows of PLY elements stand, and their values: each text row in a line of its own."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from parapoint.errors import InputError
from parapoint.files.content import integers, numbers, plain_numbers, ranges, word_counts
from parapoint.surfaces.surface import FloatArray, IntArray

BLOCK = 1 << 20
"""Units of a file, bytes or numbers of a text file, among which rows are looked for at once."""


EXACT = 2**53
"""The whole numbers below this one are kept as they are where text is read as floats."""

logger = logging.getLogger("parapoint")


@dataclass
class Property:
    """A scalar of a PLY element, or a list where `count_type` is given (numpy type codes)."""

    name: str
    type: np.dtype[Any]
    count_type: np.dtype[Any] | None


@dataclass
class Lines:
    """The lines of a text file that hold numbers.

    Attributes:
        starts: (L + 1,) the unit at which each line starts, and the unit behind the last.
        numbers: (L,) the number of each line in the file, from 1 on.
    """

    starts: IntArray
    numbers: IntArray


@dataclass
class Body:
    """The data of a PLY file: bytes, or the numbers of a text file, where each is one unit wide.

    Attributes:
        raw: the bytes.
        numbers: those of a text file, or None.
        lines: those of a text file, or None.
    """

    raw: bytes
    numbers: FloatArray | None = None
    lines: Lines | None = None

    @property
    def size(self) -> int:
        """Length in units."""
        return len(self.raw) if self.numbers is None else len(self.numbers)

    def width(self, kind: np.dtype[Any]) -> int:
        """Units of one value."""
        return kind.itemsize if self.numbers is None else 1

    def values(self, at: IntArray, kind: np.dtype[Any]) -> npt.NDArray[Any]:
        """The values that start at these units; of a binary file they have this type."""
        if self.numbers is not None:
            return self.numbers[at]
        pool = np.frombuffer(self.raw, dtype=np.uint8)
        chosen = pool[at[:, None] + np.arange(kind.itemsize)]
        return np.asarray(chosen.view(kind).reshape(-1), dtype=kind.newbyteorder("="))

    def check_end(self, at: int) -> None:
        """Check that a text file has no line behind its last row, at this unit.

        Raises:
            InputError: it has.
        """
        if self.lines is not None and at < self.size:
            line = self.lines.numbers[np.searchsorted(self.lines.starts, at, side="right") - 1]
            raise InputError(f"holds more than its header announces, from line {line} on")


def text_body(raw: bytes, first: int) -> Body:
    """The body of a text file that starts in this line of it.

    Raises:
        ValueError: a word is no number.
    """
    text = plain_numbers(raw.replace(b"\r\n", b"\n").replace(b"\r", b"\n"))
    counts = word_counts(text, text.count(b"\n") + 1)
    held = np.flatnonzero(counts)
    lines = Lines(np.concatenate([[0], np.cumsum(counts[held])]), held + first)
    return Body(text, numbers(text, np.float64), lines)


def declared(values: npt.NDArray[Any], kind: np.dtype[Any]) -> npt.NDArray[Any]:
    """Numbers of a text file in their declared type, or as they are: some write 0.5 as uchar."""
    with np.errstate(invalid="ignore", over="ignore"):
        cast = values.astype(kind.newbyteorder("="))
    if kind.kind == "f" or values.dtype == cast.dtype:
        return cast
    if (np.abs(values) >= EXACT).any():
        logger.warning("whole numbers from 2^53 on in the text are rounded; binary PLY keeps them")
    return cast if (cast == values).all() else values


def run_of_values(
    body: Body, starts: IntArray, sizes: IntArray, kind: np.dtype[Any]
) -> npt.NDArray[Any]:
    """All values of lists that start at these units and have these sizes."""
    within = ranges(np.zeros_like(sizes), sizes)
    return body.values(np.repeat(starts, sizes) + body.width(kind) * within, kind)


def walked(
    body: Body, at: int, count: int, properties: list[Property]
) -> tuple[IntArray, IntArray, int]:
    """(count, properties) the unit at which the values start, and their number; the unit behind.

    Raises:
        InputError: the body ends before the element does, or a list has a negative length.
    """
    rows, end = row_starts(body, at, count, properties)
    starts = np.zeros((count, len(properties)), dtype=np.int64)
    sizes = np.ones((count, len(properties)), dtype=np.int64)
    for k, item in enumerate(properties):
        if item.count_type is not None:
            sizes[:, k] = body.values(rows, item.count_type)
            rows = rows + body.width(item.count_type)
        starts[:, k] = rows
        rows = rows + sizes[:, k] * body.width(item.type)
    return starts, sizes, end


def row_starts(body: Body, at: int, count: int, properties: list[Property]) -> tuple[IntArray, int]:
    """(count,) the unit at which each row of an element starts, and the unit behind the last.

    Raises:
        InputError: the body ends before the element does; a list has a negative length; a row of a
            text file is not a line.
    """
    if count == 0 or not properties:
        return np.full(count, at), at
    if count > body.size - at:  # a row takes a unit at least
        raise InputError(f"ends early: {count} rows are announced")
    if body.lines is not None:
        return _rows_of_lines(body, body.lines, at, count, properties)
    stride = int(_row_ends(body, np.array([at]), properties)[0]) - at
    even = at + stride * np.arange(count)
    fits = 0 < stride <= (body.size - at) // count
    if fits and (_row_ends(body, even, properties) == even + stride).all():
        return even, at + stride * count
    starts: list[int] = []
    while len(starts) < count:
        # The ends of the rows that would start at each of many units, true rows or not, take a
        # few calls; then one look a row leads from each true row to the next.
        begin, behind = at, min(at + BLOCK, body.size)
        ends = _row_ends(body, np.arange(begin, behind), properties).tolist()
        while at < behind and len(starts) < count:
            starts.append(at)
            at = ends[at - begin]
            if at <= starts[-1]:
                raise InputError("has a list of negative length")
        if at > body.size or (at == body.size and len(starts) < count):
            raise InputError("ends early, in a list")
    return integers(starts), at


def _rows_of_lines(
    body: Body, lines: Lines, at: int, count: int, properties: list[Property]
) -> tuple[IntArray, int]:
    """What `row_starts` returns of a text file."""
    first = int(np.searchsorted(lines.starts, at))
    starts, behind = lines.starts[first:-1][:count], lines.starts[first + 1 :][:count]
    ends = _row_ends(body, starts, properties)
    wrong = ends != behind
    if wrong.any():
        row = int(wrong.argmax())
        if ends[row] < 0:
            raise InputError("has a list of negative length")
        found, announced = int(behind[row] - starts[row]), int(ends[row] - starts[row])
        raise InputError(
            f"line {lines.numbers[first + row]} holds {found} numbers, and the header announces "
            f"{announced if ends[row] <= body.size else 'more'}; write each row in one line"
        )
    if len(starts) < count:
        raise InputError(f"ends early: {count} rows are announced, {len(starts)} follow")
    return starts, int(behind[-1])


def _row_ends(body: Body, at: IntArray, properties: list[Property]) -> IntArray:
    """(n,) the units behind rows that start at these units (n,).

    It is beyond the body if the row would be, and -1 if a list has a negative length.
    """
    beyond = body.size + 1
    is_negative = np.zeros(len(at), dtype=bool)
    for item in properties:
        size: IntArray | int = 1
        if item.count_type is not None:
            width = body.width(item.count_type)
            known = at + width <= body.size
            counts = np.full(len(at), float(beyond))
            found = body.values(at[known], item.count_type).astype(np.float64)
            counts[known] = np.fmin(found, beyond)
            is_negative |= counts < 0
            size = np.maximum(counts, 0).astype(np.int64)
            at = at + width
        at = np.minimum(at + size * body.width(item.type), beyond)
    return np.where(is_negative, -1, at)
