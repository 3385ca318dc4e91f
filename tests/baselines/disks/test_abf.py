"""Angle based flattening: its constraints, its reduction, its layout, and what angles change."""

import igl
import numpy as np
import pytest
from numpy.testing import assert_allclose

from baselines.disks.abf import ABF, laid_out
from baselines.disks.angle_system import angles, newton_step
from baselines.disks.lscm import LSCM
from parapoint.planar.domains import domain, signed_areas
from parapoint.surfaces.surface import Mesh
from parapoint.testing import irregular_disk, sample_surfaces


def bent():
    mesh = irregular_disk()
    return Mesh(mesh.vertices * [1, 1, 4], mesh.faces)


def misfit(mesh, uv):
    """The mean of ((a - b) / b)² over corners, b the angles in space scaled as the paper does."""
    target = angles(mesh.vertices, mesh.faces).target
    return ((igl.internal_angles(uv, mesh.faces).reshape(-1) / target - 1) ** 2).mean()


def test_targets_sum_up_to_a_full_turn_around_inner_vertices_and_stay_elsewhere():
    mesh = bent()
    problem = angles(mesh.vertices, mesh.faces)
    assert problem.wheel.shape == (49, 3 * 128)
    assert problem.ahead[:6].tolist() == [1, 2, 0, 4, 5, 3]  # the next corner of the same face
    assert_allclose(problem.wheel @ problem.target, 2 * np.pi)
    rim = np.isin(mesh.faces.reshape(-1), mesh.boundary_loops[0])
    kept = igl.internal_angles(mesh.vertices, mesh.faces).reshape(-1)[rim]
    assert_allclose(problem.target[rim], kept)


def test_the_reduced_step_is_newton_s():
    """Against the whole system of angles and multipliers, dense."""
    mesh = bent()
    problem = angles(mesh.vertices, mesh.faces)
    angle = problem.target * (1 + 0.05 * np.sin(np.arange(len(problem.target))))
    faces = len(mesh.faces)
    ahead, behind = problem.ahead, problem.ahead[problem.ahead]
    wheel, size = problem.wheel.toarray(), len(angle)

    def constraints(a):
        sine = np.log(np.sin(a))
        sums = a.reshape(-1, 3).sum(axis=1) - np.pi
        return np.concatenate([sums, wheel @ a - 2 * np.pi, wheel @ (sine[ahead] - sine[behind])])

    step = 1e-6 * np.eye(size)
    jacobian = np.stack(
        [(constraints(angle + d) - constraints(angle - d)) / 2e-6 for d in step], axis=1
    )
    rows = len(jacobian)
    assert rows == faces + 2 * 49
    system = np.block(
        [[np.diag(2 / problem.target**2), jacobian.T], [jacobian, np.zeros((rows,) * 2)]]
    )
    right = np.concatenate([-2 * (angle - problem.target) / problem.target**2, -constraints(angle)])
    move, wrong = newton_step(problem, angle)
    assert_allclose(move, np.linalg.solve(system, right)[:size], atol=1e-6)
    assert wrong == pytest.approx(np.abs(constraints(angle)).max())


def test_a_flat_mesh_is_laid_out_from_its_angles():
    mesh = irregular_disk()
    flat = Mesh(mesh.vertices * [1, 1, 0], mesh.faces)
    disk = domain(flat)
    uv = laid_out(disk, disk.faces, igl.internal_angles(flat.vertices, flat.faces).reshape(-1))
    assert_allclose(
        igl.internal_angles(uv, disk.faces),
        igl.internal_angles(flat.vertices, flat.faces),
        atol=1e-9,
    )
    assert (signed_areas(uv, disk.faces) > 0).all()


def test_the_angles_close_and_are_nearer_to_those_in_space_than_other_conformal_maps_are():
    mesh = bent()
    result = ABF().parameterize(mesh, seed=0)
    assert result.report["largest_error"] < 1e-9
    assert result.report["flipped"] == 0
    assert misfit(mesh, result.uv) < 0.95 * misfit(mesh, LSCM().parameterize(mesh, seed=0).uv)


def test_a_cone_s_angles_are_all_scaled_alike():
    """A regular pyramid of seven equal faces: 2 pi / 7 at the tip, and its faces stay isosceles."""
    around = np.arange(7) * 2 * np.pi / 7
    rim = np.stack([np.cos(around), np.sin(around), np.zeros(7)], axis=1)
    faces = np.stack([np.full(7, 7), np.arange(7), (np.arange(7) + 1) % 7], axis=1)
    mesh = Mesh(np.vstack([rim, [[0, 0, 1.0]]]), faces)
    uv = ABF().parameterize(mesh, seed=0).uv
    tip, one, other = igl.internal_angles(uv, faces).T
    assert_allclose(tip, 2 * np.pi / 7)
    assert_allclose(one, other)


def test_a_step_stays_between_zero_and_pi():
    """A whole step would leave; and where the angles do not close in time, the report says so."""
    mesh = irregular_disk()
    mesh = Mesh(mesh.vertices * [1, 1, 20], mesh.faces)
    problem = angles(mesh.vertices, mesh.faces)
    assert (problem.target + newton_step(problem, problem.target)[0]).min() < 0
    result = ABF(iterations=5).parameterize(mesh, seed=0)
    assert np.isfinite(result.uv).all()
    assert result.report["steps"] == 5
    assert result.report["largest_error"] > 1e-9


def test_a_hole_stays_a_hole():
    mesh = sample_surfaces()["a disk with a hole"]
    result = ABF().parameterize(mesh, seed=0)
    assert len(result.uv) == mesh.referenced.sum()
    assert (signed_areas(result.uv, result.corners) > 0).all()


def test_one_triangle_keeps_its_angles():
    mesh = Mesh(np.array([[0, 0, 0], [3.0, 0, 0], [0, 0, 4]]), np.array([[0, 1, 2]]))
    uv = ABF().parameterize(mesh, seed=0).uv
    assert_allclose(
        np.sort(igl.internal_angles(uv, mesh.faces)),
        np.sort(igl.internal_angles(mesh.vertices, mesh.faces)),
    )


def test_needles_aim_at_angles_that_have_a_tangent():
    """Of a needle's angles two are almost 0 or pi; a thousandth from both ends is the limit."""
    mesh = irregular_disk()
    needles = Mesh(mesh.vertices * [1e5, 1, 1], mesh.faces)
    sharp = igl.internal_angles(needles.vertices, needles.faces)
    assert sharp.min() < 1e-4 < np.pi - 1e-4 < sharp.max()
    target = angles(needles.vertices, needles.faces).target
    assert target.min() == pytest.approx(1e-3)
    assert target.max() == pytest.approx(np.pi - 1e-3)
