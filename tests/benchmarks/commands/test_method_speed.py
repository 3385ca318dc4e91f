"""What the methods cost beside their libraries."""

import numpy as np
import pytest
from scipy import sparse

from baselines import registry
from benchmarks.commands.method_speed import BARE, Overhead, overhead_table, overheads
from benchmarks.commands.metric_speed import speed_map
from parapoint.method import MissingError

ENTRY = {
    "tutte": ("igl", "min_quad_with_fixed"),
    "harmonic": ("igl", "harmonic"),
    "lscm": ("igl", "lscm"),
    "arap": ("igl", "arap_precomputation"),
    "slim": ("igl", "slim_precompute"),
    "xatlas": ("xatlas", "Atlas"),
    "uvatlas": ("open3d", "t.geometry.TriangleMesh"),
    "uvunwrap": ("uvunwrap", "Mesh"),
    "meshlab_lscm": ("pymeshlab", "Mesh"),
    "meshlab_harmonic": ("pymeshlab", "Mesh"),
    "meshlab_voronoi": ("pymeshlab", "Mesh"),
    "meshlab_triangles": ("pymeshlab", "Mesh"),
}
"""The library of each method and the function of it that gets the arrays."""


def test_costs_of_a_small_disk_are_those_of_the_same_work(monkeypatch):
    monkeypatch.setattr("benchmarks.commands.method_speed.MOST_TIMES", 3)
    costs = overheads((500,))
    assert [(cost.method, cost.faces) for cost in costs] == [(name, 512) for name in BARE]
    measured = [cost for cost in costs if not cost.fault]
    assert {"tutte", "harmonic", "lscm", "arap", "slim"} <= {cost.method for cost in measured}
    # Microseconds of checks beside milliseconds: loose, but a start or a trace too many would show.
    assert all(0 < cost.bare < 5 * cost.whole for cost in measured)
    assert all(cost.whole < 5 * cost.bare + 0.05 for cost in measured)


def dense(value):
    return value.toarray() if sparse.issparse(value) else np.array(value)


@pytest.mark.parametrize("spec", BARE)
def test_bare_call_is_the_library_s_part_of_the_method(spec, monkeypatch):
    package, name = ENTRY[spec]
    library = pytest.importorskip(package)
    mesh, _ = speed_map("disk", 200)
    called = []

    def counted(*arguments):
        numbers = [value for value in arguments[3:] if isinstance(value, int | float)]
        called.append([dense(value) for value in (*arguments[:3], *numbers)])
        return whole(*arguments)

    *path, last = name.split(".")
    for part in path:
        library = getattr(library, part)
    whole = getattr(library, last)
    monkeypatch.setattr(library, last, counted)
    made = registry.method(spec)[1].parameterize(mesh, seed=0)
    call = BARE[spec](mesh, made)
    called_before = len(called)
    call()
    assert len(called) == called_before + 1
    for there, here in zip(called[0], called[-1], strict=True):
        np.testing.assert_array_equal(there, here)


def test_a_library_that_is_missing_is_a_row_with_its_reason(monkeypatch, capsys):
    from benchmarks.commands.tables import print_table

    def missing(*_):
        raise MissingError("needs the package nobodys")

    monkeypatch.setattr("benchmarks.commands.method_speed.BARE", {"lscm": missing})
    (cost,) = overheads((500,))
    assert cost.fault == "needs the package nobodys"
    print_table(overhead_table([cost, Overhead("lscm", 10_000, 2.0, 2.1)]))
    lines = [line.split("\t") for line in capsys.readouterr().out.splitlines()[1:]]
    assert lines == [
        ["method", "faces", "CPU seconds", "library alone", "more", "limit"],
        ["lscm", "512", "needs the package nobodys", "", "", "10%"],
        ["lscm", "10,000", "2.1000", "2.0000", "+5.0%", "10%"],
    ]
