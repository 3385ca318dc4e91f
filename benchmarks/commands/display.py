"""What a user sees of a run: its plan, a progress bar, and its summary."""

from __future__ import annotations

import math
import statistics
import sys
import time
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Self

from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn
from rich.progress import Progress as Bar
from rich.table import Column, Table
from rich.text import Text

from benchmarks.commands.tables import print_table
from benchmarks.metrics.grades import GRADES, grade_of
from benchmarks.metrics.table import METRICS
from benchmarks.running.expectation import about, cell_seconds, clock, remaining
from benchmarks.running.planning import Cell
from benchmarks.running.runner import Progress, Summary
from parapoint.console import LONGEST_MESSAGE, printable, terminal

if TYPE_CHECKING:
    from benchmarks.store.rows import ResultRow

STATUSES = ("ok", "skipped", "failed", "timeout", "out_of_memory")
"""All statuses of a row, in the order of the summary's columns."""
BAD = STATUSES[2:]
"""The statuses of cells that a method should have mapped and did not."""
QUALITY: tuple[tuple[str, str, Callable[[list[float]], float], str], ...] = (
    ("angle", "angle_difference_mean", statistics.median, ".3f"),
    ("worst part", "part_area_ratio_min_without_spanning", min, ".2g"),
    ("s", "seconds", statistics.median, ".3g"),
    ("MB", "peak_memory_mb", statistics.median, ".0f"),
)
"""Columns of the summary: heading, field or metric, what stands for several rows, and its form."""
SILENCE = 60.0
"""Seconds after which a run says that it goes on, where no terminal shows it."""
LISTED = 20
"""Number of cells that are listed one by one; of any others only the number is given."""


