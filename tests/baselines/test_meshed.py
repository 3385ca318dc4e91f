"""Meshing a cloud, flattening the mesh, carrying the map back; packing."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from baselines import registry
from baselines.meshed import _near, carried, reconstructed
from parapoint.method import UnsupportedError
from parapoint.planar.domains import FlatteningError
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.preparation import prepared
from parapoint.surfaces.surface import Mesh, PointCloud
from parapoint.testing import irregular_disk
from parapoint.unwrapping.packing import by_component


def half_cylinder(count=1000):
    """(count, 2) arc length and height, and the cloud: developable, an isometry exists."""
    rng = np.random.default_rng(3)
    flat = rng.uniform([0, 0], [np.pi, 2], (count, 2))
    angle, height = flat.T
    return flat, PointCloud(np.stack([np.cos(angle), np.sin(angle), height], axis=1))


def mapped(spec, cloud):
    return registry.method(spec)[1].parameterize(cloud, seed=0)


@pytest.mark.parametrize(
    "spec",
    [
        "meshed(reconstruction=poisson, flattening=lscm)",
        "meshed(reconstruction=ball_pivoting, flattening=xatlas)",
    ],
)
def test_a_developable_cloud_is_unrolled(spec):
    pytest.importorskip("pymeshlab")
    flat, cloud = half_cylinder()
    result = mapped(spec, cloud)
    assert result.report["normals"] == "estimated"
    assert result.report["mean_distance_to_mesh"] < 0.01
    assert result.report["charts"] >= result.report["components"] >= 1
    # Distances between points near to each other, up to the scale of the map.
    inner = np.flatnonzero((flat > 0.2).all(axis=1) & (flat < [np.pi - 0.2, 1.8]).all(axis=1))
    pairs = np.random.default_rng(0).choice(inner, (4000, 2))
    true = np.linalg.norm(flat[pairs[:, 0]] - flat[pairs[:, 1]], axis=1)
    near = (true > 0.05) & (true < 0.2)
    ratio = np.linalg.norm(result.uv[pairs[near, 0]] - result.uv[pairs[near, 1]], axis=1)
    ratio /= true[near]
    # Half of the pairs within 10 %: ball pivoting leaves holes, xatlas makes charts.
    low, high = np.quantile(ratio, [0.25, 0.75])
    assert high < 1.1 * low


def test_a_mesh_is_refused():
    with pytest.raises(UnsupportedError, match="takes a point cloud"):
        prepared(irregular_disk(), registry.method("meshed")[1].requires)


def test_points_without_a_surface_fail_with_the_reason():
    pytest.importorskip("pymeshlab")
    line = PointCloud(np.linspace(0, 1, 50)[:, None] * [1.0, 2.0, 3.0])
    with pytest.raises(FlatteningError, match=r"gave no surface|MeshLab|cannot be flattened"):
        mapped("meshed(reconstruction=ball_pivoting)", line)


def test_points_get_the_uv_of_the_nearest_place():
    mesh = Mesh(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.0]]), [[0, 1, 2], [1, 3, 2]])
    # The two faces are two charts: the second one lies 10 further on.
    uv = np.array([[0, 0], [1, 0], [0, 1], [11, 0], [11, 1], [10, 1.0]])
    flat = Parameterization(uv, [[0, 1, 2], [3, 4, 5]])
    points = np.array([[0.25, 0.25, 0.5], [0.75, 0.75, -0.1], [-1, 0, 0], [1, 1, 0.0]])
    images, distance = carried(points, mesh, flat)
    assert_allclose(images, [[0.25, 0.25], [10.75, 0.75], [0, 0], [11, 1]], atol=1e-12)
    assert_allclose(distance, [0.5, 0.1, 1, 0], atol=1e-12)


def test_components_are_mapped_one_by_one_and_do_not_overlap():
    disk = irregular_disk()
    count = len(disk.vertices)
    # Their faces alternate, so that the order of faces is put to the test.
    faces = np.stack([disk.faces, disk.faces + count], axis=1).reshape(-1, 3)
    two = Mesh(np.concatenate([disk.vertices, 2 * disk.vertices + [5, 0, 0]]), faces)
    result = by_component(two, lambda part: Parameterization(part.vertices[:, :2], part.faces))
    images, true = result.uv[result.corners], two.vertices[faces][..., :2]
    assert_allclose(images - images[:, :1], true - true[:, :1], atol=1e-12)
    assert_array_equal(result.charts(), np.arange(len(faces)) % 2)
    one, other = result.uv[:count], result.uv[count:]
    apart = (one.max(0) < other.min(0)) | (other.max(0) < one.min(0))
    assert apart.any()


def test_a_face_without_area_gives_the_uv_of_its_nearest_corner():
    mesh = Mesh(np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0.0]]), [[0, 1, 2]])
    flat = Parameterization(np.array([[0, 0], [3, 0], [7, 1.0]]), [[0, 1, 2]])
    images, _ = carried(np.array([[2.1, 0, 0], [0.9, 0, 0.0]]), mesh, flat)
    assert_allclose(images, [[7, 1], [3, 0]])


def test_the_surface_ends_four_spacings_from_the_points():
    """The spacing inside a square grid of side 1 is the mean of 1, four times, and √2, twice."""
    points = np.stack([*np.meshgrid(np.arange(9.0), np.arange(9.0)), np.zeros((9, 9))], axis=2)
    reach = 4 * (4 + 2 * np.sqrt(2)) / 6
    vertices = np.array([[4, 4, 0.99 * reach], [4, 4, 1.01 * reach], [4, 4, -0.99 * reach]])
    assert_array_equal(_near(vertices, points.reshape(-1, 3)), [True, False, True])


def test_the_mesh_of_a_cloud_comes_with_its_map():
    pytest.importorskip("pymeshlab")
    _, cloud = half_cylinder(400)
    method = registry.method("meshed(reconstruction=ball_pivoting, flattening=lscm)")[1]
    made = method.charted(cloud, seed=0)
    assert len(made.mesh.faces) == len(made.map.corners) > 100


def test_the_mesh_of_a_cloud_is_cleaned_and_meshlab_says_nothing(capfd):
    """What ball pivoting makes of these points is not manifold; it leaves points unused."""
    pytest.importorskip("pymeshlab")
    mesh, report = reconstructed(half_cylinder(400)[1], "ball_pivoting")
    assert mesh.topology != "not manifold"
    assert mesh.referenced.all()
    assert report["components"] == 1
    assert report["faces_when_clean"] == len(mesh.faces) != report["faces"]
    assert capfd.readouterr().out == ""
