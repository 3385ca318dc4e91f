import igl
import numpy as np
from scipy.spatial import Delaunay

from parapoint.computed.layout import scaled_layout
from parapoint.computed.scale import area_discrepancy, even_scale, log_scale
from parapoint.surfaces.areas import signed_areas
from parapoint.surfaces.surface import FloatArray, IntArray, Mesh


def upwards(plane: FloatArray) -> IntArray:
    """(F, 3) Delaunay triangles of points (V, 2), counter-clockwise."""
    faces = Delaunay(plane).simplices.astype(np.int64)
    turned = signed_areas(plane, faces) < 0
    return np.where(turned[:, None], faces[:, ::-1], faces)


def cap(angle: float, rings: int) -> Mesh:
    """The unit sphere around its pole, as far as `angle` from it."""
    polar = np.linspace(0, angle, rings)[1:]
    turn = np.linspace(0, 2 * np.pi, 48, endpoint=False)
    theta, phi = (of.ravel() for of in np.meshgrid(polar, turn, indexing="ij"))
    ring = np.column_stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi)])
    points = np.concatenate([[[0, 0, 1]], np.column_stack([ring, np.cos(theta)])])
    plane = np.concatenate([[[0.0, 0.0]], theta[:, None] * ring / np.sin(theta)[:, None]])
    faces = upwards(plane)
    return Mesh(points, faces)


def sides(points: FloatArray, mesh: Mesh) -> FloatArray:
    """(E,) lengths of the edges."""
    return np.asarray(np.linalg.norm(np.diff(points[mesh.edges], axis=1)[:, 0], axis=1))


def test_a_rolled_up_strip_keeps_all_lengths() -> None:
    x, y = (of.ravel() for of in np.meshgrid(np.arange(25.0), np.arange(13.0)))
    points = np.column_stack([4 * np.cos(x / 4), 4 * np.sin(x / 4), y])
    mesh = Mesh(points, upwards(np.column_stack([x, y])))
    uv = scaled_layout(mesh, even_scale(mesh))
    np.testing.assert_allclose(sides(uv, mesh), sides(points, mesh), rtol=1e-6)


def test_a_spherical_cap_is_laid_out_by_stereographic_projection() -> None:
    mesh = cap(2.0, 30)
    scale = log_scale(mesh)
    # The projection that keeps the boundary's length magnifies by cos²(2 / 2) / cos²(θ / 2).
    known = np.log(np.cos(1.0) ** 2 / ((1 + mesh.vertices[:, 2]) / 2))
    assert np.abs(scale - known).max() < 0.02
    uv = scaled_layout(mesh, scale)
    polar = np.arccos(np.clip(mesh.vertices[:, 2], -1, 1))
    radius = np.linalg.norm(uv - uv[0], axis=1)
    np.testing.assert_allclose(radius, 2 * np.cos(1.0) ** 2 * np.tan(polar / 2), atol=0.02)


def test_the_boundary_bends_where_that_makes_the_scale_even() -> None:
    mesh = cap(2.0, 30)
    turned = mesh.vertices @ np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
    half = Mesh(
        *igl.remove_unreferenced(turned, mesh.faces[turned[mesh.faces].mean(axis=1)[:, 0] > 0])[:2]
    )
    even, given = even_scale(half), log_scale(half)
    assert area_discrepancy(half, even) < 0.9 * area_discrepancy(half, given)
    uv = scaled_layout(half, even)
    corner = [
        igl.internal_angles(of, half.faces) for of in (half.vertices, np.pad(uv, ((0, 0), (0, 1))))
    ]
    assert np.abs(corner[0] - corner[1]).mean() < 0.02


def test_a_small_part_keeps_its_scale_as_a_large_one_does() -> None:
    # The pole of a cap of 2.9 radians is mapped 50 times as small as the rim, by the projection of
    # the test above. Errors count relative to the scale, so that of an edge is 0.008 in the mean,
    # as measured; were all alike it would be 0.021, most of it around the pole.
    mesh = cap(2.9, 30)
    scale = log_scale(mesh)
    uv = scaled_layout(mesh, scale)
    found = np.log(sides(uv, mesh) / sides(mesh.vertices, mesh))
    assert np.abs(found - scale[mesh.edges].mean(axis=1)).mean() < 0.012


def test_a_face_without_area_leaves_the_layout_as_it_is() -> None:
    # A vertex in the middle of an edge of a flat grid makes one of three faces a line.
    x, y = (of.ravel() for of in np.meshgrid(np.arange(13.0), np.arange(7.0)))
    plane = np.column_stack([x, y])
    faces = upwards(plane)
    a, b, c = faces[40]
    plane = np.vstack([plane, (plane[a] + plane[b]) / 2])
    parts = [[a, b, 91], [b, c, 91], [c, a, 91]]
    points = np.pad(plane, ((0, 0), (0, 1)))
    mesh = Mesh(points, np.concatenate([np.delete(faces, 40, axis=0), parts]))
    uv = scaled_layout(mesh, np.zeros(92))
    np.testing.assert_allclose(sides(uv, mesh), sides(points, mesh), rtol=1e-9)
