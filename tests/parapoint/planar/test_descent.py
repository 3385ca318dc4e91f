"""A one-to-one map on its way down: where it starts, and what it refuses."""

import numpy as np
import pytest

from benchmarks.cases import builtin
from parapoint.planar import descent
from parapoint.planar.bijection import is_bijective
from parapoint.planar.descent import Run
from parapoint.surfaces.areas import signed_areas
from parapoint.surfaces.surface import Mesh


@pytest.mark.parametrize("unit", [1.0, 1000.0])
def test_a_run_starts_one_to_one_in_the_scale_of_its_mesh_and_goes_down(unit: float) -> None:
    cap = builtin.sphere_cap(120, rings=5)
    mesh = Mesh(unit * cap.vertices, cap.faces)
    run = Run(mesh)
    run.begin()
    start = run.energy
    assert is_bijective(mesh, run.uv)
    assert signed_areas(run.uv, mesh.faces).sum() == pytest.approx(mesh.face_areas.sum())
    run.improve()
    assert is_bijective(mesh, run.uv)
    assert 4 < run.energy < start
    assert run.energy == pytest.approx(4.554, abs=0.01)  # in any unit


def test_a_cut_that_crosses_itself_once_it_is_open_fails(monkeypatch) -> None:
    run = Run(builtin.sphere_cap(120, rings=5))
    run.begin()
    run.improve()
    path = np.array([0, 1, 7, 19])
    longer = run.cut(path)
    assert longer is not None
    assert (longer.branches, run.branches) == (1, 0)
    monkeypatch.setattr(descent, "crossing_vertices", lambda *_: np.array([3]))
    assert run.cut(path) is None


def test_the_map_along_a_longer_seam_is_the_same_in_any_unit() -> None:
    cap = builtin.sphere_cap(120, rings=5)
    energies = []
    for unit in (1.0, 1000.0):
        run = Run(Mesh(unit * cap.vertices, cap.faces))
        run.begin()
        run.improve()
        longer = run.cut(np.array([0, 1, 7, 19]))
        assert longer is not None
        assert signed_areas(longer.uv, longer.mesh.faces).sum() == pytest.approx(
            run.mesh.face_areas.sum(), rel=0.1
        )
        energies.append(longer.energy)
    assert energies[0] == pytest.approx(energies[1], rel=1e-3)
