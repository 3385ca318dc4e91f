import numpy as np
import pytest

from benchmarks.metrics.pointwise import point_map
from benchmarks.rendering.camera import camera
from benchmarks.rendering.maps import FIELDS, Map, normal_colours
from benchmarks.rendering.scene import Scene
from benchmarks.store.rows import ResultRow
from parapoint.errors import InputError
from parapoint.surfaces.parameterization import Parameterization, PointParameterization
from parapoint.surfaces.surface import Mesh, PointCloud
from reports.pictures import clouds
from reports.pictures.clouds import surface_points

from ..conftest import ball, flat, lonlat, sheet


def test_points_lie_on_the_surface_and_as_dense_everywhere():
    vertices = np.array([[0.0, 0, 0], [3, 0, 0], [3, 1, 0], [0, 1, 0], [-1, 0, 0]])
    mesh = Mesh(vertices, [[0, 1, 2], [0, 2, 3], [0, 3, 4]])  # areas 1.5, 1.5, 0.5
    points = surface_points(mesh, 7000)
    counts = np.bincount(points.face)
    np.testing.assert_allclose(counts, [3000, 3000, 1000], rtol=0.06)  # 3 standard deviations
    assert points.weights.min() >= 0
    np.testing.assert_allclose(points.weights.sum(axis=1), 1)
    middle = points.positions[points.face < 2].mean(axis=0)
    np.testing.assert_allclose(middle, [1.5, 0.5, 0], atol=0.04)
    np.testing.assert_array_equal(points.positions, surface_points(mesh, 7000).positions)


def test_uv_is_interpolated_but_taken_whole_where_a_face_spans_a_seam():
    mesh = sheet()
    points = surface_points(mesh, 500)
    uv = flat(mesh).uv[mesh.faces]
    spanning = np.zeros(len(mesh.faces), dtype=bool)
    np.testing.assert_allclose(points.uv(uv, spanning), points.positions[:, :2], atol=1e-12)
    corners = points.uv(uv, ~spanning)
    assert all((corners == flat(mesh).uv[:, None]).all(axis=2).any(axis=0))


def drawn(mesh, result):
    scene = Scene(mesh)
    view = scene.view(camera(mesh, np.eye(3)[2], np.eye(3)[1]), 64, 2)
    found = Map(mesh, result)
    colours = normal_colours(scene, view.camera)
    return view, clouds.images(view, found, colours, FIELDS / scene.size, 400)


