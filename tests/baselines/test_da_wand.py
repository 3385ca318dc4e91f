"""The region that flattens well: a disk around its seed, within the bound, and no mere ball."""

import numpy as np
import pytest

from baselines.da_wand import DAWand
from baselines.disk_regions import Region, distortion, flattened, neighbours
from parapoint.errors import InputError
from parapoint.surfaces.surface import Mesh, PointCloud
from parapoint.testing import defective, irregular_disk, sphere


def cube(steps=6):
    """The surface of the cube from 0 to 1, each side of steps x steps quads."""
    t = np.linspace(0, 1, steps + 1)
    points, faces = [], []
    at = np.arange((steps + 1) ** 2).reshape(steps + 1, steps + 1)
    a, b, c, d = (of.ravel() for of in (at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]))
    side = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    u, v = (of.ravel() for of in np.meshgrid(t, t, indexing="ij"))
    for axis in range(3):
        for level in (0.0, 1.0):
            xyz = np.empty((len(u), 3))
            xyz[:, axis], xyz[:, (axis + 1) % 3], xyz[:, (axis + 2) % 3] = level, u, v
            faces.append((side if level else side[:, ::-1]) + len(u) * len(points))
            points.append(xyz)
    vertices, row = np.unique(np.round(np.concatenate(points), 9), axis=0, return_inverse=True)
    return Mesh(vertices, row.reshape(-1)[np.concatenate(faces)])


def region_of(result):
    return np.flatnonzero(result.covered)


def assert_disk(mesh, faces):
    assert Mesh(mesh.vertices, mesh.faces[faces]).topology == "disk"


def test_a_developable_disk_is_taken_whole():
    mesh = irregular_disk()
    x, y, _ = mesh.vertices.T
    rolled = Mesh(np.stack([np.sin(x), y, np.cos(x)], axis=1), mesh.faces)
    result = DAWand(triangle=60).parameterize(rolled, seed=0)
    assert result.covered.all()
    assert result.report["share"] == 1
    assert result.report["distortion"] < 1e-3


@pytest.mark.parametrize("triangle", [0, 50, 117])
@pytest.mark.parametrize("bound", [0.01, 1e-3])
def test_the_region_is_a_disk_around_its_seed_within_the_bound(triangle, bound):
    mesh = sphere()
    result = DAWand(triangle=triangle, distortion=bound).parameterize(mesh, seed=0)
    faces = region_of(result)
    assert triangle in faces
    assert_disk(mesh, faces)
    assert result.report["distortion"] <= bound
    assert result.report["distortion"] == pytest.approx(distortion(mesh, faces))
    assert 12 < len(faces) < len(mesh.faces)


def test_after_a_ring_too_many_the_next_ones_are_half_as_large_and_then_twice():
    """How many maps that takes was counted; rings that grow threefold take 33 and 73."""
    solves = [
        DAWand(triangle=117, distortion=bound).parameterize(sphere(), seed=0).report["solves"]
        for bound in (0.01, 1e-3)
    ]
    assert solves == [28, 67]


def test_a_higher_bound_takes_more_of_the_surface():
    mesh = sphere()
    shares = [
        DAWand(distortion=bound).parameterize(mesh, seed=0).report["share"]
        for bound in (1e-3, 1e-2, 1e-1)
    ]
    assert shares[0] < shares[1] < shares[2] < 1


def test_the_region_of_a_cube_has_no_corner_inside_where_a_ball_of_its_size_has():
    mesh = cube()
    lid = np.flatnonzero((mesh.vertices[mesh.faces][:, :, 2] == 1).all(axis=1))
    near = mesh.vertices[mesh.faces].mean(axis=1) - [0.8, 0.8, 1.0]
    seed = int(np.linalg.norm(near, axis=1).argmin())
    assert seed in lid
    result = DAWand(triangle=seed, distortion=1e-6).parameterize(mesh, seed=0)
    faces = region_of(result)
    assert_disk(mesh, faces)
    part = Mesh(mesh.vertices, mesh.faces[faces])
    inner = np.setdiff1d(part.faces, part.boundary_loops[0])
    corners = np.flatnonzero(np.isin(mesh.vertices, [0, 1]).all(axis=1))
    assert not np.isin(corners, inner).any()
    assert len(faces) > len(lid)
    ball = Region(mesh, seed)
    order = np.argsort(np.linalg.norm(near, axis=1), kind="stable")
    for _ in range(5):
        for face in order.tolist():
            if ball.inside.sum() < len(faces) and ball.fits(face):
                ball.add(face)
    assert distortion(mesh, ball.faces()) > 1e-3


