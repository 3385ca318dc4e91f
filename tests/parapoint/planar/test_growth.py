"""Growth of the seam to where places are starved of area."""

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
