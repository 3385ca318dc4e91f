"""The names of columns in a text: which lines give them, and which of them are x, y and z."""

from __future__ import annotations

import re
from itertools import product
from typing import NamedTuple

PLANES = (
    (("x",), ("y",)),
    (("easting", "east", "e"), ("northing", "north", "n")),
    (("rechtswert", "rechts", "ost"), ("hochwert", "hoch", "nord")),
    (("longitude", "lon", "long", "lng"), ("latitude", "lat")),
)
"""What stands over the column of x, and with it over that of y."""
HEIGHTS = ("z", "elevation", "elev", "height", "altitude", "alt", "hoehe", "höhe", "h", "up")
"""What stands over the column of z."""
PREFIX = r"(?:(?:points?|pos(?:ition)?|coord(?:inate)?s?|field|location|vertex)[ ._:-]*)"
SUFFIX = r"(?:[ ._-]*(?:coord(?:inate)?s?|koordinate|pos(?:ition)?|mm|cm|m|ft))?"
AXIS = re.compile(rf"(?:p|{PREFIX}*)([xyz]){SUFFIX}|{PREFIX}+([012])")
"""The name of a coordinate as programs adorn it: POINT_X, field.position.x, x_coord, Points:0."""
NORMAL = re.compile(r"(?:n|normals?[ ._:-]*)([xyz])|normals?[ ._:-]*([012])")
"""The name of a part of a normal: nx, Normal_X, Normals:0."""
COMMENT = re.compile(r"\s*(?:#+|//+|%+|;(?=\s|[^;]*$))\s*")
"""What begins a comment. A semicolon may also part an empty name from the next one."""
LABEL = re.compile(r"\s*(?:.*:\s+|(?:columns|fields)\s+)(?=\S)")
"""What stands before the names of columns and is none of them."""
UNIT = re.compile(r"[\s,;|]*[\[({<][^\])}>]*[\])}>]")
"""A unit in brackets, which may stand in a cell of its own."""
GLUED = re.compile(r"p?(?:nez|enz|xyz)(?:d|i|rgb)*")
"""Names of one letter in one word, as in PNEZD."""
PROSE = {"an", "and", "are", "as", "at", "by", "for", "from", "in", "is", "of", "the", "with"}
"""Words that make a comment a sentence."""


class Heading(NamedTuple):
    """A line before the rows.

    Attributes:
        names: of the columns in lower case, those of coordinates and normals as x and nx.
        is_comment: whether it is a comment, which may hold anything.
        is_table: whether commas, semicolons, bars or tabs part its names.
        axes: the places of x, y and z among the names; [] where they are not told.
    """

    names: list[str]
    is_comment: bool
    is_table: bool
    axes: list[int]

    @property
    def is_sentence(self) -> bool:
        """Whether it is a comment of other words than names."""
        return self.is_comment and not self.is_table and not PROSE.isdisjoint(self.names)

    @property
    def is_degrees(self) -> bool:
        """Whether x is a longitude."""
        return bool(self.axes) and self.names[self.axes[0]].startswith(("lon", "lng"))


def heading_of(line: bytes) -> Heading:
    """What a line says about the columns if it is a heading."""
    try:
        text = line.decode()
    except UnicodeDecodeError:
        text = line.decode("latin-1")
    text = UNIT.sub("", text.lower())
    bare = COMMENT.sub("", text, count=1) if COMMENT.match(text) else text
    named = LABEL.sub("", bare, count=1)
    mark = next((mark for mark in ";|,\t" if named.count(mark) >= 2), "")
    if mark == "\t" and "\t\t" in named:
        cells = re.split(r"\t+", named.strip())
    else:
        cells = named.split(mark) if mark else re.findall(r"[^\s,;|]+", named)
    if len(cells) == 1 and GLUED.fullmatch(cells[0].strip()):
        cells = list(cells[0].strip())
    names = [_plain(cell.strip(" \t\"'")) for cell in cells]
    return Heading(names, bare != text, bool(mark), _axes(names))


def _plain(name: str) -> str:
    for adorned, prefix in ((AXIS, ""), (NORMAL, "n")):
        if found := adorned.fullmatch(name):
            return prefix + (found[1] or "xyz"[int(found[2])])
    return "intensity" if name == "i" else name


def _axes(names: list[str]) -> list[int]:
    """The places of x, y and z; [] where one is missing or there twice."""
    for easts, norths in PLANES:
        for axes in product(easts, norths, HEIGHTS):
            if all(names.count(name) == 1 for name in axes):
                return [names.index(name) for name in axes]
    return []
