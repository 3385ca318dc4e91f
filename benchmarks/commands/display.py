"""What a user sees of a run: its plan, a progress bar, and its summary."""

from __future__ import annotations

import statistics
import sys
import time
from collections import Counter
from collections.abc import Sequence
from types import TracebackType
from typing import TYPE_CHECKING, Self

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn
from rich.progress import Progress as Bar
from rich.table import Table
from rich.text import Text

from benchmarks.running.planning import Cell
from benchmarks.running.runner import Progress, Summary
from parapoint.console import LONGEST_MESSAGE, printable

if TYPE_CHECKING:
    from benchmarks.store.rows import ResultRow

STATUSES = ("ok", "skipped", "failed", "timeout", "out_of_memory")
"""All statuses of a row, in the order of the summary's columns."""
BAD = STATUSES[2:]
"""The statuses of cells that a method should have mapped and did not."""
LISTED = 20
"""Number of cells that are listed one by one; of any others only the number is given."""


class Display(Progress):
    """Prints the plan of a run, and shows a bar on standard error if that is a terminal."""

    def __init__(self) -> None:
        """A display that shows nothing until it is entered."""
        console = Console(stderr=True)
        self._bar = Bar(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            console=console,
            transient=True,
            disable=not console.is_terminal,
        )
        self._task = self._bar.add_task("")
        self._running: dict[str, tuple[str, float]] = {}

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

    def planned(self, summary: Summary) -> None:
        """Print what the run is going to do, and why."""
        self._bar.update(self._task, total=len(summary.planned))
        for line in plan(summary).split("\n"):
            _say(line)

    def started(self, cell: Cell) -> None:
        """Show that a cell is running."""
        name = f"{cell.row.case} {cell.method.spec}"
        self._running[cell.row.id] = (name, time.monotonic())

    def ended(self, cell: Cell, row: ResultRow) -> None:
        """Count a cell as done; on a terminal, say so if its method failed."""
        self._running.pop(row.id, None)
        self._bar.advance(self._task)
        if row.status in BAD and not self._bar.disable:
            self._bar.console.print(
                escape(
                    printable(f"{cell.row.case} {cell.method.spec}: {ending(row)}", LONGEST_MESSAGE)
                )
            )

    def measured(self, done: int, total: int) -> None:
        """Show how many of the maps have been measured."""
        self._bar.update(self._task, description="metrics", completed=done, total=total)

    def tick(self) -> None:
        """Show how long each cell has been running."""
        now = time.monotonic()
        running = (f"{name} {now - began:.0f} s" for name, began in self._running.values())
        if self._running:
            self._bar.update(self._task, description=escape(printable(", ".join(running))))


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
    table = Table(title=f"{summary.suite.name}: {summary.suite.title}", title_justify="left")
    table.add_column("method")
    used = [status for status in STATUSES if any(row.status == status for row in summary.rows)]
    for status in used:
        table.add_column(status.replace("_", " "), justify="right")
    table.add_column("median seconds", justify="right")
    table.add_column("median MB", justify="right")
    for method, rows in _by_method(summary).items():
        counts = Counter[str](row.status for row in rows)
        table.add_row(
            Text(printable(method)),
            *(str(counts[status]) for status in used),
            _median([row.seconds for row in rows], ".3g"),
            _median([row.peak_memory_mb for row in rows], ".0f"),
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


def print_table(table: Table) -> None:
    """Print a table: drawn on a terminal, and as tab-separated lines anywhere else."""
    console = Console()
    if console.is_terminal:
        console.print(table)
        return
    if table.title:
        print(table.title)
    print("\t".join(str(column.header) for column in table.columns))
    cells = [[str(cell) for cell in column.cells] for column in table.columns]
    for line in zip(*cells, strict=True):
        print("\t".join(line))
    sys.stdout.flush()


def _by_method(summary: Summary) -> dict[str, list[ResultRow]]:
    """The rows of each method, under the spec that it was asked for by."""
    groups: dict[str, list[ResultRow]] = {}
    for row in summary.rows:
        groups.setdefault(summary.spec(row), []).append(row)
    return groups


def _median(values: Sequence[float | None], form: str) -> str:
    """The median of the values that are not None, as text."""
    known = [value for value in values if value is not None]
    return format(statistics.median(known), form) if known else "-"
