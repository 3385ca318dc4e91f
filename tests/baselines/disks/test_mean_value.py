"""Floater's mean-value embedding: what its weights change."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from baselines.disks.harmonic import Harmonic
from baselines.disks.mean_value import MeanValue, embedded, mean_value_weights
from parapoint.planar.domains import domain, signed_areas
from parapoint.planar.tutte import tutte
from parapoint.surfaces.surface import Mesh
from parapoint.testing import irregular_disk, sample_surfaces


def test_a_weight_by_hand():
    # A square around its centre: tan(45 degrees) on either side of an edge of length 1.
    corners = [[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [0, 0, 0]]
    faces = [[4, 0, 1], [4, 1, 2], [4, 2, 3], [4, 3, 0]]
    weights = mean_value_weights(domain(Mesh(np.array(corners, float), np.array(faces))))
    assert_allclose(weights.toarray()[4, :4], 2)


def test_a_flat_disk_held_at_its_boundary_comes_back():
    """The coordinates' linear precision; uniform weights move the vertices."""
    mesh = irregular_disk()
    disk = domain(Mesh(mesh.vertices * [1, 1, 0], mesh.faces))
    assert_allclose(embedded(disk, disk.vertices[disk.loop, :2]), disk.vertices[:, :2], atol=1e-12)
    shares = (signed_areas(uv, disk.faces) for uv in (tutte(disk), disk.vertices[:, :2]))
    assert np.abs(np.subtract(*shares)).max() > 1e-3


def thin(factor):
    """An irregular disk drawn out along x: most triangles have an obtuse angle."""
    mesh = irregular_disk()
    return Mesh(mesh.vertices * [factor, 1, 1], mesh.faces)


def test_obtuse_angles_flip_no_triangle_where_cotangents_do():
    mesh = irregular_disk()
    rough = np.random.default_rng(0).normal(size=len(mesh.vertices))
    mesh = Mesh(np.column_stack([mesh.vertices[:, :2], rough]) * [3, 1, 1], mesh.faces)
    assert (signed_areas(Harmonic().parameterize(mesh, seed=0).uv, mesh.faces) <= 0).any()
    result = MeanValue().parameterize(mesh, seed=0)
    assert (signed_areas(result.uv, mesh.faces) > 0).all()
    assert result.report == {"flipped": 0, "degenerate": 0}


@pytest.mark.parametrize("factor", [1e3, 1e6])
def test_weights_stay_positive_for_angles_of_almost_zero_and_pi(factor):
    weights = mean_value_weights(domain(thin(factor)))
    assert np.isfinite(weights.data).all()
    assert (weights.data > 0).all()


def test_a_hole_is_closed_by_a_vertex_at_the_mean_of_its_loop():
    disk = domain(sample_surfaces()["a disk with a hole"])
    weights = mean_value_weights(disk).toarray()
    (loop,) = np.flatnonzero(weights[-1])[None]
    assert len(weights) == len(disk.vertices) + 1
    assert not np.isin(loop, disk.loop).any()
    assert_allclose(weights[-1, loop], 1)
    others = weights[loop, :-1]
    assert_allclose(weights[loop, -1], others.sum(axis=1) / (others > 0).sum(axis=1))
