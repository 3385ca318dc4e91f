"""Geometry images: the square, the growing cut, the falling stretch, the image read back."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from baselines.disks.geometry_image import BULGE, GeometryImage, branch, laid_out, square
from baselines.disks.gridded import image, psnr
from baselines.disks.stretch import stretch, stretches
from parapoint.errors import InputError
from parapoint.planar.domains import domain, signed_areas
from parapoint.surfaces.surface import Mesh
from parapoint.testing import irregular_disk, sample_surfaces


def flat_square(steps=9):
    t = np.linspace(0, 1, steps)
    xy = np.stack(np.meshgrid(t, t), axis=-1).reshape(-1, 2)
    corner = np.arange(steps**2).reshape(steps, steps)
    a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]
    faces = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)
    return Mesh(np.column_stack([xy, np.zeros(len(xy))]), faces)


def horn():
    """A cone much longer than wide: without a cut along it its tip is a speck in the plane.

    Each quad is parted at its centre, so that a cut leaves no triangle with two edges at it.
    """
    angle, height = np.meshgrid(np.arange(12) * np.pi / 6, np.linspace(0, 6, 19)[:-1])
    radius = 1 - height / 7
    rings = np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=-1)
    at = np.arange(18 * 12).reshape(18, 12)
    a, b, c, d = (
        of.ravel() for of in (at[:-1], np.roll(at[:-1], -1, 1), np.roll(at[1:], -1, 1), at[1:])
    )
    points = rings.reshape(-1, 3)
    centre = 216 + np.arange(len(a))
    tip = np.stack([at[-1], np.roll(at[-1], -1), np.full(12, 216 + len(a))], axis=1)
    faces = [
        np.stack([one, other, centre], axis=1) for one, other in ((a, b), (b, c), (c, d), (d, a))
    ]
    middle = points[np.stack([a, b, c, d])].mean(axis=0)
    return Mesh(np.vstack([points, middle, [[0, 0, 6]]]), np.vstack([*faces, tip]))


def test_the_boundary_goes_round_the_square_with_a_point_at_each_corner():
    mesh = flat_square()
    loop = mesh.boundary_loops[0]
    at = square(mesh.vertices[loop])
    known = mesh.vertices[loop, :2]
    inside = np.abs(at - 0.5).max(axis=1)
    assert_allclose(np.sort(inside)[:4], 0.5)
    assert inside.max() == pytest.approx(0.5 + BULGE)
    # The same square up to where it begins and the bulge.
    turns = [np.roll(known, shift, axis=0) for shift in range(len(loop))]
    assert min(np.abs(turned - at).max() for turned in turns) < BULGE + 1e-12
    assert len(square(np.eye(3))) == 3


def test_the_square_begins_at_the_farthest_point_and_its_sides_are_as_long_as_the_boundary():
    """Around a square of side 4, unevenly: the mean is nearer to its left side."""
    x, y = np.array([[1, 4, 4, 4, 2, 0, 0, 0], [0, 0, 1, 4, 4, 4, 3, 0]])
    out = 4 * BULGE * 3 / 16  # a quarter along a side; half along it BULGE
    assert_allclose(
        square(np.stack([x, y, 0 * x], axis=1)),
        [
            [-out, 0.75],
            [0, 0],
            [0.25, -out],
            [1, 0],
            [1 + BULGE, 0.5],
            [1, 1],
            [0.75, 1 + out],
            [0, 1],
        ],
        atol=1e-12,
    )


def test_a_flat_square_needs_no_longer_cut():
    assert GeometryImage(9).parameterize(flat_square(5), seed=0).report["branches"] == 0


def test_the_image_of_a_flat_square_is_the_square():
    mesh = flat_square()
    disk, course = laid_out(mesh)
    points = image(disk, mesh.vertices[:, :2], 5)
    steps = np.linspace(0, 1, 5)
    assert_allclose(points[..., :2], np.stack(np.meshgrid(steps, steps), axis=-1), atol=1e-12)
    assert psnr(disk, points) == pytest.approx(240)
    assert stretch(disk, course[-1]) == pytest.approx(1, abs=0.02)


def test_the_noise_of_an_image_is_its_distance_over_the_diagonal():
    mesh = flat_square()
    disk = domain(mesh)
    lifted = image(disk, mesh.vertices[:, :2], 9) + np.array([0, 0, 0.01])
    assert psnr(disk, lifted) == pytest.approx(20 * np.log10(np.sqrt(2) / 0.01))


def test_more_pixels_tell_more_of_the_surface():
    ratios = [
        GeometryImage(side).parameterize(irregular_disk(), seed=0).report["psnr"]
        for side in (3, 9, 33)
    ]
    assert ratios == sorted(ratios)
    assert ratios[-1] > ratios[0] + 10


def test_a_horn_is_cut_to_its_far_end():
    mesh = horn()
    disk, course = laid_out(mesh)
    path = branch(mesh, stretches(disk, course[0]))
    assert mesh.vertices[path[0], 2] > 5
    assert mesh.vertices[path[-1], 2] == 0
    result = GeometryImage(33).parameterize(mesh, seed=0)
    assert result.report["branches"] == 1
    assert len(result.uv) == len(mesh.vertices) + len(path) - 1
    assert result.report["stretch_l2"] < 0.8 * stretch(disk, course[-1]) ** 0.5


def test_the_stretch_falls_from_step_to_step_and_nothing_flips():
    disk, course = laid_out(horn())
    values = [stretch(disk, uv) for uv in course]
    assert len(values) > 3
    assert values == sorted(values, reverse=True)
    assert all((signed_areas(uv, disk.faces) > 0).all() for uv in course)
    result = GeometryImage(9).parameterize(irregular_disk(), seed=0)
    assert result.trace[-1].values["stretch_l2"] == result.report["stretch_l2"]
    assert result.report["flipped"] == 0


def test_the_stretch_by_hand():
    mesh = flat_square(2)
    wide = mesh.vertices[:, :2] * [4, 1]  # at equal area the singular values are 2 and 1/2
    assert stretch(domain(mesh), wide) == pytest.approx((1 / 4 + 4) / 2)
    assert stretch(domain(mesh), wide * [-1, 1]) == np.inf


def test_holes_are_cut_to_one_boundary():
    mesh = sample_surfaces()["a disk with a hole"]
    result = GeometryImage(9).parameterize(mesh, seed=0)
    assert Mesh(np.zeros((len(result.uv), 3)), result.corners).topology == "disk"
    assert len(result.uv) > len(mesh.vertices) - 1
    assert_array_equal(result.corners.shape, mesh.faces.shape)


def test_an_image_of_no_pixels_is_refused():
    with pytest.raises(InputError, match="side must be a whole number of at least 2"):
        GeometryImage(side=1)
