"""What a run shows: a log without a terminal, a bar that fits one, and a summary with quality."""

from __future__ import annotations

import dataclasses
import io

import pytest
from rich.console import Console

from benchmarks.cases.suites import SUITES, Suite
from benchmarks.commands import display
from benchmarks.commands.display import Display, print_summary
from benchmarks.running import expectation
from benchmarks.running.planning import Cell, Chosen
from benchmarks.running.runner import Summary
from benchmarks.store.rows import ResultRow

LONG = "slim(energy=symmetric_dirichlet, iterations=20, tolerance=0.000001)"


def cells(*cases: str) -> list[Cell]:
    method = Chosen(LONG, "slim", {}, "abc", ())
    return [
        Cell(
            ResultRow(f"{at:032x}", "paper", case, "slim", {}, 0, "abc", "", "skipped"),
            method,
            "new",
        )
        for at, case in enumerate(cases)
    ]


@pytest.fixture
def clock(monkeypatch):
    """Seconds that pass as a test says."""
    now = [0.0]
    monkeypatch.setattr(display.time, "monotonic", lambda: now[0])
    return now


def test_without_a_terminal_each_end_is_a_line_and_a_minute_never_silent(clock, capsys):
    first, second = cells("beetle_igl", "hand_1_i_f5000")
    suite = SUITES["paper"]
    with Display() as shown:
        shown.planned(Summary(suite, [first.method], [first, second]))
        shown.started(first)
        for clock[0] in (20, 59, 60, 61, 90, 119, 125):
            shown.tick()
        clock[0] = 130.0
        done = ResultRow(**(vars(first.row) | {"status": "ok", "seconds": 130.0}))
        shown.ended(first, done)
        shown.started(second)
        clock[0] = 140.0
        shown.ended(
            second, ResultRow(**(vars(second.row) | {"status": "failed", "reason": "no\nway"}))
        )
    lines = capsys.readouterr().err.splitlines()
    assert [line.partition("]")[0] for line in lines] == ["[0/2", "[0/2", "[1/2", "[2/2"]
    assert f"running: beetle_igl {LONG} 60 s (0:01:00 so far, " in lines[0]
    assert lines[2].startswith(f"[1/2] beetle_igl {LONG}: ok, 130 s (0:02:10 so far, ")
    assert lines[3] == rf"[2/2] hand_1_i_f5000 {LONG}: failed: no\nway (0:02:20 so far)"


def test_on_a_terminal_the_bar_fits_80_columns_with_count_and_times(clock, monkeypatch, capsys):
    terminal = Console(file=io.StringIO(), force_terminal=True, width=80, color_system=None)
    monkeypatch.setattr(display, "terminal", lambda **_: terminal)
    (cell,) = cells("a case with a name that goes on and on and on, far beyond any window")
    shown = Display()
    shown.planned(Summary(SUITES["paper"], [cell.method], [cell]))
    shown.started(cell)
    clock[0] = 7.0
    shown.tick()
    lines = terminal.render_lines(shown._bar.get_renderable(), pad=False)
    assert len(lines) == 1
    text = "".join(segment.text for segment in lines[0])
    assert len(text) <= 80
    assert text.startswith("a case with a name")
    assert "0/1" in text
    assert text.rstrip().endswith("left")
    assert capsys.readouterr().err == ""


def test_the_size_of_a_download_is_none_only_where_nothing_is():
    assert [expectation.size(mb) for mb in (0, 0.2, 0.9, 1.4, 30)] == [
        "0 MB",
        "< 1 MB",
        "< 1 MB",
        "1 MB",
        "30 MB",
    ]


def test_times_are_said_in_round_numbers():
    assert expectation.clock(3725.4) == "1:02:05"
    assert [expectation.about(s) for s in (3, 44, 100, 7000)] == ["10 s", "40 s", "2 min", "1.9 h"]


