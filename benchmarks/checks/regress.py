"""`nox -s regress`: have the metric values of the methods moved?

It runs methods that give the same map each time, and compares the metrics of their maps with golden
values. There are three comparisons: solvers on the suite `core`, and computed and trained maps on a
few models.

    tests/golden/solvers/<method>.csv      case, status, metrics; one file a method
    tests/golden/solvers/tolerances.csv    relative and absolute tolerance of each metric, and why
    tests/golden/computed/...              the same for the computed map and for `unwrap`
    tests/golden/trained/...               the same for the networks
    tests/golden/figures.csv               single known values, with tolerance and reason

Cells are kept in results/regress. A cell runs again where the source of its method, its surface or
the version of a library that the method names has changed, and is measured again where the source
of a metric has. A change that is meant to move values rewrites them with --update, and its commit
says by how much they moved.
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
from benchmarks.metrics.metric import WITHOUT_SPANNING
from benchmarks.metrics.table import METRICS
from parapoint import console
from parapoint.errors import InputError

GOLDEN = Path(__file__).parents[2] / "tests" / "golden"
RESULTS = Path("results") / "regress"
DIGITS = 9
"""Significant digits of a golden value."""


@dataclass(frozen=True)
class Comparison:
    """Methods, cases and metrics that are compared.

    Attributes:
        name: the name of the folder of golden values.
        methods: the specs of methods that give the same map each time.
        cases: the models.
        metrics: the names of the metrics.
    """

    name: str
    methods: tuple[str, ...]
    cases: tuple[str, ...]
    metrics: tuple[str, ...]

    @property
    def folder(self) -> Path:
        """Where the golden values and their tolerances are."""
        return GOLDEN / self.name


SOLVERS = Comparison(
    "solvers",
    (
        "tutte",
        "harmonic",
        "lscm",
        "bff",
        "arap",
        "slim(energy=symmetric_dirichlet)",
        "slim(energy=conformal)",
        "xatlas",
    ),
    SUITES["core"].cases,
    tuple(
        name
        for name, metric in METRICS.items()
        if metric.group not in ("points", "reference") and not name.endswith(WITHOUT_SPANNING)
    ),
)
"""Some of the baselines that give the same map each time and install with the benchmark.

Metrics without spanning faces are left out: most of these maps are one to one and have none.
"""
QUALITY = (
    "angle_difference_mean_without_spanning",
    "area_discrepancy_total_without_spanning",
    "area_log_ratio_mean_without_spanning",
    "area_ratio_p01_without_spanning",
    "part_area_ratio_min_without_spanning",
    "starved_area_fraction_without_spanning",
    "flipped_fraction_without_spanning",
    "flipped_uv_area_fraction_without_spanning",
    "overlap_area_without_spanning",
    "degenerate_uv_count",
    "spanning_fraction",
    "seam_length",
    "uv_boundary_length",
    "local_quasi_conformal_mean_without_spanning",
    "local_area_log_ratio_mean_without_spanning",
    "point_part_area_ratio_min",
    "starved_point_fraction",
    "neighbour_preservation",
    "uv_collision_fraction",
    "spanning_point_fraction",
)
"""The metrics that show how good a map of a mesh or of a cloud is: angles, areas, the worst part,
flips, overlaps, seams."""
COMPUTED = Comparison(
    "computed",
    ("computed(points=4000)", "computed", "unwrap"),
    (
        "hand_1_i_f5000",
        "max_planck_i_f8000",
        "cylinder_cgal",
        "spot_c3d",
        "fertility",
        "eight_cfwen",
        "kitten",
        "fairing-cross@noise=0.01",
    ),
    QUALITY,
)
"""Disks, a slit cylinder, closed surfaces of genus 0, 4 and 2, a scan and a noisy cloud.

