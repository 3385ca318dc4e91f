"""A one-to-one map on its way down: where it starts, and what it refuses."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from benchmarks.cases import builtin
from parapoint.planar import descent, growth
from parapoint.planar.bijection import is_bijective
from parapoint.planar.descent import LEAST_ENERGY, Run
from parapoint.surfaces.areas import signed_areas
from parapoint.surfaces.surface import Mesh


def cap() -> Mesh:
    return builtin.sphere_cap(120, rings=5)


def settled(mesh: Mesh) -> Run:
    run = Run(mesh)
    run.begin(None)
    run.improve()
    return run


def test_a_better_map_is_the_start_in_any_unit_and_a_worse_one_is_not() -> None:
    mesh = cap()
    known = settled(mesh)
    assert known.start == "isometric"
    run = Run(mesh)
    run.begin(1000 * known.uv)
    assert run.start == "computed"
    assert run.energy == pytest.approx(known.energy, rel=1e-3)
    assert signed_areas(run.uv, mesh.faces).sum() == pytest.approx(mesh.face_areas.sum())
    for worse in (known.uv * [3, 1], known.uv[:, ::-1]):  # stretched, and mirrored
        run = Run(mesh)
        run.begin(worse)
        assert run.start == "isometric"
        assert is_bijective(mesh, run.uv)


def test_a_map_that_covers_itself_is_no_start() -> None:
    """A strip wound up to more than a full turn has no distortion, and no place in the plane."""
    turn, radius = (of.ravel() for of in np.meshgrid(np.linspace(0, 7, 50), np.linspace(1, 1.4, 4)))
    wound = np.stack([radius * np.cos(turn), radius * np.sin(turn), 0.2 * turn], axis=1)
    corner = (np.arange(3)[:, None] * 50 + np.arange(49)).ravel()
    faces = np.concatenate([corner[:, None] + side for side in ([0, 51, 1], [0, 50, 51])])
    mesh = Mesh(wound, faces)
    run = Run(mesh)
    run.begin(wound[:, :2])
    assert (signed_areas(wound[:, :2], mesh.faces) > 0).all()
    assert run.energy_of(wound[:, :2]) < run.energy
    assert run.start == "isometric"


def test_a_cut_that_crosses_itself_once_it_is_open_fails(monkeypatch) -> None:
    run = settled(cap())
    path = np.array([0, 1, 7, 19])
    longer = run.cut(path)
    assert longer is not None
    assert (longer.branches, run.branches) == (1, 0)
    monkeypatch.setattr(descent, "crossing_vertices", lambda *_: np.array([3]))
    assert run.cut(path) is None


def test_what_a_branch_could_gain_is_the_excess_of_all_faces_that_it_touches() -> None:
    run = settled(cap())
    here = np.zeros(len(run.mesh.vertices), dtype=bool)
    here[0] = True
    around = (run.mesh.faces == 0).any(axis=1)
    area = run.mesh.face_areas
    gain = (area * (run.densities() - LEAST_ENERGY))[around].sum() / area.sum()
    assert gain > 0
    assert_allclose(growth._excess_within(run, here), gain)
    assert_allclose(growth._excess_within(run, ~here | here), run.energy - LEAST_ENERGY)
