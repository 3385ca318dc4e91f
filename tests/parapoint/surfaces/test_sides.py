"""The two sides of a sheet, and what is made of each."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from parapoint import Mesh, Parameterization
from parapoint.files.writing.mesh_writers import _Split
from parapoint.surfaces.parameterization import Charted
from parapoint.surfaces.sides import other_sides, parted
from parapoint.surfaces.surface import vertex_normals
from parapoint.testing import irregular_disk, sphere


@pytest.mark.parametrize("mesh", [irregular_disk(), sphere()], ids=["disk", "sphere"])
@pytest.mark.parametrize("seed", range(3))
def test_one_side_of_a_sheet_is_the_other_one_in_any_order(mesh: Mesh, seed: int) -> None:
    assert not other_sides(mesh.faces).any()
    assert parted(mesh) is mesh
    count = len(mesh.faces)
    order = np.random.default_rng(seed).permutation(2 * count)
    both = np.concatenate([mesh.faces, mesh.faces[:, ::-1]])[order]
    is_other = other_sides(both)
    assert_array_equal(is_other, (order >= count) == is_other[order.argmax()])
    apart = parted(Mesh(mesh.vertices, both))
    assert_array_equal(apart.faces % len(mesh.vertices), both)
    assert np.intersect1d(apart.faces[is_other], apart.faces[~is_other]).size == 0


def test_normals_of_a_textured_sheet_are_those_of_its_sides() -> None:
    mesh = irregular_disk()
    both = Mesh(mesh.vertices, np.concatenate([mesh.faces, mesh.faces[:, ::-1]]))
    rows = np.arange(len(mesh.vertices))
    corners = np.concatenate([mesh.faces, mesh.faces[:, ::-1] + len(rows)])
    uv = np.tile(mesh.vertices[:, :2], (2, 1))
    split = _Split.of(Charted(both, Parameterization(uv, corners)))
    normals = split.normals[split.faces]
    one, other = np.split(normals, 2)
    assert_allclose(one, vertex_normals(mesh)[mesh.faces])
    assert_allclose(other, -one[:, ::-1])
