"""Growth of the seam to where places are starved of area."""

from benchmarks.cases import builtin
from benchmarks.metrics.evaluation import evaluate
from parapoint.planar.descent import Run
from parapoint.planar.growth import grown
from parapoint.surfaces.areas import MOST_STARVED, starved_share
from parapoint.surfaces.parameterization import Parameterization


def test_a_seam_leads_to_what_is_starved() -> None:
    mesh = builtin.finger()
    run = Run(mesh)
    run.begin()
    run.improve()
    before = evaluate(mesh, Parameterization(run.uv, mesh.faces))["starved_area_fraction"]
    assert before > MOST_STARVED
    assert abs(starved_share(run.mesh, run.uv) - before) < 1e-9
    run = grown(run, 1e9)
    assert run.branches >= 1
    found = evaluate(mesh, Parameterization(run.uv, run.mesh.faces))
    assert found["starved_area_fraction"] <= MOST_STARVED
    assert found["flipped_fraction"] == found["overlap_area"] == 0
