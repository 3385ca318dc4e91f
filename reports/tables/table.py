"""What a table is: columns, blocks of rows, and which values are best."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple

from benchmarks.metrics.table import METRICS
from reports.contents import (
    ANGLE,
    AREA,
    FLIPPED,
    ISOMETRIC,
    OVERLAPPED,
    POINT_ANGLE,
    POINT_AREA,
    POINT_COLLISIONS,
    POINT_TEARS,
    SPANNING,
)
from reports.ranking import is_of_angles, may_rank, ranks

Value = float | str | None
Mark = Literal["", "best", "second"]

MARKS: dict[int | None, Mark] = {1: "best", 2: "second"}
ARROWS = {"lower": "↓", "higher": "↑"}

SHORT = {
    ANGLE: "angle [rad]",
    AREA: "area [0–2]",
    ISOMETRIC: "sym. Dirichlet",
    FLIPPED: "flipped %",
    OVERLAPPED: "overlapped %",
    SPANNING: "spanning %",
    POINT_ANGLE: "stretch",
    POINT_AREA: "area",
    POINT_COLLISIONS: "collisions %",
    POINT_TEARS: "tears %",
    "seam_excess": "seam − artist's",
}
"""Heads of metrics in tables that show many of them."""


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Attributes:
        key: of the value in each row.
        title: the head.
        better: "lower" or "higher" where values are ranked, else "".
        digits: after the point.
        percent: whether values are fractions to be shown as per cent.
        once: whether the value is that of the whole block, printed in its first row.
        group: a head over neighbouring columns with the same group.
        text: whether it holds words, set to the left.
        angles: whether its values read angles alone, so that collapsed maps are ranked in it.
    """

    key: str
    title: str
    better: str = ""
    digits: int = 3
    percent: bool = False
    once: bool = False
    group: str = ""
    text: bool = False
    angles: bool = False

    @property
    def head(self) -> str:
        """Title with the arrow to the better side."""
        return f"{self.title} {ARROWS[self.better]}" if self.better else self.title

    def shown(self, value: Value) -> str:
        """`value` as it is printed."""
        if value is None or isinstance(value, str):
            return value or ("" if self.text else "–")
        if math.isnan(value):
            return "–"
        if math.isinf(value):
            return "∞" if value > 0 else "−∞"
        number = 100 * value if self.percent else value
        if 0 < abs(number) < 0.5 * 10**-self.digits:
            return f"<{10**-self.digits:.{self.digits}f}"
        if abs(number) >= 1e5:
            mantissa, exponent = f"{number:.1e}".split("e")
            return f"{mantissa}·10^{int(exponent)}".replace("-", "−")
        return f"{number:,.{self.digits}f}".replace("-", "−")


class Cell(NamedTuple):
    """A printed value, its rank among those it is compared with, and the value itself."""

    text: str
    mark: Mark
    value: Value


@dataclass(frozen=True)
class Table:
    """A table, whatever it is written as.

    Attributes:
        name: of its files.
        title: one line.
        caption: what is in it and how to read it.
        columns: left to right.
        blocks: rows that belong together; values are ranked within a block.
        across: rank the values of a row among each other instead.
        notes: lines under the table.
        set_apart: values of "label" of rows, or keys of columns, that take no part in the ranking.
    """

    name: str
    title: str
    caption: str
    columns: tuple[Column, ...]
    blocks: tuple[tuple[Mapping[str, Value], ...], ...]
    across: bool = False
    notes: tuple[str, ...] = ()
    set_apart: frozenset[str] = frozenset()

    @cached_property
    def cells(self) -> tuple[tuple[tuple[Cell, ...], ...], ...]:
        """Cells by block, row and column."""
        return tuple(self._block(block) for block in self.blocks)

    def _block(self, block: Sequence[Mapping[str, Value]]) -> tuple[tuple[Cell, ...], ...]:
        columns = self.columns
        texts = [[column.shown(row.get(column.key)) for column in columns] for row in block]
        marks: list[list[Mark]] = [["" for _ in columns] for _ in block]
        ranked = [
            at
            for at, column in enumerate(columns)
            if column.better and column.key not in self.set_apart
        ]
        rows = [at for at, row in enumerate(block) if row.get("label") not in self.set_apart]
        if self.across:
            groups = [[(r, c) for c in ranked] for r in rows]
        else:
            groups = [[(r, c) for r in rows] for c in ranked]
        for group in groups:
            _mark(group, block, columns, texts, marks)
        return tuple(
            tuple(
                Cell(texts[r][c], marks[r][c], row.get(column.key))
                for c, column in enumerate(columns)
            )
            for r, row in enumerate(block)
        )


def _mark(
    places: Sequence[tuple[int, int]],
    block: Sequence[Mapping[str, Value]],
    columns: Sequence[Column],
    texts: Sequence[Sequence[str]],
    marks: list[list[Mark]],
) -> None:
    """Mark the best and the second of the values at `places`.

    A row whose values have a direction of their own gives it under "better", its grade under
    "grade", or column by column under "grade KEY".
    """
    values: list[float | None] = []
    for row, column in places:
        value, of = block[row].get(columns[column].key), columns[column]
        grade = block[row].get(f"grade {of.key}", block[row].get("grade"))
        angles = bool(block[row].get("angles", of.angles))
        ranked = isinstance(value, int | float) and may_rank(_text(grade), angles=angles)
        values.append(float(value) if ranked and isinstance(value, int | float) else None)
    if not places:
        return
    better = {str(block[row].get("better", columns[column].better)) for row, column in places}
    shown = [texts[row][column] for row, column in places]
    found = ranks(values, shown, better.pop())
    if len({text for text, rank in zip(shown, found, strict=True) if rank}) < 2:
        return  # all are alike: nobody is best
    for (row, column), rank in zip(places, found, strict=True):
        marks[row][column] = MARKS.get(rank, "")


def _text(value: Value) -> str | None:
    return value if isinstance(value, str) else None


def grouped(columns: Sequence[Column]) -> list[tuple[str, int]]:
    """The heads over the columns and how many columns each spans."""
    groups: list[tuple[str, int]] = []
    for column in columns:
        if groups and groups[-1][0] == column.group:
            groups[-1] = (column.group, groups[-1][1] + 1)
        else:
            groups.append((column.group, 1))
    return groups


def metric_column(name: str, title: str = "", **given: object) -> Column:
    """The column of a metric; `seconds` counts as one."""
    if name == "seconds":
        return Column("seconds", title or "time [s]", better="lower", digits=2)
    metric = METRICS[name]
    counts = name.endswith("_count") or metric.unit == "faces" or metric.weighting == "count"
    digits = 4 if metric.unit == "radians" else 1 if counts else 3
    column = Column(
        name,
        title or metric.label,
        better=metric.better if metric.better in ARROWS else "",
        digits=2 if name.endswith("_fraction") else digits,
        percent=name.endswith("_fraction"),
        angles=is_of_angles(name),
    )
    return Column(**{**column.__dict__, **given})


def metric_title(name: str) -> str:
    """Label and unit of a metric; `seconds` counts as one."""
    column = metric_column(name)
    unit = "" if name == "seconds" or not METRICS[name].unit else f" [{METRICS[name].unit}]"
    return f"{column.title}{' %' if column.percent else unit}"
