"""What a table is: columns, blocks of rows, and which values are best."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

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
from reports.numbers import printed
from reports.ranking import TIMES, Mark, flagged, is_of_angles, marks, may_rank, tolerance

Value = float | str | None

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
        tie: relative difference up to which two values are equal (`reports.ranking.tolerance`).
        by_row: whether each row gives a metric under "name", by which the value is printed and
            ranked.
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
    tie: float = 0.0
    by_row: bool = False

    @property
    def head(self) -> str:
        """Title, per cent where values are shown so, and the arrow to the better side."""
        percent = " %" if self.percent and not self.title.endswith("%") else ""
        arrow = f" {ARROWS[self.better]}" if self.better else ""
        return f"{self.title}{percent}{arrow}"

    def shown(self, value: Value) -> str:
        """`value` as it is printed."""
        if isinstance(value, str) or (value is None and self.text):
            return value or ""
        return printed(value, self.digits, percent=self.percent)

    def of(self, row: Mapping[str, Value]) -> Column:
        """The column that says how the value of `row` is printed and ranked: this one, mostly."""
        return metric_column(str(row["name"]), key=self.key) if self.by_row else self


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
        columns = [[column.of(row) for column in self.columns] for row in block]
        texts = [
            [column.shown(row.get(column.key)) for column in own]
            for row, own in zip(block, columns, strict=True)
        ]
        found: list[list[Mark]] = [["" for _ in self.columns] for _ in block]
        rows = [at for at, row in enumerate(block) if row.get("label") not in self.set_apart]
        ranked = [
            at
            for at, column in enumerate(self.columns)
            if (column.better or column.by_row) and column.key not in self.set_apart
        ]
        by_column = [[(r, c) for r in rows] for c in ranked]
        by_row = [[(r, c) for c in ranked] for r in rows]
        for places in filter(None, by_row if self.across else by_column):
            r, c = places[0]
            given = marks(
                [_rankable(block[r], columns[r][c]) for r, c in places],
                [texts[r][c] for r, c in places],
                columns[r][c].better,
                columns[r][c].tie,
            )
            for (r, c), mark in zip(places, given, strict=True):
                found[r][c] = mark
        return tuple(
            tuple(
                Cell(_flagged(texts[r][c], row, column), found[r][c], row.get(column.key))
                for c, column in enumerate(columns[r])
            )
            for r, row in enumerate(block)
        )


def _grade(row: Mapping[str, Value], column: Column) -> str | None:
    """The grade of the map of a value: under "grade", or column by column under "grade KEY"."""
    found = row.get(f"grade {column.key}", row.get("grade"))
    return found if isinstance(found, str) else None


def _rankable(row: Mapping[str, Value], column: Column) -> float | None:
    """The value of a row that takes part in the ranking; None where it has none, or may not."""
    value, fit = row.get(column.key), may_rank(_grade(row, column), angles=column.angles)
    return float(value) if fit and column.better and isinstance(value, int | float) else None


def _flagged(text: str, row: Mapping[str, Value], column: Column) -> str:
    """The text of a value, flagged where its map is collapsed and ranked nevertheless."""
    known = isinstance(row.get(column.key), int | float)
    return flagged(text, _grade(row, column), angles=column.angles) if known else text


def share(count: int, of: int) -> str:
    """How many of how many, as tables print it."""
    return f"{count}/{of}" if of else "not run"


def grouped(columns: Sequence[Column]) -> list[tuple[str, int]]:
    """The heads over the columns and how many columns each spans."""
    groups: list[tuple[str, int]] = []
    for column in columns:
        if groups and groups[-1][0] == column.group:
            groups[-1] = (column.group, groups[-1][1] + 1)
        else:
            groups.append((column.group, 1))
    return groups


CASE = Column("case", "Model", text=True, once=True)
"""The column of the model, which blocks of rows name once."""
METHOD = Column("method", "Method", text=True)
"""The column of the method."""
DONE = Column("done", "ok", text=True)
"""The column that counts the seeds that gave a map."""
TIME_TITLES = {"seconds": "time [s]", "cpu_seconds": "processor time [s]"}


def metric_column(name: str, title: str = "", **given: Any) -> Column:
    """The column of a metric; the times of TIMES count as metrics."""
    if name in TIMES:
        column = Column(
            name, title or TIME_TITLES[name], better="lower", digits=2, tie=tolerance(name)
        )
        return replace(column, **given)
    metric = METRICS[name]
    digits = 4 if metric.unit == "radians" else 1 if name.endswith("_count") else 3
    column = Column(
        name,
        title or metric.label,
        better=metric.better if metric.better in ARROWS else "",
        digits=2 if name.endswith("_fraction") else digits,
        percent=name.endswith("_fraction"),
        angles=is_of_angles(name),
        tie=tolerance(name),
    )
    return replace(column, **given)


def short_columns(names: Iterable[str]) -> list[Column]:
    """The columns of metrics under their titles of SHORT, where they have one."""
    return [metric_column(name, SHORT.get(name, "")) for name in names]


def metric_title(name: str) -> str:
    """Label, unit and better direction of a metric; the times of TIMES count as metrics."""
    unit = "" if name in TIMES or not METRICS[name].unit else f" [{METRICS[name].unit}]"
    return metric_column(name, f"{metric_column(name).title}{unit}").head