class Display(Progress):
    """Prints the plan of a run, then how it goes, on standard error.

    On a terminal that is a bar with the time that is left, in 80 columns; anywhere else a line for
    each cell that ends, and one a minute while none does.
    """

    def __init__(self) -> None:
        """A display that shows nothing until it is entered."""
        console = terminal(stderr=True)
        self._bar = Bar(
            TextColumn("{task.description}", table_column=Column(ratio=1, no_wrap=True)),
            BarColumn(bar_width=16),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TextColumn("{task.fields[left]}"),
            console=console,
            transient=True,
            expand=True,
            disable=not console.is_terminal,
        )
        self._task = self._bar.add_task("", left="")
        self._running: dict[str, tuple[str, float]] = {}
        self._left: dict[str, float] = {}
        self._done: list[tuple[float, float]] = []
        self._total, self._jobs = 0, 1
        self._began = self._said = time.monotonic()

    def __enter__(self) -> Self:
        """Show the bar."""
        self._bar.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Remove the bar."""
        self._bar.stop()

    def installing(self, requirements: Sequence[str], folder: Path) -> None:
        """Say what is installed where: it may take minutes, and room on the disk."""
        line = f"installing {', '.join(requirements)} into {folder}, once"
        print(printable(line, LONGEST_MESSAGE), file=sys.stderr, flush=True)

    def planned(self, summary: Summary) -> None:
        """Print what the run is going to do, and why."""
        self._total, self._jobs = len(summary.planned), summary.jobs
        self._left = {
            cell.row.id: cell_seconds(cell.row.case, cell.row.method, cell.row.params)
            for cell in summary.planned
        }
        self._bar.update(self._task, total=self._total)
        self._began = self._said = time.monotonic()
        for line in plan(summary).split("\n"):
            _say(line)

    def started(self, cell: Cell) -> None:
        """Show that a cell is running."""
        self._running[cell.row.id] = (_name(cell), time.monotonic())

    def ended(self, cell: Cell, row: ResultRow) -> None:
        """Count a cell as done; on a terminal, say so only if its method failed."""
        now = time.monotonic()
        _, began = self._running.pop(row.id, ("", now))
        self._done.append((self._left.pop(row.id, 0.0), now - began))
        self._bar.advance(self._task)
        said = f"{_name(cell)}: {ending(row)}"
        if self._bar.disable:
            took = "" if row.seconds is None else f", {row.seconds:.3g} s"
            self._line(f"{len(self._done)}/{self._total}", said + took)
        elif row.status in BAD:
            self._bar.console.print(escape(printable(said, LONGEST_MESSAGE)))

    def measured(self, done: int, total: int) -> None:
        """Show how many of the maps have been measured."""
        self._bar.update(self._task, description="metrics", completed=done, total=total, left="")
        if self._bar.disable and total and (done == total or self._is_silent()):
            self._line(f"metrics {done}/{total}", "maps are measured")

    def tick(self) -> None:
        """Show how long each cell has been running."""
        now = time.monotonic()
        running = ", ".join(f"{name} {now - at:.0f} s" for name, at in self._running.values())
        if not self._running:
            return
        self._bar.update(self._task, description=escape(printable(running)), left=self._rest())
        if self._bar.disable and self._is_silent():
            self._line(f"{len(self._done)}/{self._total}", f"running: {running}")

    def _is_silent(self) -> bool:
        """Whether no line has been printed for a minute."""
        return time.monotonic() - self._said >= SILENCE

    def _line(self, count: str, said: str) -> None:
        """Print a line of the log: how far the run is, what is said, and the times."""
        self._said = time.monotonic()
        rest = f", {self._rest()}" if self._left else ""
        line = f"[{count}] {said} ({clock(self._said - self._began)} so far{rest})"
        print(printable(line, LONGEST_MESSAGE), file=sys.stderr, flush=True)

    def _rest(self) -> str:
        """How long the cells that have not ended take, about."""
        now, left = time.monotonic(), dict(self._left)
        running = [(left.pop(row, 0.0), now - began) for row, (_, began) in self._running.items()]
        seconds = remaining(self._done, running, [*left.values()], self._jobs)
        return f"{about(seconds)} left" if self._left else ""


def _name(cell: Cell) -> str:
    """A cell as the progress of a run calls it."""
    return f"{cell.row.case} {cell.method.spec}"


def ending(row: ResultRow) -> str:
    """How a cell ended, in words."""
    return f"{row.status}: {row.reason}" if row.reason else row.status


def plan(summary: Summary) -> str:
    """What a run is going to do: one line, and one more for each cell that it repeats."""
    suite, count = summary.suite, len(summary.planned)
    why = ", ".join(f"{number} {reason}" for reason, number in summary.reasons.most_common())
    kept = f"; {len(summary.kept)} are done already" if summary.kept else ""
    lines = [f"{suite.name}: {count} cells to run{f' ({why})' if why else ''}{kept}"]
    again = [cell for cell in summary.planned if cell.why != "new"]
    lines += [
        f"again: {cell.row.case}, {cell.method.spec}, seed {cell.row.seed}: {cell.why}"
        for cell in again[:LISTED]
    ]
    if len(again) > LISTED:
        lines.append(f"and {len(again) - LISTED} more again")
    return "\n".join(lines)


def print_summary(summary: Summary) -> None:
    """Print the result of a run: a table of its methods, then each cell whose method failed."""
    table = Table(
        title=f"{summary.suite.name}: {summary.suite.title}",
        title_justify="left",
        caption="Medians; worst part: the least share of its fair area that a part keeps.",
        caption_justify="left",
    )
    table.add_column("method")
    used = [status for status in STATUSES if any(row.status == status for row in summary.rows)]
    found = {row.id: grade_of(row.method, summary.metrics.get(row.id, {})) for row in summary.rows}
    grades = [grade for grade in reversed(GRADES) if grade in found.values()]
    for heading in (*used, *grades, *(heading for heading, *_ in QUALITY)):
        table.add_column(heading.replace("_", " "), justify="right", no_wrap=True)
    for method, rows in _by_method(summary).items():
        statuses = Counter[str](row.status for row in rows)
        graded = Counter(found[row.id] for row in rows)
        table.add_row(
            Text(printable(method)),
            *(str(statuses[status]) for status in used),
            *(str(graded[grade]) for grade in grades),
            *(_over(summary, rows, name, over, form) for _, name, over, form in QUALITY),
        )
    print_table(table)
    bad = [row for row in summary.rows if row.status in BAD]
    for row in bad[:LISTED]:
        _say(f"{row.case}, {summary.spec(row)}: {ending(row)}")
    if len(bad) > LISTED:
        print(f"and {len(bad) - LISTED} more that did not end well: see runs.jsonl")
    names = {row.id: f"{row.case}, {summary.spec(row)}" for row in summary.rows}
    for row_id, reason in summary.unmeasured.items():
        _say(f"{names.get(row_id, row_id)}: no metrics: {reason}")
    for case, reason in summary.missing.items():
        _say(f"{case} is left out: {reason}")
    if summary.ran:
        harness = max(0.0, summary.seconds - summary.method_seconds)
        print(
            f"{len(summary.ran)} cells in {summary.seconds:.1f} s, "
            f"of which the harness took {harness:.1f} s"
        )


def _say(line: str) -> None:
    """Print a line with names from elsewhere in it."""
    print(printable(line, LONGEST_MESSAGE), flush=True)


def _by_method(summary: Summary) -> dict[str, list[ResultRow]]:
    """The rows of each method, under the spec that it was asked for by."""
    groups: dict[str, list[ResultRow]] = {}
    for row in summary.rows:
        groups.setdefault(summary.spec(row), []).append(row)
    return groups


def _over(
    summary: Summary,
    rows: Sequence[ResultRow],
    name: str,
    over: Callable[[list[float]], float],
    form: str,
) -> str:
    """A field or a metric of some rows, `over` those that have a value, as text."""
    values = (
        summary.metrics.get(row.id, {}).get(name) if name in METRICS else getattr(row, name)
        for row in rows
    )
    known = [value for value in values if value is not None and not math.isnan(value)]
    return format(over(known), form) if known else "-"
