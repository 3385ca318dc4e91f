"""Points in text, XYZ and PTS: bytes in, `Content` without faces out."""

from __future__ import annotations

import logging
import re
from collections.abc import Sequence
from itertools import product

import numpy as np

from parapoint.errors import InputError
from parapoint.files.clouds.columns import UNEVEN, Columns, are_atoms, columns_of, is_number
from parapoint.files.clouds.headings import Heading, heading_of
from parapoint.files.content import Content, plain_numbers, points_content
from parapoint.surfaces.surface import FloatArray

logger = logging.getLogger("parapoint")

LOOKED_AT = 20_000
"""Lines, spread over the file, by which the meaning of its commas and columns is told."""
DECIMAL_COMMA = re.compile(rb"[+-]?\d*,\d+(?:[eE][+-]?\d+)?$|[+-]?\d+$")
"""A word with one comma at most, as it is written where the comma marks decimals."""
GROUPED = re.compile(rb"[+-]?\d{1,3}(?:,\d{3})+\.\d*$")
"""A number whose thousands are parted by commas; 1,234.5."""
GROUPED_WHOLE = re.compile(rb"[+-]?\d{1,3}(?:,\d{3})+$")
"""The same without a fraction; beside others that have one."""
GROUPED_BY_POINTS = re.compile(rb"[+-]?\d{1,3}(?:\.\d{3})+,\d*$")
"""The same as it is written where the comma marks decimals; 1.234,5."""
GROUPED_BY_BLANKS = re.compile(rb"[+-]?\d{1,3}(?: \d{3})+(?:[.,]\d*)?")
"""The same with blanks; 1 234,5."""

COMMENTS = (b"#", b"//", b"%")
"""What begins a comment."""
SPELLED = {
    "\N{MINUS SIGN}".encode(): b"-",
    "\N{NO-BREAK SPACE}".encode(): b" ",
    "\N{NARROW NO-BREAK SPACE}".encode(): b" ",
    "\N{THIN SPACE}".encode(): b" ",
}
"""Signs that word processors write, and the plain ones that they stand for."""
MISSING = re.compile(
    rb"(?<![^\s,;|])(?:(?<=[\t,;|])#)?(?:n/?a|null|none)(?![^\s,;|])", re.IGNORECASE
)
"""How R, Excel, SQL and Python write a value that is missing."""
QUOTED = re.compile(
    rb'(?:^|(?<=[\s,;|]))"([^"\n]*[^"\n\d+\-.,eE][^"\n]*)"(?=[\s,;|]|$)', re.MULTILINE
)
"""What stands between quotation marks and is no number."""
PLACE = re.compile(rb"p\s+[-+.\d]")
"""What begins a line of a point in a PTS file of Hoppe's."""
CELLS = re.compile(rb'[\s,;|"]+')
"""What parts words in a line of which nothing is known yet."""


def table(lines: list[bytes], columns: Sequence[int] | None) -> FloatArray:
    """(n, len(columns)) numbers in these columns of text lines, None for all; empty for no lines.

    Raises:
        ValueError: a line has too few words, or one that is no number.
    """
    if not lines:
        return np.zeros((0, len(columns or ())))
    text = (line.decode("latin-1") for line in lines)  # no second copy of millions of lines
    return np.loadtxt(text, comments="#", usecols=columns, ndmin=2, dtype=np.float64)


def text_lines(data: bytes) -> list[bytes]:
    """Lines that hold more than blanks and comments, with points for decimals, blanks between.

    Raises:
        InputError: as for `_blank_parted`.
    """
    return _blank_parted(_kept(_all_lines(data)))[0]