On these models the seam does not move when the vertices move by 1e-14 to 1e-12 of their
coordinates, so that rounding on another machine does not move it either.
"""
TRAINED = Comparison(
    "trained",
    tuple(
        f"parapoint(preset={preset}, points=500, iterations=200, subset=128, device=cpu, threads=1)"
        for preset in ("paper", "learned")
    ),
    ("hand_1_i_f5000", "max_planck_i_f8000"),
    QUALITY,
)
"""Short runs of each preset. `benchmarks.checks.losses` compares their first steps more closely."""
COMPARISONS = (SOLVERS, COMPUTED, TRAINED)


@dataclass(frozen=True)
class Tolerance:
    """How far a metric may move, absolute + relative * golden value, and the reason."""

    relative: float
    absolute: float
    reason: str


@dataclass(frozen=True)
class Move:
    """A value that differs from its golden one.

    Attributes:
        method: the name of the method's file of golden values.
        case: the model.
        metric: the metric; "status" for how the cell ended.
        golden: the value on file, as text; "" for none.
        now: the value that was found, as text; "" for none.
        excess: the change in units of the tolerance; infinite where there is no number.
    """

    method: str
    case: str
    metric: str
    golden: str
    now: str
    excess: float = math.inf


Rows = dict[str, dict[str, str]]
"""The values of a method as text, by case and column."""


def file_name(spec: str) -> str:
    """The name of the file of a method, made of its spec, without the ending."""
    words = re.findall(r"[\w.]+", re.sub(r"\w+=", "", spec))
    return "_".join(words)


def read_rows(path: Path) -> list[dict[str, str]]:
    """The rows of a CSV file; none if there is no such file."""
    if not path.is_file():
        return []
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def tolerances(comparison: Comparison) -> dict[str, Tolerance]:
    """The tolerance of each metric that is compared.

    Raises:
        InputError: a metric has none.
    """
    path = comparison.folder / "tolerances.csv"
    found = {
        row["metric"]: Tolerance(float(row["relative"]), float(row["absolute"]), row["reason"])
        for row in read_rows(path)
    }
    missing = [name for name in comparison.metrics if name not in found]
    if missing:
        raise InputError(f"{path}: no tolerance for {', '.join(missing)}; add a line for each")
    return {name: found[name] for name in comparison.metrics}


def golden_rows(spec: str, comparison: Comparison) -> Rows:
    """The golden values of a method."""
    path = comparison.folder / f"{file_name(spec)}.csv"
    return {row.pop("case"): row for row in read_rows(path)}


def write_golden(spec: str, rows: Rows, comparison: Comparison) -> None:
    """Rewrite the golden values of a method; cases that did not run now keep theirs."""
    merged = golden_rows(spec, comparison) | rows
    order = {case: number for number, case in enumerate(comparison.cases)}
    columns = ("status", *comparison.metrics)
    path = comparison.folder / f"{file_name(spec)}.csv"
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["case", *columns])
        for case in sorted(merged, key=lambda case: (order.get(case, len(order)), case)):
            writer.writerow([case, *(merged[case].get(name, "") for name in columns)])


def text(value: float) -> str:
    """A value as it stands in a golden file: nine digits, "" for none."""
    return "" if math.isnan(value) else f"{value:.{DIGITS}g}"


def moves(spec: str, golden: Rows, now: Rows, allowed: Mapping[str, Tolerance]) -> list[Move]:
    """The values that moved by more than their tolerance, and the cells that end otherwise now."""
    found = []
    for case in dict.fromkeys([*golden, *now]):
        before, after = golden.get(case, {}), now.get(case, {})
        old, new = before.get("status", "no cell"), after.get("status", "no cell")
        if old != new:
            found.append(Move(file_name(spec), case, "status", old, new))
            continue
        for column, tolerance in allowed.items():
            old, new = before.get(column, ""), after.get(column, "")
            excess = change(old, new, tolerance.relative, tolerance.absolute)
            if excess > 1:
                found.append(Move(file_name(spec), case, column, old, new, excess))
    return found


def change(old: str, new: str, relative: float, absolute: float) -> float:
    """The change in units of the tolerance: 0 for equal texts, inf where one is not a number."""
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


def cell(status: str, values: Mapping[str, float]) -> dict[str, str]:
    """A row of golden values: how a cell ended, and its metrics."""
    return {"status": status} | {name: text(values.get(name, math.nan)) for name in METRICS}


def measured(suite: Suite) -> dict[str, Rows]:
    """The values of all cells of a suite, by spec of the method; missing models are left out."""
    from benchmarks.commands.display import Display, print_summary
    from benchmarks.running import environment, runner
    from benchmarks.store import measuring
    from benchmarks.store.results import Store

    with Display() as progress:
        summary = runner.run(suite, RESULTS, progress=progress, jobs=min(environment.cores(), 8))
    print_summary(summary)
    frame = measuring.metrics(Store(RESULTS)).set_index("id")
    found: dict[str, Rows] = {spec: {} for spec in suite.methods}
    for row in [*summary.kept, *summary.ran]:
        if row.case not in summary.missing:
            values = {name: float(str(frame.loc[row.id][name])) for name in METRICS}
            status = "unmeasured" if row.id in summary.unmeasured else str(row.status)
            found[summary.spec(row)][row.case] = cell(status, values)
    return found


def figures(folder: Path = GOLDEN) -> list[dict[str, str]]:
    """The known figures: case, method (spec), metric, value, tolerance, reason."""
    return read_rows(folder / "figures.csv")


def missed_figures(rows: Iterable[Mapping[str, str]], now: Mapping[str, Rows]) -> list[Move]:
    """The known figures that are missed; those of missing models are left out."""
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
    """What moved and by how much; what moved most comes first."""
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
    """Compare the metric values of some deterministic methods with the golden ones."""
    from benchmarks.commands.tables import print_table

    allowed = {comparison.name: tolerances(comparison) for comparison in COMPARISONS}
    found: list[Move] = []
    now: dict[str, Rows] = {}
    cells = absent = 0
    for comparison in COMPARISONS:
        title = f"Golden values: {comparison.name}"
        values = measured(Suite("regress", title, comparison.cases, comparison.methods))
        for spec, rows in values.items():
            golden = golden_rows(spec, comparison)
            held = {case: row for case, row in golden.items() if case in rows}
            found += moves(spec, held, rows, allowed[comparison.name])
            if update:
                write_golden(spec, rows, comparison)
            cells += len(rows)
            absent += len(comparison.cases) - len(rows)
        now |= values
    if not cells:
        raise InputError("no model is at hand, so there is nothing to compare")
    missed = missed_figures(figures(), now | _other_cells(now))
    if found or missed:
        print_table(table([*missed, *found]))
    print(
        f"{cells} cells compared, {absent} without their model: {len(found)} values moved, "
        f"{len(missed)} known figures missed{'; golden values rewritten' if update else ''}"
    )
    if missed or (found and not update):
        ctx.exit(1)


def _other_cells(now: Mapping[str, Rows]) -> dict[str, Rows]:
    """The values of methods that known figures need, where no comparison has run them."""
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
