import math

import igl
import numpy as np
import pytest
from scipy.spatial import cKDTree

from parapoint import Mesh, PointCloud
from parapoint.errors import InputError
from parapoint.surfaces.sampling import (
    even_sample,
    hull_sample,
    mean_spacing,
    surface_sample,
    training_points,
)
from parapoint.testing import irregular_disk


def waves() -> Mesh:
    """A square of 50 x 50 vertices with rows that go up and down."""
    x, y = (of.ravel() for of in np.meshgrid(np.arange(50.0), np.arange(50.0)))
    corner = (np.arange(49)[:, None] * 50 + np.arange(49)).ravel()
    sides = [0, 1, 51], [0, 51, 50]
    faces = np.concatenate([corner[:, None] + np.array(side) for side in sides])
    return Mesh(np.column_stack([x, y, x % 2]), faces)


def rows(points: np.ndarray) -> set[tuple[float, ...]]:
    return {tuple(row) for row in points.tolist()}


def test_training_points_of_a_mesh_come_from_the_vertices_of_its_faces() -> None:
    many = np.random.default_rng(1).uniform(size=(3000, 3))
    soup = Mesh(many, np.arange(2700).reshape(-1, 3))  # 300 vertices are in no face
    drawn = training_points(soup, 500, 0)
    assert len(rows(drawn)) == 500
    assert rows(drawn) <= rows(many[:2700])
    assert not np.array_equal(training_points(soup, 500, 1), drawn)


@pytest.mark.parametrize("seed", range(5))
def test_a_mesh_of_few_faces_gives_as_many_points_as_a_fit_needs(seed) -> None:
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
    sides = [np.column_stack([square, np.full(4, z)]) for z in (0.0, 1e-4)]
    plate = Mesh(np.concatenate(sides), [[0, 1, 2], [0, 2, 3], [4, 6, 5], [4, 7, 6]])
    assert len(even_sample(plate, 100, seed)) < 100
    assert len(training_points(plate, 100, seed)) == 100


def test_points_of_faces_are_added_where_the_vertices_do_not_show_the_shape() -> None:
    disk = irregular_disk()  # 81 vertices
    points = training_points(disk, 150, 0)
    assert rows(disk.vertices) < rows(points)
    assert len(points) == 150
    sheet = waves()
    assert len(training_points(sheet, 4000, 0)) == 2500
    # As triangles with corners of their own it is the same surface.
    apart = Mesh(
        sheet.vertices[sheet.faces.reshape(-1)], np.arange(sheet.faces.size).reshape(-1, 3)
    )
    assert len(training_points(apart, 4000, 0)) == 2500
    # A second sheet is nearer to the first than its vertices are to one another.
    for distance, count in ((5.0, 5000), (0.5, 20_000)):
        above = sheet.vertices + np.array([0, 0, distance])
        both = Mesh(
            np.concatenate([sheet.vertices, above]),
            np.concatenate([sheet.faces, sheet.faces + 2500]),
        )
        assert len(training_points(both, 20_000, 0)) == count


def test_points_on_faces_are_spread_evenly() -> None:
    mesh = waves()
    count = 6000
    points = even_sample(mesh, count, 0)
    assert len(points) == count
    assert np.array_equal(points, even_sample(mesh, count, 0))
    assert rows(points[:2500]) == rows(mesh.vertices)
    squared, _, _ = igl.point_mesh_squared_distance(points, mesh.vertices, mesh.faces)
    assert squared.max() < 1e-18
    spacing = np.sqrt(mesh.face_areas.sum() / count)
    nearest = cKDTree(points).query(points[2500:], 2)[0][:, 1]
    assert nearest.min() > 0.6 * spacing
    # No place is far from a point; of points drawn by area alone some would be.
    dense = surface_sample(mesh.vertices, mesh.faces, 20_000, 1)
    assert cKDTree(points).query(dense)[0].max() < 1.6 * spacing