def test_what_is_outside_has_no_uv_and_no_row_serves_two_places():
    mesh = sphere()
    result = DAWand().parameterize(mesh, seed=0)
    faces = region_of(result)
    uv, each = flattened(mesh, faces)
    np.testing.assert_array_equal(result.uv[result.corners[faces]], uv[mesh.faces[faces]])
    outside = np.setdiff1d(np.arange(len(mesh.faces)), faces)
    assert np.isnan(result.uv[result.corners[outside]]).all()
    assert len(each) == len(faces)


def test_faces_are_added_and_left_out_where_the_region_stays_a_disk():
    mesh = sphere()
    region = Region(mesh, 3)
    rng = np.random.default_rng(0)
    for face in rng.integers(0, len(mesh.faces), 4000).tolist():
        if region.fits(face):
            region.add(face)
        elif rng.random() < 0.3 and region.may_leave(face):
            region.drop(face)
    assert 20 < region.inside.sum() < len(mesh.faces)
    assert_disk(mesh, region.faces())


def test_a_face_may_leave_where_it_bares_no_vertex_of_the_border():
    turn = np.arange(6) * np.pi / 3
    rim = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    spokes = [[6, k, (k + 1) % 6] for k in range(6)]
    fan = Region(Mesh(np.vstack([rim, [[0, 0, 0]]]), spokes), 0, range(6))
    assert [fan.may_leave(face) for face in range(6)] == [False] + 5 * [True]  # 0 is the seed
    fan.drop(3)
    assert [fan.may_leave(face) for face in range(6)] == [False, False, True, False, True, False]
    zigzag = np.array([[k, k % 2, 0.0] for k in range(6)])
    strip = [[0, 2, 1], [1, 2, 3], [2, 4, 3], [3, 4, 5]]
    region = Region(Mesh(zigzag, strip), 0, range(4))
    assert [region.may_leave(face) for face in range(4)] == [False, False, False, True]


def test_smoothing_leaves_out_what_sticks_out():
    mesh = cube()
    region = Region(mesh, 0)
    lid = np.arange(72)  # a side of the cube
    for _ in range(72):
        for face in lid.tolist():
            if region.fits(face):
                region.add(face)
    (ear,) = [f for f in range(len(mesh.faces)) if region.fits(f)][:1]
    region.add(ear)
    region.smooth()
    assert not region.inside[ear]
    assert_disk(mesh, region.faces())


def test_neighbours_are_those_that_turn_the_same_way():
    mesh = defective()
    beside = neighbours(mesh)
    for face, side in np.argwhere(beside >= 0).tolist():
        other = beside[face, side]
        a, b = mesh.faces[face, side], mesh.faces[face, (side + 1) % 3]
        twin = [(mesh.faces[other, k], mesh.faces[other, (k + 1) % 3]) for k in range(3)]
        assert (b, a) in twin
    assert (neighbours(sphere()) >= 0).all()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"triangle": -1}, "triangle must be a whole number of at least 0"),
        ({"distortion": 0.0}, "distortion must be a number above 0"),
    ],
)
def test_bad_parameters_are_refused(arguments, message):
    with pytest.raises(InputError, match=message):
        DAWand(**arguments)


def test_a_seed_that_is_no_face_or_has_no_area_is_refused():
    mesh = sphere()
    with pytest.raises(InputError, match="triangle must be a face, 0 to 175, not 176"):
        DAWand(triangle=176).parameterize(mesh, seed=0)
    flat = Mesh(mesh.vertices, np.concatenate([mesh.faces, [[0, 0, 1]]]))
    with pytest.raises(InputError, match="triangle 176 has no area"):
        DAWand(triangle=176).parameterize(flat, seed=0)
    with pytest.raises(Exception, match="needs faces"):
        DAWand().parameterize(PointCloud(mesh.vertices), seed=0)


@pytest.mark.parametrize(("degrees", "offset"), [(75, 0.1), (210, -0.3)])
def test_smoothing_leaves_faces_where_they_are_with_as_many_inside_as_outside(degrees, offset):
    """On an even border, here along a line across a square, some have just half around them."""
    mesh = irregular_disk()
    across = np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees)), 0])
    below = np.flatnonzero(mesh.vertices[mesh.faces].mean(axis=1) @ across < offset).tolist()
    region = Region(mesh, below[len(below) // 2])
    for _ in range(20):
        for face in below:
            if region.fits(face):
                region.add(face)
    before = region.faces().tolist()
    votes = (region.uses / region.valence)[mesh.faces].mean(axis=1)
    assert (votes == 0.5).any()
    region.smooth()
    assert region.faces().tolist() == before
