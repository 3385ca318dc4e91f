"""Sheets that cross, with known answers."""

import numpy as np
import pytest
from scipy.spatial import Delaunay, cKDTree

from parapoint.computed import reconstruction
from parapoint.computed.delaunay import delaunay_complex, empty_radii
from parapoint.computed.reconstruction import triangulation
from parapoint.computed.sheets import _fitted, _signs, sheet_normals, sheet_triangles
from parapoint.surfaces.surface import Mesh, unit_normals

SIDE = 24


def crossing_planes() -> tuple[Mesh, np.ndarray]:
    """Two triangulated squares that cross at 70 degrees, and the normals of their points."""
    rng = np.random.default_rng(0)
    grid = np.stack(np.meshgrid(np.arange(SIDE), np.arange(SIDE)), axis=2).reshape(-1, 2)
    points, normals, faces = [], [], []
    for count, turn in enumerate((0.0, np.radians(70))):
        flat = grid + rng.uniform(-0.3, 0.3, grid.shape) - SIDE / 2
        points.append(flat @ [[1, 0, 0], [0, np.cos(turn), np.sin(turn)]])
        normals.append(np.tile([0, -np.sin(turn), np.cos(turn)], (len(flat), 1)))
        faces.append(Delaunay(flat).simplices + count * len(flat))  # counterclockwise
    return Mesh(np.concatenate(points), np.concatenate(faces)), np.concatenate(normals)


def test_normals_are_those_of_a_point_s_own_sheet_turned_as_the_faces() -> None:
    mesh, normals = crossing_planes()
    points = mesh.vertices
    spacing = cKDTree(points).query(points, 7)[0][:, 1:].mean(axis=1)
    delaunay = delaunay_complex(points, spacing)
    radius = empty_radii(delaunay)
    tight = radius < 1.2 * spacing[delaunay.triangles].max(axis=1)
    found = sheet_normals(points, delaunay.triangles[tight], radius[tight], mesh)
    cosine = (found * normals).sum(axis=1)
    # Only points of one sheet that are nearly on the other may belong to either.
    assert (cosine > 0.99).mean() > 0.97
    between = np.abs((points * normals[::-1]).sum(axis=1))  # distance from the other sheet
    assert (cosine[between > 1] > 0.95).all()


def test_triangles_along_sheets_are_those_of_each_sheet_alone() -> None:
    mesh, normals = crossing_planes()
    triangles, radius = sheet_triangles(mesh.vertices, normals)
    assert (radius > 0).all()
    sheet = triangles >= SIDE**2
    assert (sheet.all(axis=1) | ~sheet.any(axis=1)).all()
    inner = [
        tuple(face)
        for face in np.sort(mesh.faces, axis=1).tolist()
        if all(2 < row % SIDE < SIDE - 3 and 2 < row % SIDE**2 // SIDE < SIDE - 3 for row in face)
    ]
    found = set(map(tuple, triangles.tolist()))
    assert np.mean([face in found for face in inner]) > 0.98


def crossing_roll(r: float = 2.8, turns: int = 40) -> tuple[np.ndarray, np.ndarray]:
    """Points of a rolled strip, (t − r sin t, −r cos t) along z, and their places in it."""
    rng = np.random.default_rng(0)
    t = np.linspace(0, 4 * np.pi, 20_001)
    curve = np.stack([t - r * np.sin(t), -r * np.cos(t)], axis=1)
    length = np.append(0, np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1)))
    step = length[-1] / (4 * turns)
    place = np.stack(np.meshgrid(np.arange(4 * turns), np.arange(4 / step)), axis=2).reshape(-1, 2)
    place = place + [0, 0.5] * (place[:, :1] % 2) + rng.uniform(-0.35, 0.35, place.shape)
    x, y = (np.interp(place[:, 0] * step, length, of) for of in curve.T)
    return np.stack([x, y, place[:, 1] * step], axis=1), place


def test_a_front_goes_through_a_crossing(monkeypatch: pytest.MonkeyPatch) -> None:
    points, place = crossing_roll()

    def leaps(mesh: Mesh) -> int:
        """The edges between points that are far from each other on the strip."""
        i, j = mesh.edges.T
        return int((np.linalg.norm(place[i] - place[j], axis=1) > 4).sum())

    through = triangulation(points)
    monkeypatch.setattr(reconstruction, "SMOOTHER", 0)
    around = triangulation(points)
    assert leaps(around) > 60
    assert leaps(through) < 0.7 * leaps(around)
    assert through.referenced.mean() > 0.99


def test_normals_of_a_circle_agree_though_they_turn() -> None:
    # Point 1 has a link along x to point 0, whose normal is its own mirrored, as 60 degrees apart
    # on a circle: both rise by 1/2, so their cosine 1/2 counts as 1/2 + 2 (1/2)² = 1, and the bond
    # is exp(−(0.5 / 0.2)²) = 2e-3. Against its own is the normal of point 2, on a link along y
    # without rise: −(1/3)⁸ = −1.5e-4. So the link to 0 decides; by the bare cosine, which makes it
    # (1/2)⁸ 2e-3 = 8e-6, that to 2 would. Points 0 and 2 are held by faces that turn as they do.
    root = np.sqrt(3) / 2
    away = np.arccos(-1 / 3) + np.pi / 6  # from z towards x
    normals = np.array([[-0.5, 0, root], [0.5, 0, root], [np.sin(away), 0, np.cos(away)]])
    points, faces = [[-1.0, 0, 0], [0.0, 0, 0], [0.0, 1, 0]], []
    for corner in (0, 2):
        x, y, z = normals[corner]
        faces.append([corner, len(points), len(points) + 1])  # sides (z, 0, −x) and their cross
        side = np.array([z, 0, -x])
        points += [points[corner] + 0.1 * side, points[corner] + 0.1 * np.cross([x, y, z], side)]
    normals = np.concatenate([normals, normals[[0, 0, 2, 2]]])
    mesh = Mesh(np.array(points), np.array(faces))
    np.testing.assert_allclose(unit_normals(mesh.vertices, mesh.faces), normals[[0, 2]], atol=1e-12)
    signs = _signs(mesh.vertices, normals, np.array([[0, 1, 2]]), mesh)
    assert signs.tolist() == [1] * 7


def test_triangles_do_not_close_a_bay_of_a_sheet() -> None:
    # The lowest row of a grid of distance 1 is on an arch of radius 8. Three points in turn on it
    # lie on a circle of that size with no point inside, and above the largest that counts, 1.5
    # times the distance to six neighbours, which is 1 to 1.6 there.
    x, y = (of.ravel().astype(float) for of in np.indices((11, 6)))
    arch = np.sqrt(64 - (x - 5) ** 2) - 8
    points = np.stack([x, y + arch, 0 * x], axis=1)
    triangles, _ = sheet_triangles(points, np.tile([0.0, 0, 1], (66, 1)))
    assert len(triangles) > 80
    assert not (y[triangles] == 0).all(axis=1).any()


def test_a_plane_is_fitted_through_the_neighbours_of_every_row() -> None:
    """Four neighbours are enough for a plane, the point of the first row among them."""
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]])
    tilted = np.tile([0.0, np.sin(0.1), np.cos(0.1)], (5, 1))
    assert np.abs(_fitted(points, tilted)[:, 2]) == pytest.approx(np.ones(5))
    assert np.array_equal(_fitted(points[:4], tilted[:4]), tilted[:4])
