"""`nox -s regress`: have the metric values of the methods moved?

Every deterministic method runs on the `core` suite (and a few more cells, for figures that are
known from elsewhere), and every metric of its maps is compared with the golden values:

    tests/golden/<method>.csv      case, status, metrics; one file a method
    tests/golden/tolerances.csv    relative and absolute tolerance of each metric, and the reason
    tests/golden/figures.csv       single values that are known, each with tolerance and reason

Cells are kept in results/regress and run again where the method's source, the surface or the
environment changed; metrics are computed anew where their source changed.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
from rich.table import Table
from rich.text import Text

from benchmarks.cases.suites import SUITES, Suite
from benchmarks.metrics.table import METRICS, WITHOUT_SPANNING
from parapoint import console
from parapoint.errors import InputError

GOLDEN = Path(__file__).parents[2] / "tests" / "golden"
RESULTS = Path("results") / "regress"
METHODS = (
    "tutte",
    "harmonic",
    "lscm",
    "bff",
    "arap",
    "slim(energy=symmetric_dirichlet)",
    "slim(energy=conformal)",
    "xatlas",
)
"""Every method that gives the same map each time and installs with the benchmark."""
COLUMNS = tuple(
    name
    for name, metric in METRICS.items()
    if metric.group not in ("points", "reference") and not name.endswith(WITHOUT_SPANNING)
)
"""Metrics compared. Without spanning faces these maps, most of them injective, read the same."""
DIGITS = 9


@dataclass(frozen=True)
class Tolerance:
    """How far a metric may move unnoticed: relative + absolute * golden value, and why so far."""

    relative: float
    absolute: float
    reason: str


@dataclass(frozen=True)
class Move:
    """A value that is not the golden one.

    Attributes:
        method: file of golden values.
        case: model.
        metric: which value; "status" for how the cell ended.
        golden: the value in the file, as text; "" for none.
        now: the value found, as text; "" for none.
        excess: the change in units of the tolerance; infinite where there is no number.
    """

    method: str
    case: str
    metric: str
    golden: str
    now: str
    excess: float = math.inf


Rows = dict[str, dict[str, str]]
"""Values of a method: case -> column -> text."""


def file_name(spec: str) -> str:
    """A method's spec as the name of its file, without the ending."""
    words = re.findall(r"[\w.]+", re.sub(r"\w+=", "", spec))
    return "_".join(words)


def read_rows(path: Path) -> list[dict[str, str]]:
    """The rows of a CSV file; none if there is no such file."""
    if not path.is_file():
        return []
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def tolerances(folder: Path = GOLDEN) -> dict[str, Tolerance]:
    """The tolerance of each metric of COLUMNS.

    Raises:
        InputError: a metric has none.
    """
    path = folder / "tolerances.csv"
    found = {
        row["metric"]: Tolerance(float(row["relative"]), float(row["absolute"]), row["reason"])
        for row in read_rows(path)
    }
    missing = [name for name in COLUMNS if name not in found]
    if missing:
        raise InputError(f"{path}: no tolerance for {', '.join(missing)}; add a line for each")
    return found


def golden_rows(spec: str, folder: Path = GOLDEN) -> Rows:
    """The golden values of a method."""
    return {row.pop("case"): row for row in read_rows(folder / f"{file_name(spec)}.csv")}


