"""What is expected of a run, by hand."""

import pytest

from benchmarks.cases import models
from benchmarks.cases.suites import Suite
from benchmarks.running import expectation
from benchmarks.running.expectation import (
    OTHERS,
    OVERHEAD,
    SECONDS_PER_10000_FACES,
    SECONDS_PER_ITERATION,
    USUAL_FACES,
    about,
    cell_seconds,
    clock,
    faces,
    remaining,
)


def test_a_cell_takes_as_long_as_its_faces_and_its_budget_allow(monkeypatch):
    monkeypatch.setattr(expectation, "faces", lambda _: 25_000)
    slim = SECONDS_PER_10000_FACES["slim"]
    assert cell_seconds("x", "slim", {}) == pytest.approx(2.5 * slim + OVERHEAD)
    assert cell_seconds("x", "new", {}) == pytest.approx(2.5 * OTHERS + OVERHEAD)
    assert cell_seconds("x", "slim", {"time_budget": 1.0}) == pytest.approx(1 + OVERHEAD)
    assert cell_seconds("x", "slim", {"time_budget": 9}) == pytest.approx(2.5 * slim + OVERHEAD)
    # What trains uses all of its time, and without a budget what its iterations take.
    assert cell_seconds("x", "fam", {"time_budget": 9}) == pytest.approx(9 + OVERHEAD)
    trained = 100 * SECONDS_PER_ITERATION + OVERHEAD
    assert cell_seconds("x", "parapoint", {"iterations": 100}) == pytest.approx(trained)
    assert cell_seconds("x", "parapoint", {"iterations": None}) == pytest.approx(300 + OVERHEAD)


def test_faces_are_those_of_the_registry_or_the_usual_number():
    name = next(iter(models.registry()))
    model = models.registry()[name]
    assert faces(name) == (model.faces or model.vertices)
    assert faces("no/such/file.obj") == USUAL_FACES


def test_a_suite_needs_all_its_cells_and_each_model_once(monkeypatch):
    monkeypatch.setattr(
        expectation, "cell_seconds", lambda case, method, _: len(case) + len(method)
    )
    first, second = list(models.registry())[:2]
    cases = (first, f"{first}@500", second, "made")
    suite = Suite("s", "S", cases=cases, methods=("a", "bb"), seeds=(0, 1, 2))
    needs = expectation.expectation(suite, lambda spec: (spec, {}))
    assert needs.cells == 4 * 2 * 3
    assert needs.seconds == 3 * sum(len(case) + k for case in cases for k in (1, 2))
    sizes = [models.registry()[name].size for name in (first, second)]
    assert needs.megabytes == pytest.approx(sum(sizes) / 1e6)


def test_what_remains_is_scaled_by_what_was_done():
    # All of 12 s is expected, of which 1.2 count as kept: a pace of (6 + 1.2) / (2 + 1.2) = 2.25.
    rest = remaining([(1, 3), (1, 3)], [(2, 1)], [4, 4], 2)
    assert rest == pytest.approx((2 * 2.25 - 1 + 2 * 4 * 2.25) / 2)


def test_before_a_cell_ends_the_expectation_is_kept():
    assert remaining([], [], [2, 4, 6], 2) == pytest.approx(6)
    assert remaining([], [(8, 3)], [2], 1) == pytest.approx(7)
    assert remaining([], [(2, 3)], [], 1) == 0
    assert remaining([], [], [], 1) == 0


def test_a_run_lasts_as_long_as_its_longest_cell():
    assert remaining([], [(9, 1)], [2], 4) == pytest.approx(8)


def test_one_slow_cell_does_not_upset_the_rest():
    """One of sixty cells that takes ten times as long as expected: the rest grows by half at most,
    and not tenfold."""
    assert remaining([(3, 30)], [], [10] * 59, 1) < 1.5 * 590


@pytest.mark.parametrize(
    ("seconds", "shown", "words"),
    [
        (0.4, "0:00:00", "10 s"),
        (59.6, "0:01:00", "60 s"),
        (84, "0:01:24", "80 s"),
        (89, "0:01:29", "90 s"),
        (90, "0:01:30", "2 min"),
        (3661, "1:01:01", "61 min"),
        (5399, "1:29:59", "90 min"),
        (5400, "1:30:00", "1.5 h"),
        (36_000, "10:00:00", "10.0 h"),
    ],
)
def test_times_are_told_roundly(seconds, shown, words):
    assert (clock(seconds), about(seconds)) == (shown, words)
