import numpy as np
import pytest

from parapoint import Mesh, ParaPoint, PointCloud
from parapoint.surfaces.components import cloud_labels, components, largest_component, parts_of
from parapoint.testing import irregular_disk

TINY = {"preset": "paper", "points": 400, "subset": 100, "iterations": 4, "device": "cpu"}


def spheres(*counts: int) -> np.ndarray:
    """Spheres of radius 1, 5 apart, with so many points."""
    rng = np.random.default_rng(0)
    parts = [rng.normal(size=(count, 3)) for count in counts]
    return np.concatenate(
        [p / np.linalg.norm(p, axis=1, keepdims=True) + [5 * k, 0, 0] for k, p in enumerate(parts)]
    )


def test_a_cloud_s_components_are_found_at_uneven_density() -> None:
    points = spheres(2000, 300)
    label = cloud_labels(points)
    assert len(np.unique(label)) == 2
    assert len(np.unique(label[:2000])) == len(np.unique(label[2000:])) == 1
    parts = components(PointCloud(points))
    assert [len(part.points) for part in parts] == [2000, 300]
    np.testing.assert_array_equal(parts[1].points, points[2000:])


def test_what_is_too_small_for_a_fit_goes_with_the_nearest() -> None:
    points = spheres(500, 300, 20)
    label = cloud_labels(points)
    assert set(label[800:]) == set(label[500:800])
    assert len(np.unique(label)) == 2
    assert not cloud_labels(points[800:]).any()


def test_a_mesh_s_components_come_by_area() -> None:
    disk = irregular_disk()
    both = Mesh(
        np.concatenate([disk.vertices, 2 * disk.vertices]),
        np.concatenate([disk.faces, disk.faces + len(disk.vertices)]),
    )
    large, small = components(both)
    np.testing.assert_allclose(large.vertices, 2 * disk.vertices)
    np.testing.assert_array_equal(small.faces, disk.faces)


def test_vertices_at_one_place_join_the_components_of_a_mesh() -> None:
    disk = irregular_disk()
    corners = disk.vertices[disk.faces].reshape(-1, 3)
    points = np.concatenate([corners, 2 * corners[:3] + 9])
    soup = Mesh(points, np.arange(len(points)).reshape(-1, 3))
    assert [len(part.faces) for part in components(soup)] == [len(disk.faces), 1]
    part, chosen = largest_component(soup)
    np.testing.assert_array_equal(np.flatnonzero(~chosen), len(disk.faces))
    np.testing.assert_array_equal(part.vertices, corners)


@pytest.fixture(scope="module")
def each() -> tuple[np.ndarray, ParaPoint]:
    points = spheres(500, 300)
    return points, ParaPoint(**TINY, components="each").fit(points)


def test_each_component_has_a_chart_of_its_own_beside_the_others(each) -> None:
    points, model = each
    assert model.report_["components"] == 2
    assert model.report_["iterations"] == 8
    fitted = model.transform(model.points_)
    first = model.points_[:, 0] < 2.5
    one, other = fitted[first], fitted[~first]
    assert ((one.max(0) < other.min(0)) | (other.max(0) < one.min(0))).any()
    alone = ParaPoint(**{**TINY, "points": 250}).fit(points[:500])
    uv = alone.transform(points[:500])
    np.testing.assert_allclose(  # that chart is the map of the component by itself, moved
        model.transform(points[:500]) - uv,
        np.broadcast_to(one.min(0) - alone.transform(alone.points_).min(0), uv.shape),
        atol=1e-5,
    )
    inner = (uv > alone.transform(alone.points_).min(0)).all(1)
    np.testing.assert_allclose(
        model.inverse_transform(model.transform(points[:500]))[inner],
        alone.inverse_transform(uv)[inner],
        atol=1e-5,
    )


def test_a_model_of_components_is_saved(each, tmp_path) -> None:
    points, model = each
    model.save(tmp_path)
    loaded = ParaPoint.load(tmp_path, device="cpu")
    np.testing.assert_array_equal(loaded.transform(points), model.transform(points))
    assert loaded.seams().shape == (len(model.points_),)


def test_the_largest_alone_is_fitted() -> None:
    model = ParaPoint(**TINY, components="largest").fit(spheres(300, 500))
    assert model.points_[:, 0].min() > 2.5
    assert len(model.points_) == 400


def test_together_is_one_map_of_all() -> None:
    model = ParaPoint(**TINY).fit(spheres(300, 500))
    assert set(model.points_[:, 0] > 2.5) == {True, False}


@pytest.mark.parametrize("count", [1, 2])
def test_that_several_components_get_one_map_is_said(count: int, caplog) -> None:
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    mesh = Mesh(
        np.concatenate([points, points + 9])[: 3 * count], np.arange(3 * count).reshape(-1, 3)
    )
    (whole,) = parts_of(mesh, "together")
    assert whole is mesh
    assert caplog.text.count("2 components: one map is fitted") == count - 1


def test_two_sheets_three_spacings_apart_are_two_components() -> None:
    # The eight nearest of a point are on its own sheet, within √2 of the spacing, at a corner
    # within 2 √2; 80 nearest would reach five spacings far.
    x, y = (of.ravel() for of in np.indices((20, 20)))
    sheets = [np.stack([x, y, 0 * x + z], axis=1) for z in (0.0, 3.0)]
    assert cloud_labels(np.concatenate(sheets)).tolist() == [0] * 400 + [1] * 400


def test_a_component_of_no_area_is_left_out() -> None:
    disk = irregular_disk()
    line = np.array([[5.0, 0, 0], [6, 0, 0], [7, 0, 0]])
    faces = np.concatenate([disk.faces, [[81, 82, 83]]])
    (only,) = components(Mesh(np.concatenate([disk.vertices, line]), faces))
    np.testing.assert_array_equal(only.faces, disk.faces)


def test_normals_stay_with_their_points() -> None:
    points = spheres(500, 300)
    for part in components(PointCloud(points, -points)):
        assert part.normals is not None
        np.testing.assert_array_equal(part.normals, -part.points)


def test_points_of_a_component_keep_what_is_known_of_them() -> None:
    points = spheres(300, 2000)
    colours = np.repeat(np.array([[9, 0, 0], [0, 7, 0]], dtype=np.uint8), [300, 2000], axis=0)
    largest = components(PointCloud(points, points, attributes={"colours": colours}))[0]
    assert len(largest.points) == 2000
    assert (largest.attributes["colours"] == [0, 7, 0]).all()
    assert np.array_equal(largest.normals, largest.points)
