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
    assert remaining([], [2, 4], 100.0, 3) == pytest.approx(2)
    assert remaining([1, 1], [2, 4], 6.0, 3) == pytest.approx(18)


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
