"""Growth of the seam to where places are starved of area."""

from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.cases import builtin
from benchmarks.metrics.evaluation import evaluate
from parapoint.planar.descent import Run
from parapoint.planar.growth import Need, _shortened, grown
from parapoint.surfaces.areas import LEAST_PART, starved_share
from parapoint.surfaces.parameterization import Parameterization


def test_a_seam_leads_to_what_is_starved() -> None:
    mesh = builtin.finger()
    run = Run(mesh)
    run.begin()
    run.improve()
    before = evaluate(mesh, Parameterization(run.uv, mesh.faces))["starved_area_fraction"]
    assert before > LEAST_PART
    assert abs(starved_share(run.mesh, run.uv) - before) < 1e-9
    run = grown(run, Need(1e9))
    assert run.branches >= 1
    found = evaluate(mesh, Parameterization(run.uv, run.mesh.faces))
    assert found["starved_area_fraction"] <= LEAST_PART
    assert found["flipped_fraction"] == found["overlap_area"] == 0


class Branching:
    """A run whose energy falls by 0.1 for each edge of a branch."""

    def __init__(self, energy: float, edges: int = 0) -> None:
        self.energy = energy
        # The branch's path, from its tip to the seam.
        self.grown_from = (Branching(5.0), np.arange(edges, -1, -1)) if edges else None

    def cut(self, path: np.ndarray, goal: float) -> "Branching":
        assert path[-1] == 0
        assert goal == 4.45
        return Branching(5 - 0.1 * (len(path) - 1))


@pytest.mark.parametrize(("edges", "reached"), [(9, 4.4), (6, 4.4), (5, 4.5), (1, 4.9)])
def test_a_branch_ends_where_its_bound_is_met(monkeypatch, edges: int, reached: float) -> None:
    monkeypatch.setattr(Need, "is_starved", lambda *_: False)
    need = Need(price=1.0, most_starved=0.02, most_energy=4.45)
    whole = Branching(5 - 0.1 * edges, edges)
    assert _shortened(whole, need).energy == pytest.approx(reached)


def test_a_branch_that_only_pays_keeps_its_length(monkeypatch) -> None:
    monkeypatch.setattr(Need, "is_starved", lambda *_: False)
    need = Need(price=1.0, most_starved=0.02, most_energy=6.0)
    whole = Branching(4.1, 9)
    assert _shortened(whole, need) is whole


@pytest.mark.parametrize(("length", "paid", "in_need"), [(0.1, 0.15, 0.02), (0.01, 0.015, 0.015)])
def test_a_branch_pays_its_length_and_in_need_no_more_than_a_hundredth_of_the_excess(
    monkeypatch, length: float, paid: float, in_need: float
) -> None:
    # A price of 3 for each sqrt(area), which is 2, and an energy of 2 above that of an isometry.
    run = SimpleNamespace(energy=6.0, unit=2.0)
    for is_starved, least in ((False, paid), (True, in_need)):
        monkeypatch.setattr(Need, "is_starved", lambda *_, told=is_starved: told)
        assert Need(price=3.0).least(run, length) == pytest.approx(least)
        assert Need(price=3.0).may_grow(run)
        assert Need(price=np.inf).may_grow(run) == is_starved
        assert not Need(price=np.inf, most_energy=6.0).may_grow(run) or is_starved
        assert Need(price=np.inf, most_energy=5.9).may_grow(run)