def _all_lines(data: bytes) -> list[bytes]:
    """The lines of a text, with signs and numbers spelled as most programs spell them.

    A missing value is nan in lines that hold a number or three missing ones.

    Raises:
        InputError: a space that is not plain stands between digits.
    """
    data = plain_numbers(data)
    for sign, plain in SPELLED.items():
        if sign in data:
            if plain == b" " and re.search(rb"\d" + sign + rb"\d", data):
                raise InputError(
                    "has no-break spaces between digits, which may group them or part two numbers; "
                    "write plain blanks between the numbers, and none inside them"
                )
            data = data.replace(sign, plain)
    lines = data.splitlines()
    if not MISSING.search(data):
        return lines
    return [
        MISSING.sub(b"nan", line)
        if re.search(rb"\d", line) or len(MISSING.findall(line)) >= 3
        else line
        for line in lines
    ]


def _kept(lines: list[bytes]) -> list[bytes]:
    """The lines that hold more than blanks and comments."""
    return [line for line in lines if (bare := line.strip()) and not bare.startswith(COMMENTS)]


def _rows(lines: list[bytes]) -> list[bytes]:
    """The same without the counts of points before each scan."""
    return [
        line
        for line in lines
        if (bare := line.strip()) and not (bare.isdigit() or bare.startswith(COMMENTS))
    ]


def _blank_parted(lines: list[bytes], names: int = 0) -> tuple[list[bytes], bool]:
    """The lines with blanks between their cells, points for decimals, and nan for an empty cell.

    Args:
        lines: rows of one table.
        names: how many names its heading has.

    Returns:
        The lines, and whether their cells were parted by more than blanks, so that none is missing.

    Raises:
        InputError: commas part numbers or mark decimals, and it cannot be told which.
    """
    text = joined = b"\n".join(lines)
    if b'"' in text:
        text = QUOTED.sub(lambda found: re.sub(rb"[\s,;|#]", b"_", found[1]), text)
        text = text.translate(None, b'"')
    if b"#" in text:
        text = re.sub(rb"[ \t]*#.*", b"", text)
    if text is not joined:
        lines = text.split(b"\n")
    if not any(mark in text for mark in (b",", b";", b"|", b"\t")):
        return lines, False
    step = len(lines) // LOOKED_AT + 1
    looked_at = [line for line in lines[::step] if re.search(rb"\d", line)]
    marks = (mark for mark in (b";", b"|") if all(mark in line for line in looked_at))
    mark = next(marks, b"") if looked_at else b""
    if b"," in text:
        # A comma with a blank behind it parts numbers, whatever those inside words do.
        words = [re.sub(rb",(?=\s|$)|[;|]", b" ", line).split() for line in looked_at]
        with_comma = [word for line in words for word in line if b"," in word]
        grouped = any(GROUPED.match(word) for word in with_comma) and all(
            GROUPED.match(word) or GROUPED_WHOLE.match(word) for word in with_comma
        )
        if with_comma and _marks_decimals(words, with_comma, names):
            text = re.sub(rb",(?=\s|$)", b" ", text)
            if any(GROUPED_BY_POINTS.match(word) for word in with_comma):
                text = text.replace(b".", b"")
            text = text.replace(b",", b".")
        elif grouped and min(map(len, words)) >= 3:
            text = re.sub(rb",(?=\d)", b"", text).replace(b",", b" ")
        elif mark:
            text = text.replace(b",", b" ")
        else:
            mark = b","
    if text is not joined:
        lines = text.split(b"\n")
    if not mark and b"\t" in text and _parts_cells(lines[::step], names):
        mark = b"\t"
    return _filled(text, mark, lines[::step]) if mark else (lines, False)


def _parts_cells(lines: list[bytes], names: int) -> bool:
    """Whether tabs part cells, some of which may be empty, and do not only align them."""
    cells = [line.split(b"\t") for line in lines]
    if len(set(map(len, cells))) != 1:
        return False
    empty = {tuple(k for k, cell in enumerate(line) if not cell.strip()) for line in cells}
    return len(empty) > 1 or empty == {()} or len(cells[0]) == names