def test_a_suite_s_needs_by_hand():
    suite = Suite("x", "x", ("beetle_igl", "beetle_igl@uneven", "cone"), ("a", "b"), (0, 1))
    needs = expectation.expectation(
        suite, lambda spec: ("fam" if spec == "a" else "slim", {"time_budget": 100.0})
    )
    rate = expectation.SECONDS_PER_10000_FACES["slim"]
    once = 3 * 100 + rate * (3.8656 + 2) + 6 * expectation.OVERHEAD
    assert needs.cells == 12
    assert needs.seconds == pytest.approx(2 * once)
    assert needs.megabytes == pytest.approx(1.336907)


def test_the_summary_counts_grades_and_names_the_worst_part(capsys):
    base = {
        "flipped_area_fraction_without_spanning": 0.0,
        "overlap_area_without_spanning": 0.0,
        "degenerate_uv_count": 0.0,
        "part_area_ratio_min_without_spanning": 1.0,
        "coverage": 1.0,
        "starved_area_fraction_without_spanning": 0.0,
        "symmetric_dirichlet_without_spanning": 4.1,
        "flipped_fraction_without_spanning": 0.0,
    }
    made = cells("a", "b", "c", "d")
    rows = [ResultRow(**(vars(cell.row) | {"status": "ok", "seconds": 2.0})) for cell in made[:3]]
    rows.append(ResultRow(**(vars(made[3].row) | {"status": "timeout", "reason": "late"})))
    summary = Summary(SUITES["paper"], [made[0].method], ran=rows)
    summary.metrics = {
        rows[0].id: base | {"angle_difference_mean": 0.1},
        rows[1].id: base
        | {"angle_difference_mean": 0.2, "part_area_ratio_min_without_spanning": 0.05},
        rows[2].id: base | {"angle_difference_mean": 0.9, "overlap_area_without_spanning": 0.5},
    }
    print_summary(summary)
    lines = capsys.readouterr().out.splitlines()
    heads, values = lines[1].split("\t"), lines[2].split("\t")
    assert dict(zip(heads, values, strict=True)) == {
        "method": LONG,
        "ok": "3",
        "timeout": "1",
        "usable": "1",
        "collapsed": "1",
        "broken": "1",
        "angle": "0.200",
        "worst part": "0.05",
        "s": "2",
        "MB": "-",
    }


def test_the_summary_ends_with_what_went_wrong_and_what_the_harness_took(
    capsys: pytest.CaptureFixture[str],
) -> None:
    *bad, good = cells(*(f"case {n}" for n in range(23)))
    late = {"status": "timeout", "reason": "late"}
    rows = [ResultRow(**(vars(cell.row) | late)) for cell in bad]
    rows.append(ResultRow(**(vars(good.row) | {"status": "ok"})))
    summary = Summary(SUITES["paper"], [good.method], ran=rows, seconds=10.0, method_seconds=7.5)
    summary.unmeasured = {good.row.id: "too large"}
    summary.missing = {"cow": "download it"}
    print_summary(summary)
    assert capsys.readouterr().out.splitlines()[3:] == [
        *(f"case {n}, {LONG}: timeout: late" for n in range(20)),
        "and 2 more that did not end well: see runs.jsonl",
        f"case 22, {LONG}: no metrics: too large",
        "cow is left out: download it",
        "23 cells in 10.0 s, of which the harness took 2.5 s",
    ]


def test_a_plan_names_the_first_cells_that_run_again_and_why() -> None:
    new, *again = cells(*(f"case {n}" for n in range(23)))
    again = [dataclasses.replace(cell, why="method changed") for cell in again]
    summary = Summary(SUITES["paper"], [new.method], [new, *again], kept=[new.row])
    assert display.plan(summary).splitlines() == [
        "paper: 23 cells to run (22 method changed, 1 new); 1 are done already",
        *(f"again: case {n}, {LONG}, seed 0: method changed" for n in range(1, 21)),
        "and 2 more again",
    ]
    assert display.plan(Summary(SUITES["paper"], [])) == "paper: 0 cells to run"
