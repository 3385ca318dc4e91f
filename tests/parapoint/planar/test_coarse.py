"""Growth of the seam of a large mesh to where that of a simplified one grew."""

from unittest.mock import Mock

import numpy as np
import pytest

from benchmarks.cases import builtin
from benchmarks.metrics.evaluation import evaluate
from parapoint.planar import coarse
from parapoint.planar.coarse import joined, led, simplified
from parapoint.planar.descent import Run
from parapoint.planar.domains import FlatteningError
from parapoint.planar.growth import Need, grown
from parapoint.surfaces.cutting import cut_to_disk
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import Mesh


@pytest.fixture
def few(monkeypatch) -> int:
    """Faces of a simplified mesh, few enough for a test."""
    monkeypatch.setattr(coarse, "COARSE", 400)
    return 400


def test_a_simplified_mesh_has_vertices_of_the_large_one(few) -> None:
    mesh = builtin.finger()
    assert len(mesh.faces) > 2 * few
    found = simplified(mesh, few)
    assert found is not None
    simple, vertex = found
    assert len(simple.faces) <= few
    assert len(simple.boundary_loops) == 1
    assert (simple.vertices == mesh.vertices[vertex]).all()


def test_the_seam_grows_to_where_that_of_the_simplified_mesh_did(few) -> None:
    mesh = builtin.finger()
    run = Run(mesh)
    run.begin()
    run.improve()
    need = Need(1e9)
    assert need.of(run)
    found = led(mesh, need, np.inf)
    assert found is not None
    assert len(found.tips) == found.run.branches >= 1
    assert len(found.run.mesh.faces) == few
    domain = found.domain
    longer, slow = Run(domain), grown(run, need)
    longer.begin()
    longer.improve()
    assert not need.of(longer)
    assert longer.energy < 1.2 * slow.energy
    assert longer.rim - run.rim < 1.3 * (slow.rim - run.rim)
    metrics = evaluate(mesh, Parameterization(longer.uv, domain.faces))
    assert metrics["flipped_fraction"] == metrics["overlap_area"] == 0
    again = led(domain, need, np.inf)
    assert again is not None
    assert again.tips == ()
    assert (again.domain.faces == domain.faces).all()


@pytest.mark.usefixtures("few")
def test_the_seam_leads_to_all_spikes_of_the_large_mesh() -> None:
    ball = builtin.sphere(3)
    spikes = np.arange(12)
    out = np.where(np.arange(len(ball.vertices)) < len(spikes), 3.0, 1.0)
    found = led(cut_to_disk(Mesh(ball.vertices * out[:, None], ball.faces)), Need(), np.inf)
    assert found is not None
    assert np.isin(spikes, np.concatenate(found.domain.boundary_loops)).all()
    assert found.domain.topology == "disk"


@pytest.mark.usefixtures("few")
@pytest.mark.parametrize("lacks", ["mesh", "map"])
def test_a_simplified_mesh_without_a_map_tells_nothing(lacks, monkeypatch) -> None:
    if lacks == "mesh":
        monkeypatch.setattr(coarse, "simplified", lambda *_: None)
    else:
        monkeypatch.setattr(Run, "begin", Mock(side_effect=FlatteningError("no start")))
    assert led(builtin.finger(), Need(1e9), np.inf) is None


def test_branches_are_joined_to_the_seam_by_short_paths() -> None:
    mesh = builtin.wavy_sheet(8)
    inside = np.setdiff1d(np.arange(len(mesh.vertices)), np.concatenate(mesh.boundary_loops))
    tip = int(inside[len(inside) // 2])
    cut = joined(mesh, [tip])
    assert len(cut.faces) == len(mesh.faces)
    assert len(cut.boundary_loops) == 1
    assert tip in cut.boundary_loops[0]
