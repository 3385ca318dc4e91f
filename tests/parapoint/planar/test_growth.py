"""Growth of the seam to where places are starved of area."""

from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.cases import builtin
from benchmarks.metrics.evaluation import evaluate
from parapoint.planar.bijection import is_bijective
from parapoint.planar.descent import Run
from parapoint.planar.growth import Need, _branched, _shortened, grown
from parapoint.surfaces.areas import LEAST_PART, starved_share
from parapoint.surfaces.cutting import cut_to_disk
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import FloatArray, Mesh


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


BALL, FINE, CAP = builtin.sphere(2), builtin.sphere(3), builtin.sphere_cap(110, rings=8)
CORNERS = BALL.vertices[:12]  # of the icosahedron


def urchin(ball: Mesh, tips: FloatArray, height: float, width: float) -> Mesh:
    """A unit ball, or a part of it, drawn out by `height` at some tips (n, 3) of it, as cones."""
    away = np.linalg.norm(ball.vertices[:, None] - tips, axis=2).min(axis=1)
    out = 1 + height * np.clip(1 - away / width, 0, 1)
    return Mesh(ball.vertices * out[:, None], ball.faces)


def fins() -> FloatArray:
    """(60, 3) points of the unit sphere on twelve short arcs that lead around its axis."""
    around, height = np.meshgrid(np.linspace(-0.3, 0.3, 5), [-1, 0, 1])
    turns = (around.ravel() + np.pi / 2 * np.arange(4)[:, None]).ravel()
    heights = np.tile(height.ravel(), 4)
    points = np.stack([np.cos(turns), np.sin(turns), heights], axis=1)
    return points / np.linalg.norm(points, axis=1)[:, None]


def settled(mesh: Mesh) -> Run:
    """The map of a mesh that is cut along its automatic cut, if it needs one."""
    run = Run(cut_to_disk(mesh))
    run.begin()
    run.improve()
    return run


def cost(run: Run) -> float:
    """The energy and the seam: half of the rim, of a closed mesh, over the root of the area."""
    return run.energy + run.rim / 2 / run.unit


@pytest.mark.parametrize(
    ("mesh", "energy", "share"),
    [
        pytest.param(urchin(BALL, CORNERS, 2, 0.1), 4.8, 0.7, id="needles"),
        pytest.param(urchin(BALL, CORNERS, 4, 0.1), 4.8, 0.45, id="long needles"),
        pytest.param(urchin(BALL, CORNERS, 4, 0.4), 5.0, 0.8, id="cones of some rings"),
        pytest.param(urchin(FINE, fins(), 4, 0.2), 6.5, 0.9, id="fins"),
        pytest.param(urchin(CAP, CAP.vertices[7:120:18], 3, 0.05), 5.1, 0.5, id="a disk"),
    ],
)
def test_a_seam_leads_to_many_spikes_at_once(mesh: Mesh, energy: float, share: float) -> None:
    """One by one, branches left each of these at an energy of 7 at least, most of them above 10."""
    run = settled(mesh)
    longer = grown(run, Need())
    assert longer.energy < energy
    assert cost(longer) < share * cost(run)
    assert is_bijective(longer.mesh, longer.uv)


def test_branches_are_tried_at_once_where_they_could_pay_together() -> None:
    run = settled(urchin(BALL, CORNERS, 2, 0.1))
    along_rim = np.unique(np.concatenate(run.mesh.boundary_loops))
    branched = _branched(run, Need())
    assert sorted(branched.tips) == np.setdiff1d(np.arange(12), along_rim).tolist()
    assert set(range(12)) <= set(branched.mesh.boundary_loops[0].tolist())
    assert branched.mesh.topology == "disk"
    assert _branched(run, Need(price=100.0)) is run


@pytest.mark.parametrize(("price", "count"), [(1.0, 4), (2.5, 2)])
def test_branches_at_once_lead_to_the_spikes_that_pay(price: float, count: int) -> None:
    """Six long spikes, of which the automatic cut meets two, and six short ones."""
    out = np.ones(len(BALL.vertices))
    out[:6], out[6:12] = 3.0, 1.5
    run = settled(Mesh(BALL.vertices * out[:, None], BALL.faces))
    branched = _branched(run, Need(price))
    assert len(branched.tips) == count
    assert set(branched.tips) <= set(range(6)) & set(branched.mesh.boundary_loops[0].tolist())


@pytest.mark.parametrize("mesh", [BALL, builtin.finger()], ids=["none", "one"])
def test_fewer_than_two_spikes_are_left_to_single_branches(mesh: Mesh) -> None:
    run = settled(mesh)
    assert _branched(run, Need()) is run


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
        assert Need(price=3.0).toll(run)(length) == pytest.approx(least)
        twice = Need(price=3.0).toll(run, branches=2)(2 * length)
        assert twice == pytest.approx(2 * least)
        assert Need(price=3.0).may_grow(run)
        assert Need(price=np.inf).may_grow(run) == is_starved
        assert not Need(price=np.inf, most_energy=6.0).may_grow(run) or is_starved
        assert Need(price=np.inf, most_energy=5.9).may_grow(run)