def test_a_small_part_with_many_vertices_takes_no_more_pairs_than_a_large_one(monkeypatch) -> None:
    figure, size = waves(), 2500
    ground = 1e6 * np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    scene = Mesh(
        np.concatenate([figure.vertices, ground]),
        np.concatenate([figure.faces, [[size, size + 1, size + 2]]]),
    )
    pairs = []

    class Counting(cKDTree):
        def query_pairs(self, *arguments, **options):
            found = super().query_pairs(*arguments, **options)
            pairs.append(len(found))
            return found

    monkeypatch.setattr("parapoint.surfaces.sampling.cKDTree", Counting)
    assert len(even_sample(scene, 6000, 0)) == 6000
    assert sum(pairs) < 50 * 6000


def test_hull_points_lie_on_the_hull_and_are_spread_by_area() -> None:
    rng = np.random.default_rng(0)
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 4)], float)
    cloud = np.concatenate([corners, rng.uniform(0.2, 0.8, (50, 3)) * [1, 1, 4]])
    points = hull_sample(cloud, 4000, 0)
    on_face = (np.isclose(points, 0) | np.isclose(points, [1, 1, 4])).any(axis=1)
    assert on_face.all()
    ends = np.isclose(points[:, 2], 0) | np.isclose(points[:, 2], 4)
    # 2 of 18 units of area; five standard deviations of a binomial of 4,000.
    assert ends.mean() == pytest.approx(2 / 18, abs=5 * math.sqrt(2 / 18 * 16 / 18 / 4000))


def test_a_planar_cloud_is_its_own_hull() -> None:
    flat = np.column_stack([np.random.default_rng(0).uniform(size=(150, 2)), np.zeros(150)])
    assert np.array_equal(hull_sample(flat, 150, 0), flat)


def test_surface_samples_are_uniform_by_area() -> None:
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 5], [3, 0, 5], [0, 1, 5]])
    faces = np.array([[0, 1, 2], [3, 4, 5]])
    points = surface_sample(vertices, faces, 4000, 3)
    assert np.isclose(points[:, 2], 5).mean() == pytest.approx(0.75, abs=0.04)
    below = points[points[:, 2] < 1]
    np.testing.assert_allclose(below.mean(axis=0), [1 / 3, 1 / 3, 0], atol=0.04)
    assert (below[:, 0] + below[:, 1] <= 1 + 1e-12).all()


def test_vertices_beside_another_sheet_make_a_mesh_coarse_from_half_a_percent_on() -> None:
    # Of the three nearest of a vertex under a patch at distance 0.5, the one above is more than two
    # edges off, and so is that of the patch below it; at the patch's ends along y a second one is.
    # With k × k vertices that is 2 k² + 2 k of 3 (2500 + k²): 1.1 % for k = 6, 0.2 % for k = 2. At
    # distance 1.1 it is the third nearest, after two neighbours at 1: 2 k² of them, 0.9 %.
    sheet = waves()
    for side, height, count in ((6, 0.5, 20_000), (2, 0.5, 2504), (6, 1.1, 20_000)):
        corner = (10 * 50 + 10) + np.arange(side)[:, None] * 50 + np.arange(side)
        inside = np.isin(sheet.faces, corner).all(axis=1)
        new = np.full(2500, -1)
        new[corner.ravel()] = 2500 + np.arange(side**2)
        patch = sheet.vertices[corner.ravel()] + np.array([0, 0, height])
        both = Mesh(
            np.concatenate([sheet.vertices, patch]),
            np.concatenate([sheet.faces, new[sheet.faces[inside]]]),
        )
        assert len(training_points(both, 20_000, 0)) == count


def test_the_spacing_is_the_mean_distance_to_the_nearest_point() -> None:
    # From 0, 1 and 3 on a line: 1, 1 and 2.
    assert mean_spacing(np.array([[0.0, 0, 0], [1.0, 0, 0], [3.0, 0, 0]])) == pytest.approx(4 / 3)


def test_points_on_a_line_are_refused_and_those_in_a_plane_are_not() -> None:
    plane = np.pad(np.random.default_rng(0).uniform(size=(150, 2)), ((0, 0), (0, 1)))
    assert rows(training_points(PointCloud(plane), 200, 0)) == rows(plane)
    with pytest.raises(InputError, match="on a line"):
        training_points(PointCloud(plane * [1, 0, 0] + [0, 2, 5]), 200, 0)
