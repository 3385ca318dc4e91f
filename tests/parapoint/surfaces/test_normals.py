"""Normals and tangents of a sphere."""

import numpy as np
import pytest

from parapoint import Mesh, PointCloud
from parapoint.surfaces.normals import are_outer, oriented_normals, tangent_frames


def sphere(count: int = 200) -> np.ndarray:
    points = np.random.default_rng(0).normal(size=(count, 3))
    return points / np.linalg.norm(points, axis=1, keepdims=True)


def test_normals_are_oriented_alike() -> None:
    points = sphere(1000)
    outward = (oriented_normals(points) * points).sum(axis=1)
    assert np.abs(outward).min() > 0.9
    assert abs(np.sign(outward).sum()) == 1000
    two = np.concatenate([points, points + 10])  # two components are each oriented
    outward = (oriented_normals(two) * np.concatenate([points, points])).sum(axis=1)
    assert abs(np.sign(outward[:1000]).sum()) == abs(np.sign(outward[1000:]).sum()) == 1000


def test_tangent_frames_are_right_handed_around_the_normals() -> None:
    points = sphere(500)
    first, second = tangent_frames(points)
    np.testing.assert_allclose(np.cross(first, second), oriented_normals(points), atol=1e-12)
    np.testing.assert_allclose((first * second).sum(axis=1), 0, atol=1e-12)


def cap(degrees: float, axis: int = 2, sign: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Points of a cap of the unit sphere around an axis, and the normals on its outer side."""
    rng = np.random.default_rng(1)
    along = rng.uniform(np.cos(np.radians(degrees)), 1, 800)
    turn, radius = rng.uniform(0, 2 * np.pi, 800), np.sqrt(1 - along**2)
    points = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), along])
    points = sign * np.roll(points, axis - 2, axis=1)
    return points, points.copy()


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("degrees", [25.0, 90.0, 150.0, 180.0])
def test_the_outer_side_is_where_a_surface_bulges(degrees, axis, sign) -> None:
    points, outer = cap(degrees, axis, sign)
    for moved in (points, 1e-6 * points + 5e5):
        cloud = PointCloud(moved)
        assert are_outer(cloud, moved, outer)
        assert not are_outer(cloud, moved, -outer)


@pytest.mark.parametrize(
    ("towards", "up"),
    [
        ([0.0, 0, 1], [0.0, 0, 1]),
        ([0.0, 0, -1], [0.0, 0, 1]),
        ([0.2, 0.6, -0.8], [-0.2, -0.6, 0.8]),  # a slope
        ([0.3, -1, 0.01], [-0.3, 1, -0.01]),  # a wall, though it leans a little
        ([-1.0, 0.01, 0.01], [1.0, -0.01, -0.01]),
    ],
)
def test_a_flat_surface_faces_up(towards, up) -> None:
    bowl, facing = cap(15.0)  # a hollow as deep as 7 % of its width is flat
    normal = np.array(towards) / np.linalg.norm(towards)
    side = np.linalg.svd(normal[None])[2][1:]
    turned = np.column_stack([*side, normal]) if np.linalg.det([*side, normal]) > 0 else None
    turned = np.column_stack([side[1], side[0], normal]) if turned is None else turned
    for sign in (1.0, -1.0):
        points = (bowl * [1, 1, sign]) @ turned.T
        normals = facing * [sign, sign, 1] @ turned.T  # all on the side of `towards`
        is_up = float(np.dot(normal, up)) > 0
        assert are_outer(PointCloud(points), points, normals) == is_up
        assert are_outer(PointCloud(points), points, -normals) != is_up


def test_normals_tell_the_side_where_they_agree() -> None:
    points, outer = cap(180.0)
    inwards = PointCloud(points, -outer)
    assert not are_outer(inwards, points, outer)
    by_chance = np.random.default_rng(0).choice([-1.0, 1.0], (len(points), 1))
    assert are_outer(PointCloud(points, by_chance * outer), points, outer)


def test_faces_tell_the_side() -> None:
    for corners in ([0, 1, 2], [0, 2, 1]):
        mesh = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [corners])
        up = np.tile([0.0, 0, 1], (3, 1))
        assert are_outer(mesh, mesh.vertices, up) == (corners[1] == 1)


def torus(tube: float) -> tuple[np.ndarray, np.ndarray]:
    """Points of a ring of radius 1, and its outer normals."""
    a, b = np.random.default_rng(2).uniform(0, 2 * np.pi, (2, 1500))
    outer = np.stack([np.cos(a) * np.cos(b), np.sin(a) * np.cos(b), np.sin(b)], axis=1)
    return np.stack([np.cos(a), np.sin(a), 0 * a], axis=1) + tube * outer, outer


def pipe(radius: float, *, turn: float = 2 * np.pi) -> tuple[np.ndarray, np.ndarray]:
    """Points of an open tube of length 2, and its outer normals; of less than a turn, a gutter."""
    a, z = np.random.default_rng(3).uniform([[0], [-1]], [[turn], [1]], (2, 1500))
    outer = np.stack([np.cos(a), np.sin(a), 0 * a], axis=1)
    return radius * outer + z[:, None] * [0, 0, 1], outer


def plate(thickness: float) -> tuple[np.ndarray, np.ndarray]:
    """Points of a closed plate of width 2, and its outer normals; its top holds nine of ten."""
    rng = np.random.default_rng(4)
    points = rng.uniform(-1, 1, (2000, 3)) * [1, 1, 0]
    side = np.where(rng.random(2000) < 0.9, 1.0, -1.0)
    outer = np.zeros((2000, 3))
    outer[:, 2] = side / np.where(side > 0, 0.9, 0.1)  # as long as the area of each
    points[:, 2] = side * thickness / 2
    return points, outer


@pytest.mark.parametrize(
    ("points", "outer"),
    [torus(0.3), torus(0.1), torus(0.02), pipe(0.5), pipe(0.02), pipe(0.1, turn=5), plate(0.02)],
    ids=["ring", "thin ring", "hoop", "tube", "stick", "gutter", "plate"],
)
def test_the_outer_side_of_what_is_thin_is_its_outside(points, outer) -> None:
    turn = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
    for at, normals in ((points, outer), (points @ turn, outer @ turn), (1e-9 * points, outer)):
        assert are_outer(PointCloud(at), at, normals)
        assert not are_outer(PointCloud(at), at, -normals)


def test_a_screw_has_no_outside_and_faces_up() -> None:
    turn, radius = np.random.default_rng(6).uniform([[0], [0.1]], [[12], [1]], (2, 2000))
    points = np.stack([radius * np.cos(turn), radius * np.sin(turn), turn / 3], axis=1)
    up = np.stack([np.sin(turn) / 3, -np.cos(turn) / 3, radius], axis=1)
    assert are_outer(PointCloud(points), points, up)
    assert not are_outer(PointCloud(points), points, -up)


@pytest.mark.parametrize("length", [1e-3, 1.0, 40.0])
def test_known_normals_count_whatever_their_length(length) -> None:
    points, outer = cap(180.0)
    few = length * np.where(np.arange(len(points))[:, None] % 3 == 0, -outer, 0.0)
    assert not are_outer(PointCloud(points, few), points, outer)
    assert are_outer(PointCloud(points, 0 * outer), points, outer)


def test_faces_that_are_there_twice_tell_nothing() -> None:
    points, outer = cap(90.0)
    faces = np.arange(len(points) // 3 * 3).reshape(-1, 3)
    both = Mesh(points, np.concatenate([faces, faces[:, ::-1]]))
    assert are_outer(both, points, outer)
    assert not are_outer(both, points, -outer)
