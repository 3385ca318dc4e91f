"""Golden values: what counts as a move, how files are read and rewritten, what is in them."""

import csv
import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

from benchmarks.cases.suites import Suite
from benchmarks.checks import regress
from benchmarks.checks.regress import (
    COMPARISONS,
    SOLVERS,
    Comparison,
    Tolerance,
    cell,
    change,
    file_name,
    moves,
    text,
)
from benchmarks.metrics.table import METRICS
from parapoint import InputError


def line(**values):
    return {"status": "ok"} | dict.fromkeys(SOLVERS.metrics, "1") | values


@pytest.mark.parametrize(
    ("old", "new", "relative", "absolute", "excess"),
    [
        ("-2", "-2.5", 0.1, 0.3, 1),
        ("1", "1", 0, 0, 0),
        ("1", "1.001", 0.01, 0, 0.1),
        ("1", "1.03", 0.01, 0, 3),
        ("0", "1e-10", 0, 1e-9, 0.1),
        ("2", "3", 0, 0, math.inf),
        ("inf", "inf", 0, 0, 0),
        ("inf", "9", 1, 1, math.inf),
        ("ok", "failed", 1, 1, math.inf),
        ("", "1", 1, 1, math.inf),
    ],
)
def test_a_change_in_units_of_its_tolerance(old, new, relative, absolute, excess):
    assert change(old, new, relative, absolute) == pytest.approx(excess)


def test_what_moved_is_named_with_its_case():
    allowed = dict.fromkeys(SOLVERS.metrics, Tolerance(1e-3, 0, "")) | {
        "chart_count": Tolerance(0, 0, ""),
    }
    golden = {"spot": line(), "boat": line(), "gone": line()}
    now = {"spot": line(chart_count="2", resolution="1.0005"), "boat": line(), "new": line()}
    found = {(move.case, move.metric) for move in moves("lscm", golden, now, allowed)}
    assert found == {("spot", "chart_count"), ("gone", "status"), ("new", "status")}
    assert moves("lscm", {"a": line(status="ok")}, {"a": line(status="failed")}, allowed)
    at_most = dict.fromkeys(SOLVERS.metrics, Tolerance(0, 1, ""))
    assert not moves("lscm", {"a": line(resolution="2")}, {"a": line(resolution="3")}, at_most)


def test_the_table_shows_the_farthest_first():
    found = [
        regress.Move("lscm", "spot", "chart_count", "1", "2", 3.0),
        regress.Move("lscm", "boat", "status", "ok", "failed"),
    ]
    columns = [[str(c) for c in column.cells] for column in regress.table(found).columns]
    assert columns[1] == ["boat", "spot"]
    assert columns[5:] == [["", "+1"], ["inf", "3"]]
    headings = [str(column.header) for column in regress.table(found).columns]
    assert headings == ["method", "case", "metric", "golden", "now", "change", "/ tolerance"]


@pytest.fixture
def comparison(tmp_path, monkeypatch):
    monkeypatch.setattr(regress, "GOLDEN", tmp_path)
    (tmp_path / "two").mkdir()
    return Comparison("two", ("lscm", "tutte"), ("spot", "boat"), ("resolution", "chart_count"))


def test_golden_files_are_rewritten_in_the_order_of_the_cases(comparison):
    regress.write_golden("lscm", {"boat": line(), "zebra": line()}, comparison)
    regress.write_golden("lscm", {"spot": line(resolution="7"), "boat": line()}, comparison)
    rows = regress.golden_rows("lscm", comparison)
    assert list(rows) == ["spot", "boat", "zebra"]
    assert rows["spot"] == {"status": "ok", "resolution": "7", "chart_count": "1"}
    assert regress.golden_rows("tutte", comparison) == {}


def test_a_row_has_every_metric_and_is_empty_where_there_is_none():
    made = cell("ok", {"chart_count": 2.0, "seam_length": math.inf})
    assert set(made) == {"status", *METRICS}
    assert (made["chart_count"], made["seam_length"], made["resolution"]) == ("2", "inf", "")


def test_file_names_say_which_method():
    assert file_name("lscm") == "lscm"
    assert file_name("slim(energy=symmetric_dirichlet)") == "slim_symmetric_dirichlet"
    specs = [spec for comparison in COMPARISONS for spec in comparison.methods]
    assert len({file_name(spec) for spec in specs}) == len(specs)


def test_values_are_texts_of_nine_digits():
    assert [text(value) for value in (1.0, 1 / 3, np.inf, np.nan)] == [
        "1",
        "0.333333333",
        "inf",
        "",
    ]


@pytest.mark.parametrize(("number", "largest"), [(0, 0.1), (1, 0.1), (2, 1.0)])
def test_every_compared_metric_has_a_tolerance_and_a_reason(number, largest):
    allowed = regress.tolerances(COMPARISONS[number])
    assert tuple(allowed) == COMPARISONS[number].metrics
    assert all(tolerance.reason for tolerance in allowed.values())
    assert all(0 <= tolerance.relative <= largest for tolerance in allowed.values())


def test_a_metric_without_a_tolerance_is_named(comparison):
    path = comparison.folder / "tolerances.csv"
    path.write_text("metric,relative,absolute,reason\nresolution,0,0,none\n")
    with pytest.raises(InputError, match="no tolerance for chart_count"):
        regress.tolerances(comparison)


