"""What the methods cost beside their libraries."""

import numpy as np
import pytest

from baselines import registry
from benchmarks.method_speed import BARE, Overhead, overhead_table, overheads
from benchmarks.metric_speed import speed_map


def test_costs_of_a_small_disk_are_those_of_the_same_work():
    pytest.importorskip("xatlas")
    costs = overheads((500,))
    assert [(cost.method, cost.faces) for cost in costs] == [(name, 512) for name in BARE]
    # Microseconds of checks beside milliseconds: loose, but a start or a trace too many would show.
    assert all(0 < cost.bare < 5 * cost.whole for cost in costs)
    assert all(cost.whole < 5 * cost.bare + 0.05 for cost in costs)


@pytest.mark.parametrize("spec", BARE)
def test_bare_call_is_the_library_s_part_of_the_method(spec, monkeypatch):
    library = pytest.importorskip("xatlas" if spec == "xatlas" else "igl")
    name = {"lscm": "lscm", "slim": "slim_precompute", "xatlas": "Atlas"}[spec]
    mesh, _ = speed_map("disk", 200)
    called = []
    whole = getattr(library, name)

    def counted(*arguments):
        called.append([np.array(value) for value in arguments[:3]])
        return whole(*arguments)

    monkeypatch.setattr(library, name, counted)
    made = registry.method(spec)[1].parameterize(mesh, seed=0)
    BARE[spec](mesh, made)
    assert len(called) == 2
    for there, here in zip(*called, strict=True):
        np.testing.assert_array_equal(there, here)


def test_table_shows_what_a_method_adds(capsys):
    from benchmarks.display import print_table

    print_table(overhead_table([Overhead("lscm", 10_000, 2.0, 2.1)]))
    assert "+5.0%" in capsys.readouterr().out
