"""To which version of its suite a row belongs, as far as the run that wrote it has noted it."""

from __future__ import annotations

import pytest

from benchmarks.cases.suites import SUITES
from benchmarks.store import versions
from benchmarks.store.rows import ResultRow

RUNS = [{"suite_version": 3, "suite_hash": "abc"}, {"suite_hash": 7}, "no entry"]


@pytest.mark.parametrize(
    ("suite", "run", "version"),
    [
        ("paper", 0, "3 (abc)"),
        ("paper", 1, versions.UNKNOWN),
        ("paper", 2, versions.UNKNOWN),
        ("paper", 3, versions.UNKNOWN),
        ("paper", -1, versions.UNKNOWN),
        ("of a user", 0, ""),
    ],
)
def test_a_row_has_the_version_that_its_run_has_noted(suite: str, run: int, version: str) -> None:
    row = ResultRow("id", suite, "cone", "tutte", {}, 0, "source", "surface", "ok", run=run)
    assert versions.version(row, RUNS) == version


def test_a_run_notes_the_version_of_a_suite_that_has_one() -> None:
    paper = SUITES["paper"]
    assert versions.noted("paper") == {
        "suite": "paper",
        "suite_version": paper.version,
        "suite_hash": paper.digest,
    }
    assert versions.noted("of a user") == {"suite": "of a user"}
    assert versions.said({"1 (a)": 2, "unknown": 3}) == "2 of version 1 (a), 3 of version unknown"