def test_known_figures_are_met_or_named():
    rows = regress.figures()
    assert {row["case"] for row in rows} == {"beetle_igl", "camelhead"}
    assert all(row["metric"] in METRICS and row["reason"] for row in rows)
    now = {row["method"]: {} for row in rows}
    assert regress.missed_figures(rows, now) == []
    for row in rows:
        now[row["method"]][row["case"]] = line(angle_difference_mean=row["value"])
    assert regress.missed_figures(rows, now) == []
    now["lscm"]["camelhead"]["angle_difference_mean"] = "0.02461"
    assert regress.missed_figures(rows, now) == []  # within its tolerance
    now["lscm"]["camelhead"]["angle_difference_mean"] = "0.03"
    assert [(m.case, m.golden) for m in regress.missed_figures(rows, now)] == [
        ("camelhead", "0.0246")
    ]
    del now["lscm"]["beetle_igl"]  # a model that is not at hand says nothing of the others
    assert len(regress.missed_figures(rows, now)) == 1


@pytest.mark.parametrize(
    ("comparison", "spec"),
    [(comparison, spec) for comparison in COMPARISONS for spec in comparison.methods],
    ids=lambda value: getattr(value, "name", value),
)
def test_golden_files_have_every_case_and_column(comparison, spec):
    path = comparison.folder / f"{file_name(spec)}.csv"
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["case"] for row in rows] == list(comparison.cases)
    for row in rows:
        assert set(row) == {"case", "status", *comparison.metrics}
        assert row["status"] in ("ok", "skipped")
        assert any(row[name] for name in comparison.metrics) == (row["status"] == "ok")


class Run:
    """A run of a suite that computes nothing: three cells, one of them without its model."""

    def __init__(self, suite: Suite) -> None:
        self.missing = {"boat": "download it"}
        self.unmeasured = {"2": "too large"}
        self.kept = [SimpleNamespace(id="0", case="spot", status="ok")]
        self.ran = [
            SimpleNamespace(id="1", case="boat", status="skipped"),
            SimpleNamespace(id="2", case="hand", status="ok"),
        ]
        (self.name,) = suite.methods

    def spec(self, _: object) -> str:
        return self.name


def test_cells_are_measured_but_those_without_a_model(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    frame = pd.DataFrame(math.nan, index=range(3), columns=list(METRICS)).assign(id=list("012"))
    frame.loc[0, "chart_count"] = 3.0
    monkeypatch.setattr(regress, "RESULTS", tmp_path)
    monkeypatch.setattr("benchmarks.running.runner.run", lambda suite, *_, **__: Run(suite))
    monkeypatch.setattr("benchmarks.commands.display.print_summary", lambda _: None)
    monkeypatch.setattr("benchmarks.store.measuring.metrics", lambda _: frame)
    found = regress.measured(Suite("regress", "", ("spot", "boat", "hand"), ("lscm",)))
    assert found == {
        "lscm": {"spot": cell("ok", {"chart_count": 3.0}), "hand": cell("unmeasured", {})}
    }


@pytest.fixture
def golden(comparison: Comparison, monkeypatch: pytest.MonkeyPatch) -> Comparison:
    """Golden values of two methods and two models, of which one is at hand, and known figures."""
    lines = "".join(f"{name},0,0.5,why\n" for name in comparison.metrics)
    path = comparison.folder / "tolerances.csv"
    path.write_text(f"metric,relative,absolute,reason\n{lines}")
    for spec in comparison.methods:
        regress.write_golden(spec, {"spot": line(), "boat": line()}, comparison)
    figures = "spot,lscm,resolution,1,0.5,why\nhand,slim,resolution,1,0.5,why\n"
    header = "case,method,metric,value,tolerance,reason\n"
    (comparison.folder.parent / "figures.csv").write_text(header + figures)
    monkeypatch.setattr(regress, "COMPARISONS", (comparison,))
    monkeypatch.setattr(
        regress, "figures", lambda: regress.read_rows(path.parents[1] / "figures.csv")
    )
    return comparison


@pytest.mark.parametrize(
    ("change", "update", "ends"),
    [
        ({"resolution": "1.4"}, [], (0, 0, 0)),
        ({"resolution": "1.6"}, [], (1, 1, 1)),
        ({"resolution": "1.6"}, ["--update"], (1, 1, 1)),
        ({"chart_count": "2"}, [], (1, 1, 0)),
        ({"chart_count": "2"}, ["--update"], (0, 1, 0)),
    ],
)
def test_what_moved_ends_the_comparison_unless_it_is_meant(
    change: dict[str, str],
    update: list[str],
    ends: tuple[int, int, int],
    golden: Comparison,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Golden values can be rewritten; known figures cannot. Only models at hand are compared."""
    asked: list[tuple[tuple[str, ...], tuple[str, ...]]] = []

    def measured(suite: Suite) -> dict[str, regress.Rows]:
        asked.append((suite.cases, suite.methods))
        here = {"lscm": {"spot": line(**change)}, "tutte": {"spot": line()}}
        return {spec: here.get(spec, {"hand": line()}) for spec in suite.methods}

    monkeypatch.setattr(regress, "measured", measured)
    ended = CliRunner().invoke(regress.main, update)
    status, moved, missed = ends
    assert ended.exit_code == status
    said = f"{moved} values moved, {missed} known figures missed"
    rewritten = "; golden values rewritten" if update else ""
    *table, last = ended.output.splitlines()
    assert last == f"2 cells compared, 2 without their model: {said}{rewritten}"
    assert bool(table) == bool(moved)
    assert asked == [(("spot", "boat"), ("lscm", "tutte")), (("hand",), ("slim",))]
    ((name, value),) = change.items()
    assert regress.golden_rows("lscm", golden)["spot"][name] == (value if update else "1")
    assert regress.golden_rows("lscm", golden)["boat"][name] == "1"


def test_a_comparison_without_any_model_is_refused(
    golden: Comparison, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(regress, "measured", lambda _: {spec: {} for spec in golden.methods})
    ended = CliRunner().invoke(regress.main)
    assert isinstance(ended.exception, InputError)
    assert "no model is at hand" in str(ended.exception)