def _filled(text: bytes, mark: bytes, looked_at: list[bytes]) -> tuple[list[bytes], bool]:
    """Lines whose cells a mark parts, with blanks in its place and nan in empty cells.

    Args:
        text: of the lines, with points for decimals.
        mark: what parts the cells.
        looked_at: some lines.

    Returns:
        As for `_blank_parted`.
    """
    cells = [[cell.split() for cell in line.split(mark)] for line in looked_at]
    several = [
        {k for k, of in enumerate(line) if _are_numbers(of[:1]) and of[1:]} for line in cells
    ]
    is_exact = not set.intersection(*several) and min(map(len, cells)) > 1
    runs = [b" ".join(cell) for line in cells for cell in line if cell[1:] and _are_numbers(cell)]
    if runs and mark != b"," and all(map(GROUPED_BY_BLANKS.fullmatch, runs)):
        raise InputError(f"has blanks inside numbers ({runs[0].decode()}); write none there")
    if mark != b"\t":
        text = text.replace(b"\t", b" ")
    text = b"\n" + text + b"\n"
    for bare, spaced in product((mark, b"\n"), (b" %b", b"%b ")):
        while spaced % bare in text:
            text = text.replace(spaced % bare, bare)
    if is_exact:
        text = text.replace(b" ", b"_")  # several words in one cell
    for empty, filled in (
        *((mark + mark, mark + b"nan" + mark),) * 2,  # twice, for runs of them
        (b"\n" + mark, b"\nnan" + mark),
        (mark + b"\n", mark + b"nan\n"),
    ):
        text = text.replace(empty, filled)
    return text[1:-1].replace(mark, b" ").split(b"\n"), is_exact


def _are_numbers(words: list[bytes]) -> bool:
    """Whether there are words, and all are numbers."""
    return bool(words) and all(map(is_number, words))


def _marks_decimals(words: list[list[bytes]], with_comma: list[bytes], names: int) -> bool:
    """Whether the commas inside words mark decimals.

    Args:
        words: of each line.
        with_comma: those that hold a comma.
        names: how many names the heading has.
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
    if {names} == set(map(len, parts)):
        return False
    is_whole = all(part.lstrip(b"+-").isdigit() for word in parts for part in word)
    signed = any(part.startswith((b"+", b"-")) for word in parts for part in word[1::2])
    if is_whole and not signed and (fewest > 1 or max(map(len, parts)) >= 6):
        raise InputError(
            "has commas of which it cannot be told whether they part numbers or mark decimals; "
            "write decimals with points, and blanks between the numbers"
        )
    return False


def _refuse_ptx(lines: list[bytes]) -> None:
    """Refuse Leica's PTX, where the pose of a scan in ten lines would be read as points."""
    words = [line.split() for line in lines[:10]]
    if [len(line) for line in words] == [1, 1, 3, 3, 3, 3, 4, 4, 4, 4] and all(
        line[0].isdigit() for line in words[:2]
    ):
        raise InputError("is PTX, whose scans have places of their own; export it as PTS or PLY")


def xyz(data: bytes) -> Content:
    """Text with x y z in each line, and whatever columns a scanner adds; see `_further_columns`.

    A count may stand before the rows.

    Raises:
        InputError: there is no point, or fewer than the count says; it cannot be told which columns
            are x, y and z, one of them is no number in some line, or it is PTX; see `_all_lines`
            and `_blank_parted`.
    """
    lines = _all_lines(data)
    content = _cloud(lines)
    kept = _kept(lines)
    counts = [int(line) for line in kept if line.strip().isdigit()]
    if len(counts) == 1 and kept[0].strip().isdigit():
        announced, found = counts[0], len(content.vertices)
        if announced > found:
            raise InputError(f"ends early: {announced} points are announced, {found} are there")
        if announced < found:
            logger.warning("points announced: %d; points there: %d", announced, found)
    return content


