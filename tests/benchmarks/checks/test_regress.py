"""Golden values: what counts as a move, how files are read and rewritten, what is in them."""

import csv
import math

import numpy as np
import pytest

from benchmarks.cases.suites import SUITES
from benchmarks.checks import regress
from benchmarks.checks.regress import COLUMNS, METHODS, Tolerance, change, file_name, moves, text
from benchmarks.metrics.table import METRICS
from parapoint import InputError


def cell(**values):
    return {"status": "ok"} | dict.fromkeys(COLUMNS, "1") | values


@pytest.mark.parametrize(
    ("old", "new", "relative", "absolute", "excess"),
    [
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
    allowed = dict.fromkeys(COLUMNS, Tolerance(1e-3, 0, "")) | {
        "chart_count": Tolerance(0, 0, ""),
    }
    golden = {"spot": cell(), "boat": cell(), "gone": cell()}
    now = {"spot": cell(chart_count="2", resolution="1.0005"), "boat": cell(), "new": cell()}
    found = {(move.case, move.metric) for move in moves("lscm", golden, now, allowed)}
    assert found == {("spot", "chart_count"), ("gone", "status"), ("new", "status")}
    assert moves("lscm", {"a": cell(status="ok")}, {"a": cell(status="failed")}, allowed)


def test_the_table_shows_the_farthest_first():
    found = [
        regress.Move("lscm", "spot", "chart_count", "1", "2", 3.0),
        regress.Move("lscm", "boat", "status", "ok", "failed"),
    ]
    columns = [[str(c) for c in column.cells] for column in regress.table(found).columns]
    assert columns[1] == ["boat", "spot"]
    assert columns[5] == ["", "+1"]


def test_golden_files_are_rewritten_in_the_order_of_the_suite(tmp_path):
    first, second = SUITES["core"].cases[:2]
    regress.write_golden("lscm", {second: cell(), "zebra": cell()}, tmp_path)
    regress.write_golden("lscm", {first: cell(resolution="7"), second: cell()}, tmp_path)
    rows = regress.golden_rows("lscm", tmp_path)
    assert list(rows) == [first, second, "zebra"]
    assert rows[first]["resolution"] == "7"
    assert regress.golden_rows("tutte", tmp_path) == {}


def test_file_names_say_which_method():
    assert file_name("lscm") == "lscm"
    assert file_name("slim(energy=symmetric_dirichlet)") == "slim_symmetric_dirichlet"
    assert len({file_name(spec) for spec in METHODS}) == len(METHODS)


def test_values_are_texts_of_nine_digits():
    assert [text(value) for value in (1.0, 1 / 3, np.inf, np.nan)] == [
        "1",
        "0.333333333",
        "inf",
        "",
    ]


def test_every_compared_metric_has_a_tolerance_and_a_reason():
    allowed = regress.tolerances()
    assert set(allowed) == set(COLUMNS)
    assert all(tolerance.reason for tolerance in allowed.values())
    assert all(0 <= tolerance.relative < 0.1 for tolerance in allowed.values())


def test_a_metric_without_a_tolerance_is_named(tmp_path):
    (tmp_path / "tolerances.csv").write_text("metric,relative,absolute,reason\n")
    with pytest.raises(InputError, match="no tolerance for angle_difference_mean"):
        regress.tolerances(tmp_path)


def test_known_figures_are_met_or_named():
    rows = regress.figures()
    assert {row["case"] for row in rows} == {"beetle_igl", "camelhead"}
    assert all(row["metric"] in METRICS and row["reason"] for row in rows)
    now = {row["method"]: {} for row in rows}
    assert regress.missed_figures(rows, now) == []
    for row in rows:
        now[row["method"]][row["case"]] = cell(angle_difference_mean=row["value"])
    assert regress.missed_figures(rows, now) == []
    now["lscm"]["camelhead"]["angle_difference_mean"] = "0.03"
    assert [(m.case, m.golden) for m in regress.missed_figures(rows, now)] == [
        ("camelhead", "0.0246")
    ]


@pytest.mark.parametrize("spec", METHODS)
def test_golden_files_have_every_case_and_column(spec):
    path = regress.GOLDEN / f"{file_name(spec)}.csv"
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["case"] for row in rows] == list(SUITES["core"].cases)
    for row in rows:
        assert set(row) == {"case", "status", *COLUMNS}
        assert row["status"] in ("ok", "skipped")
        assert all((row[name] != "") == (row["status"] == "ok") for name in COLUMNS)