def test_only_the_dense_picture_fills_the_surface():
    view, made = drawn(sheet(), flat(sheet()))
    assert list(made) == ["cloud", "cloud-uv", "dense", "seams"]
    whole = (made["dense"][..., 3] > 0).sum()
    assert whole == len(np.unique(view.sample // (64 * 2 * 2) * 64 + view.sample % 128 // 2))
    assert 0.2 * whole < (made["cloud"][..., 3] > 0).sum() < 0.9 * whole
    again = drawn(sheet(), flat(sheet()))[1]
    assert all((made[kind] == again[kind]).all() for kind in made)


def test_points_on_faces_that_span_the_seam_are_green():
    def greens(mesh, result):
        red, green, blue, _ = np.moveaxis(drawn(mesh, result)[1]["seams"].astype(int), 2, 0)
        return ((green > red + 60) & (green > blue + 60)).sum()

    assert greens(sheet(), flat(sheet())) == 0
    turned = ball().vertices[:, [1, 2, 0]] * [1, 1, -1]  # the date line faces the camera
    mesh = Mesh(turned, ball().faces)
    assert greens(mesh, lonlat(ball())) > 0


def test_flipped_faces_are_orange_in_the_texture():
    mesh = sheet()
    uv = flat(mesh).uv.copy()
    uv[:, 0] = np.abs(uv[:, 0] - 0.3)  # the smaller part is turned over
    flips = Map(mesh, Parameterization(uv, mesh.faces)).flipped.mean()
    assert 0.2 < flips < 0.4

    def oranges(result):
        red, green, blue, _ = np.moveaxis(drawn(mesh, result)[1]["dense"].astype(int), 2, 0)
        return ((red > green + 60) & (green > blue + 20)).mean()

    assert oranges(flat(mesh)) == 0
    assert oranges(Parameterization(uv, mesh.faces)) == pytest.approx(flips, abs=0.1)


@pytest.mark.parametrize(
    ("report", "params", "count"),
    [
        ({"points": 2048}, {"points": 10_000}, 2048),  # what was used, not what was asked for
        ({}, {"points": 500}, 500),
        ({}, {"points": None}, 10_000),
        ({"points": 10**6}, {}, clouds.MOST_POINTS),
    ],
)
def test_a_cloud_is_drawn_of_the_points_that_were_used(report, params, count, monkeypatch):
    monkeypatch.setattr(clouds, "SPARSE", 10_000)
    row = ResultRow("i", "s", "c", "parapoint", params, 0, "", "", "ok", report=report)
    assert clouds.points_used(row) == count


def waves(count=400):
    """Points on a wavy sheet, and their map to the plane."""
    points = surface_points(sheet(), count).positions
    return PointCloud(points), PointParameterization(points[:, :2])


def greens(image):
    red, green, blue, shown = np.moveaxis(image.astype(int), 2, 0)
    return int(((green > red + 60) & (green > blue + 60) & (shown > 0)).sum())


def test_a_cloud_is_seen_with_its_normals_or_without():
    cloud, result = waves()
    normals = np.tile([0.0, 0, 1], (400, 1))
    for one in (cloud, PointCloud(cloud.points, normals)):
        portrait = clouds.Portrait(one, 64, 2, FIELDS)
        assert list(portrait.model()) == ["mesh-1", "mesh-2"]
        made = portrait.map(result, ("cloud-uv", "dense", "seams"))
        assert list(made) == ["cloud-uv", "dense", "seams"]
        covered = {kind: int((image[..., 3] > 0).sum()) for kind, image in made.items()}
        assert 0.2 * covered["dense"] < covered["seams"] < 0.95 * covered["dense"]
        shades = made["dense"][made["dense"][..., 3] == 255][:, :3].astype(int)
        blue = shades[:, 2] > shades[:, 0] + 40  # of the two tones of the board, both are there
        assert 0.2 < blue.mean() < 0.8
        assert greens(made["seams"]) == 0


def test_a_point_has_one_colour_in_space_and_in_the_plane():
    """A flat square has one normal: no light changes the colour that stands for it."""
    mesh = Mesh(sheet().vertices * [1, 1, 0], sheet().faces)
    points = surface_points(mesh, 400).positions
    cloud = PointCloud(points, np.tile([0.0, 0, 1], (400, 1)))
    portrait = clouds.Portrait(cloud, 64, 2, FIELDS)
    for made in (
        drawn(mesh, flat(mesh))[1],
        portrait.map(PointParameterization(points[:, :2]), ("cloud", "cloud-uv")),
    ):
        one, two = (made[kind][made[kind][..., 3] == 255] for kind in ("cloud", "cloud-uv"))
        np.testing.assert_allclose(np.median(one, axis=0), np.median(two, axis=0), atol=2)


@pytest.mark.parametrize("height", [10, -10])
def test_normals_that_nobody_gave_point_out_of_a_cloud_wherever_it_lies(height):
    """Those of a cap of a sphere are the sphere's own."""
    normals = surface_points(ball(), 600).positions
    normals = normals[normals[:, 2] > 0.3]
    portrait = clouds.Portrait(PointCloud(normals + np.array([0, 0, height])), 16, 1, FIELDS)
    assert np.median((portrait._normals * normals).sum(axis=1)) > 0.9


@pytest.mark.parametrize(("fields", "side"), [(2, np.sqrt(2) / 2), (50, 5 / 19)])
@pytest.mark.parametrize("scale", [1.0, 3.0])
def test_a_field_on_a_cloud_is_a_share_of_its_diagonal_but_holds_five_points(fields, side, scale):
    """A square of 20 by 20 points, mapped as it is or enlarged: fields grow with it."""
    points = np.stack(np.meshgrid(*[np.arange(20) / 19] * 2), axis=2).reshape(-1, 2)
    cloud = PointCloud(np.pad(points, ((0, 0), (0, 1))))
    portrait = clouds.Portrait(cloud, 16, 1, fields)
    found = point_map(cloud, PointParameterization(scale * points))
    assert portrait._field(found) / np.ptp(found.uv[:, 0]) == pytest.approx(side)


def test_a_checkerboard_begins_with_a_light_field_on_meshes_and_on_clouds():
    """Fields as large as the map, which lies in the first."""
    mesh = sheet()
    scene = Scene(mesh)
    view = scene.view(camera(mesh, np.eye(3)[2], np.eye(3)[1]), 32, 1)
    colours = normal_colours(scene, view.camera)
    cloud, result = waves()
    portrait = clouds.Portrait(cloud, 32, 1, 0.5)
    for image in (
        clouds.images(view, Map(mesh, flat(mesh)), colours, 0.1, 400)["dense"],
        portrait.map(result, ("dense",))["dense"],
    ):
        red, _, blue, _ = image[image[..., 3] == 255].astype(int).T
        assert not (blue > red + 40).any()  # as the dark fields are


def test_where_a_map_of_a_cloud_tears_is_green():
    cloud, result = waves()
    portrait = clouds.Portrait(cloud, 64, 2, FIELDS)
    torn = result.uv + [[1.0, 0]] * (cloud.points[:, :1] > 0.5)
    assert greens(portrait.map(PointParameterization(torn), ("seams",))["seams"]) > 20
    with pytest.raises(InputError, match="7 uv rows"):
        portrait.map(PointParameterization(result.uv[:7]), ("seams",))
    with pytest.raises(InputError, match="not one of points"):
        portrait.map(flat(sheet()), ("seams",))
