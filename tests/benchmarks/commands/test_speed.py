"""Rates against the matrix product: what a processor that changes its speed does to them."""

import numpy as np
import pytest

from benchmarks.commands import speed
from benchmarks.commands.speed import Work


class Clock:
    """A machine of 100 FLOP/s that serves another program in every other second."""

    def __init__(self) -> None:
        self.now = 0.0

    def work(self, operations: float, efficiency: float) -> Work:
        def run() -> None:
            left = operations
            while left > 0:
                rate = efficiency * (100 if int(self.now) % 2 == 0 else 50)
                until = int(self.now) + 1 - self.now
                spent = min(until, left / rate)
                left -= spent * rate
                self.now += max(spent, 1e-9)

        return Work(run, operations)


def test_a_fraction_is_that_of_the_machine_at_its_speed_of_the_moment(monkeypatch) -> None:
    clock = Clock()
    monkeypatch.setattr(speed.time, "perf_counter", lambda: clock.now)
    monkeypatch.setattr(speed.time, "process_time", lambda: clock.now)
    product = clock.work(1.0, 1.0)
    found = speed._rate("a step", clock.work(3.0, 0.6), clock.work(2.0, 0.8), product)
    assert found.fraction == pytest.approx(0.6, rel=1e-3)
    assert found.bare_fraction == pytest.approx(0.75, rel=1e-3)
    assert 30 <= found.gflops * 1e9 <= 60


def test_each_row_of_the_table_is_measured(monkeypatch) -> None:
    small = {"PRODUCT": 32, "STEPS": (100,), "MAPPED": 300, "FEWEST_ROUNDS": 1, "ENOUGH": 0.0}
    for name, value in small.items():
        monkeypatch.setattr(speed, name, value)
    asked, products = [], speed._products

    def noted(*given, **how):
        asked.append((*given, how))
        return products(*given, **how)

    monkeypatch.setattr(speed, "_products", noted)
    monkeypatch.setattr("parapoint.learned.networks.products", lambda _, tangents: (tangents, 5))
    monkeypatch.setattr("parapoint.learned.networks.cost", lambda _: 7)
    rows = speed.training_rates()
    assert len(rows) == 5
    assert rows[0].gflops == pytest.approx(2 * 32**3 / rows[0].cpu_seconds / 1e9)
    assert rows[0].fraction == 1
    # A step of 100 points has a lattice of as many, of which Wrap takes three rows each.
    assert [(count, how["backward"]) for _, count, how in asked[::2]] == [(600, True)] * 2
    assert [how["backward"] for _, _, how in asked[1::2]] == [False] * 2
    # Two a product: of a step, forward and twice as many backward, in `learned` with two tangents
    # of the surface; and of Cut and Unwrap in a mapping.
    operations = [row.gflops * 1e9 * row.cpu_seconds for row in rows[1:]]
    paper, learned = (3 * 2 * (tangents * 100 + 5 * 100) for tangents in (0, 2))
    mapping = 2 * 300 * (7 + 7)
    assert operations == pytest.approx([paper, mapping, learned, mapping])
    assert all(row.fraction > 0 and row.cpu_seconds > 0 for row in rows)
    assert np.isnan(rows[0].bare_fraction)
    assert all(row.bare_fraction > 0 for row in rows[1:])
    assert speed.training_table().row_count == 5


@pytest.mark.parametrize(("backward", "times"), [(False, 1), (True, 3)])
def test_operations_of_layers_are_two_for_each_weight_and_row(backward, times) -> None:
    work = speed._products((4, 5), 10, backward=backward)
    assert work.operations == times * 2 * 10 * (3 * 4 + 4 * 5 + 5 * 3)
    work.run()


def test_a_first_round_which_warms_up_is_not_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nor is a piece of work measured less often than it takes for a median of some use."""
    now = [0.0]
    spans = iter([100.0, *[2.0] * 99])
    monkeypatch.setattr(speed.time, "perf_counter", lambda: now[0])
    monkeypatch.setattr(speed.time, "process_time", lambda: now[0] / 2)

    def run() -> None:
        now[0] += next(spans)

    times = speed._in_turn([Work(run, 1.0)])
    assert times.tolist() == [[[2.0, 1.0]]] * speed.FEWEST_ROUNDS