def _cloud(lines: list[bytes], *, has_intensity: bool = False) -> Content:
    """The points in the lines of a text; see `Columns.content`."""
    _refuse_ptx(lines)
    start, headings = _head(lines)
    kept = _rows(lines[start:])
    if not kept:
        raise InputError("has no point: none of its lines holds three numbers")
    names = max((len(heading.names) for heading in headings if heading.axes), default=0)
    rows, is_exact = _blank_parted(kept, names)
    step = len(rows) // LOOKED_AT + 1
    sample = [row.split() for row in rows[::step]]
    if min(map(len, sample)) < 3:
        raise InputError(_fault(lines, start, rows, [0, 1, 2]))
    if are_atoms(lines[:start], len(rows), sample):
        logger.warning("the first column holds atomic numbers: the coordinates are behind it")
        columns = Columns([1, 2, 3], [], [], is_whole=False, may_vary=True)
    else:
        columns = columns_of(headings, sample, step, is_exact)
    read = columns.axes + columns.others
    try:
        values = table(rows, None)[:, read] if columns.is_whole else table(rows, read)
    except ValueError as error:
        if "number of columns" in str(error) and not columns.may_vary:
            raise InputError(UNEVEN) from error
        # Words, or not in all lines: the coordinates alone.
        columns = columns._replace(others=[], names=[])
        try:
            values = table(rows, columns.axes)
        except ValueError:
            raise InputError(_fault(lines, start, rows, columns.axes)) from error
    return columns.content(values, has_intensity=has_intensity)


def _head(lines: list[bytes]) -> tuple[int, list[Heading]]:
    """The place of the first row, and what the lines before it say about the columns.

    Before it are comments, the count of the points, a title, the names of columns, their units.
    """
    headings: list[Heading] = []
    for at, line in enumerate(lines):
        if not line.strip() or line.strip().isdigit():
            continue
        heading = heading_of(line)
        is_named = any(before.axes for before in headings)
        words = [word for word in CELLS.split(line) if word]
        count = sum(map(is_number, words))
        if not (heading.is_comment or heading.axes) and (
            count >= 3 or 0 < count == len(words) or (is_named and count > 0)
        ):
            return at, headings
        headings.append(heading)
    return len(lines), headings


def _fault(lines: list[bytes], start: int, rows: list[bytes], axes: list[int]) -> str:
    """What is wrong with the first row in which a coordinate is no number.

    Args:
        lines: of the file.
        start: the place of the first row among them.
        rows: the rows.
        axes: the columns of x, y and z.
    """
    numbers = [at for at, line in enumerate(lines[start:], start + 1) if _rows([line])]
    for number, words in zip(numbers, map(bytes.split, rows), strict=True):
        if len(words) <= max(axes):
            return f"has only {len(words)} columns in line {number}; x, y or z is missing"
        for axis, column in zip("xyz", axes, strict=True):
            if not is_number(words[column]):
                word = words[column].decode("utf-8", "replace")[:30]
                return (
                    f"has {word!r} in line {number}, column {column + 1}, where {axis} should be a "
                    "number; if the columns are in another order, name them in a first line"
                )
    return "has numbers that cannot be read"


def pts(data: bytes) -> Content:
    """PTS: lines "p x y z" (Hoppe), or of each scan a count, x y z and what a scanner adds.

    Raises:
        InputError: a scan has fewer points than its count announces, or more; see `xyz`.
    """
    lines = _all_lines(data)
    marked = [line for line in lines if PLACE.match(line)]
    if marked:
        return points_content(table(_blank_parted(marked)[0], (1, 2, 3)))
    kept = _kept(lines)
    counts = [at for at, line in enumerate(kept) if line.strip().isdigit()]
    if counts and counts[0] < _head(kept)[0]:
        for at, after in zip(counts, [*counts[1:], len(kept)], strict=True):
            announced = int(kept[at])
            found = after - at - 1 - _head(kept[at + 1 : min(after, at + 9)])[0]
            if found != announced:
                early = "ends early: " if found < announced else ""
                raise InputError(f"{early}{announced} points are announced, {found} are there")
    return _cloud(lines, has_intensity=True)
