"""What there is, in lists."""

from baselines import registry
from benchmarks.cases import models
from benchmarks.cases.suites import SUITES
from benchmarks.commands import listing
from benchmarks.metrics.table import METRICS


def test_each_list_has_a_row_for_all_there_is():
    for name, known in {
        "suites": SUITES,
        "cases": models.names(),
        "methods": registry.names(),
        "metrics": METRICS,
    }.items():
        table = listing.LISTS[name]()
        assert [str(cell) for cell in table.columns[0].cells] == list(known)
        assert all(len(list(column.cells)) == len(list(known)) for column in table.columns)


def test_rows_say_what_is_known():
    def row(name, of):
        columns = listing.LISTS[name]().columns
        at = [str(cell) for cell in columns[0].cells].index(of)
        return {column.header: str(list(column.cells)[at]) for column in columns}

    assert row("methods", "slim")["requires"] == "disk_after_cut, faces"
    assert row("methods", "slim")["parameters"].endswith(", iterations=20")
    assert row("metrics", "symmetric_dirichlet")["ideal"] == "4.0"
    assert row("cases", "half_cylinder")["claim"] == "made in memory"
    spot = models.info("spot_c3d")
    assert row("cases", "spot_c3d")["topology"] == spot.topology
    claimed = next(model for model in models.registry().values() if model.claim)
    assert row("cases", claimed.name)["claim"] == claimed.claim
    smoke = SUITES["smoke"]
    assert row("suites", "smoke")["cases"] == ", ".join(smoke.cases)


def test_a_method_is_told_with_what_it_needs_and_its_licence():
    lines = listing.about("xatlas")
    assert lines[0] == registry.describe("xatlas").summary
    assert lines[1] == "Needs: faces. The same map for the same seed: yes."
    assert lines[2] == "Licence: MIT (xatlas)."
    assert listing.about("parapoint")[1].startswith("Needs: nothing. ")
    assert listing.about("parapoint+slim") == listing.about("unwrap")
    assert listing.about("never heard of") == []
    assert listing.credit("never heard of") == ("", ())
    assert listing.credit("parapoint+slim") == registry.credit("unwrap")