def write_golden(spec: str, rows: Rows, folder: Path = GOLDEN) -> None:
    """Rewrite the golden values of a method; cases that did not run now keep theirs."""
    merged = golden_rows(spec, folder) | rows
    order = {case: number for number, case in enumerate(SUITES["core"].cases)}
    with (folder / f"{file_name(spec)}.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["case", "status", *COLUMNS])
        for case in sorted(merged, key=lambda case: (order.get(case, len(order)), case)):
            writer.writerow([case, *(merged[case].get(name, "") for name in ("status", *COLUMNS))])


def text(value: float) -> str:
    """A value as it stands in a golden file: nine digits, "" for none."""
    return "" if math.isnan(value) else f"{value:.{DIGITS}g}"


def moves(spec: str, golden: Rows, now: Rows, allowed: Mapping[str, Tolerance]) -> list[Move]:
    """What moved by more than its tolerance; a cell that is new, gone or ends otherwise is one."""
    found = []
    for case in dict.fromkeys([*golden, *now]):
        before, after = golden.get(case, {}), now.get(case, {})
        old, new = before.get("status", "no cell"), after.get("status", "no cell")
        if old != new:
            found.append(Move(file_name(spec), case, "status", old, new))
            continue
        for column in COLUMNS:
            old, new = before.get(column, ""), after.get(column, "")
            excess = change(old, new, allowed[column].relative, allowed[column].absolute)
            if excess > 1:
                found.append(Move(file_name(spec), case, column, old, new, excess))
    return found


def change(old: str, new: str, relative: float, absolute: float) -> float:
    """The change in units of the tolerance: 0 for equal texts, infinite if one is no number."""
    if old == new:
        return 0.0
    try:
        before, after = float(old), float(new)
    except ValueError:
        return math.inf
    if not (math.isfinite(before) and math.isfinite(after)):
        return math.inf
    tolerance = absolute + relative * abs(before)
    return abs(after - before) / tolerance if tolerance > 0 else math.inf


def measured(suite: Suite) -> dict[str, Rows]:
    """Values of all cells of a suite by method spec; cases whose model is missing are left out."""
    from benchmarks.commands.display import Display, print_summary
    from benchmarks.running import environment, runner
    from benchmarks.store.results import Store

    with Display() as progress:
        summary = runner.run(suite, RESULTS, progress=progress, jobs=min(environment.cores(), 8))
    print_summary(summary)
    frame = Store(RESULTS).metrics().set_index("id")
    found: dict[str, Rows] = {spec: {} for spec in suite.methods}
    for row in [*summary.kept, *summary.ran]:
        if row.case not in summary.missing:
            values = frame.loc[row.id]
            cell: dict[str, str] = {name: text(float(str(values[name]))) for name in COLUMNS}
            status = "unmeasured" if row.id in summary.unmeasured else str(row.status)
            found[summary.spec(row)][row.case] = {"status": status} | cell
    return found


def figures(folder: Path = GOLDEN) -> list[dict[str, str]]:
    """The known figures: case, method (spec), metric, value, tolerance, reason."""
    return read_rows(folder / "figures.csv")


def missed_figures(rows: Iterable[Mapping[str, str]], now: Mapping[str, Rows]) -> list[Move]:
    """The known figures that are not met; those whose model is missing are left out."""
    found = []
    for row in rows:
        values = now.get(row["method"], {}).get(row["case"])
        if values is None:
            continue
        new = values[row["metric"]]
        excess = change(row["value"], new, 0.0, float(row["tolerance"]))
        if excess > 1:
            found.append(Move(row["method"], row["case"], row["metric"], row["value"], new, excess))
    return found


def table(found: Sequence[Move]) -> Table:
    """What moved, by how much, the farthest first."""
    shown = Table(title=f"{len(found)} values moved", title_justify="left")
    for heading in ("method", "case", "metric"):
        shown.add_column(heading)
    for heading in ("golden", "now", "change", "/ tolerance"):
        shown.add_column(heading, justify="right")
    for move in sorted(found, key=lambda move: -move.excess):
        try:
            difference = f"{float(move.now) - float(move.golden):+.3g}"
        except ValueError:
            difference = ""
        cells = (move.method, move.case, move.metric, move.golden, move.now, difference)
        shown.add_row(*map(Text, (*cells, f"{move.excess:.3g}")))
    return shown


@click.command()
@click.option("--update", is_flag=True, help="Rewrite the golden values with those found now.")
@click.pass_context
def main(ctx: click.Context, /, *, update: bool) -> None:
    """Compare the metric values of every deterministic method with the golden ones."""
    from benchmarks.commands.display import print_table

    allowed = tolerances()
    now = measured(Suite("regress", "Golden values", SUITES["core"].cases, METHODS))
    cells = sum(len(rows) for rows in now.values())
    if not cells:
        raise InputError("no model of the core suite is at hand, so there is nothing to compare")
    found: list[Move] = []
    for spec, rows in now.items():
        golden = {case: row for case, row in golden_rows(spec).items() if case in rows}
        found += moves(spec, golden, rows, allowed)
        if update:
            write_golden(spec, rows)
    missed = missed_figures(figures(), now | _other_cells(now))
    if found or missed:
        print_table(table([*missed, *found]))
    absent = len(METHODS) * len(SUITES["core"].cases) - cells
    print(
        f"{cells} cells compared, {absent} without their model: {len(found)} values moved, "
        f"{len(missed)} known figures missed{'; golden values rewritten' if update else ''}"
    )
    if missed or (found and not update):
        ctx.exit(1)


def _other_cells(now: Mapping[str, Rows]) -> dict[str, Rows]:
    """The values of the methods that known figures need and the comparison does not run."""
    wanted: dict[str, Any] = {}
    for row in figures():
        if row["method"] not in now:
            wanted.setdefault(row["method"], []).append(row["case"])
    found: dict[str, Rows] = {}
    for spec, cases in wanted.items():
        found |= measured(Suite("regress", "Known figures", tuple(cases), (spec,)))
    return found


if __name__ == "__main__":
    console.run(main)
