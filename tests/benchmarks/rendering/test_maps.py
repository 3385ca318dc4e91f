"""A map as it is drawn: what of it is shown, where, and in which colour."""

import igl
import numpy as np
import pytest

from benchmarks.rendering.camera import camera
from benchmarks.rendering.colours import linear
from benchmarks.rendering.maps import (
    ANGLE_SCALE,
    LEFT_OUT_TONE,
    SPANNING_TONE,
    Layout,
    Map,
    _outline,
    heat,
    textured,
)
from benchmarks.rendering.scene import Scene
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import Mesh


def sheet(count: int = 9) -> Mesh:
    """A wavy square sheet, a disk."""
    vertices, faces = igl.triangulated_grid(count, count)
    x, y = vertices.T
    return Mesh(np.stack([x, y, 0.15 * np.sin(5 * x) * np.cos(4 * y)], axis=1), faces)


def flat(mesh: Mesh) -> Parameterization:
    """The map that drops z."""
    return Parameterization(mesh.vertices[:, :2], mesh.faces)


def globe() -> Map:
    """A sphere by longitude and latitude: the faces across the date line span the seam."""
    vertices, faces = igl.upsample(*igl.icosahedron(), 2)
    mesh = Mesh(vertices / np.linalg.norm(vertices, axis=1, keepdims=True), faces)
    x, y, z = mesh.vertices.T
    uv = np.stack([np.arctan2(y, x), np.arcsin(z)], axis=1)
    return Map(mesh, Parameterization(uv, mesh.faces))


def test_uv_is_scaled_to_the_area_upright_and_unmirrored():
    mesh = sheet()
    uv = flat(mesh).uv * [-8, 2]
    found = Map(mesh, Parameterization(uv, mesh.faces)).uv
    a, b = found[:, 1] - found[:, 0], found[:, 2] - found[:, 0]
    areas = (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / 2
    assert areas.min() > 0
    assert areas.sum() == pytest.approx(mesh.face_areas.sum())
    width, height = np.ptp(found, axis=(0, 1))
    assert height > 3 * width


def test_a_map_whose_spanning_faces_alone_have_an_area_is_scaled_by_them():
    mesh = sheet()
    uv = 3 * np.maximum(mesh.vertices[:, :2] - [0.5, 0], 0)  # the left half lies on a line
    found = Map(mesh, Parameterization(uv, mesh.faces))
    right = mesh.vertices[mesh.faces][:, :, 0].max(axis=1) > 0.5
    found.__dict__["spanning"] = right
    areas = np.linalg.det(np.diff(found.uv, axis=1)) / 2
    assert areas.sum() == pytest.approx(mesh.face_areas[right].sum())


def test_spanning_faces_neither_scale_nor_colour_the_map():
    found = globe()
    assert 0 < found.spanning.mean() < 0.3
    assert not (found.flipped & found.spanning).any()
    np.testing.assert_array_equal(np.isnan(found.angle), found.spanning)
    np.testing.assert_array_equal(np.isnan(found.area), found.spanning)


def test_heat_of_a_stretch_known_by_hand():
    mesh = Mesh(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), [[0, 1, 2]])
    found = Map(mesh, Parameterization([[0.0, 0], [4, 0], [0, 1]], mesh.faces))
    np.testing.assert_allclose(found.angle, [2.0])
    np.testing.assert_allclose(found.area, [0.0], atol=1e-12)


def test_a_face_without_uv_area_has_the_worst_colour():
    mesh = sheet()
    uv = flat(mesh).uv.copy()
    uv[mesh.faces[0]] = uv[mesh.faces[0, 0]]
    found = Map(mesh, Parameterization(uv, mesh.faces))
    assert found.angle[0] == np.inf
    assert found.area[0] == -np.inf
    colours = heat(np.array([0.0, np.inf, 2.0, np.nan]), ANGLE_SCALE)
    np.testing.assert_array_equal(colours[1], colours[2])
    np.testing.assert_allclose(colours[3], linear([0.8] * 3))


def test_spanning_faces_lie_below_the_others_and_pale() -> None:
    """They reach across the whole map, and are seen only where nothing else is."""
    found = globe()
    layout = Layout(found, 120)
    shown = found.spanning[layout._view.face]
    assert shown.mean() < 0.1
    colours = np.tile(linear([1.0, 0.0, 0.0]), (len(found.mesh.faces), 1))
    tones = np.unique(layout.image(colours)[..., :3].reshape(-1, 3), axis=0)
    pale = np.round(255 * np.array([0.90, 0.91, 0.90]))
    assert np.abs(tones - pale).sum(axis=1).min() <= 1
    assert np.array_equal(SPANNING_TONE, linear([0.90, 0.91, 0.90]))


def test_a_flipped_face_lies_on_top() -> None:
    """The fourth vertex of a strip is folded back over the first face."""
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [2, 0, 0]])
    mesh = Mesh(points, [[0, 1, 2], [1, 3, 2], [1, 4, 3]])
    uv = points[:, :2].copy()
    uv[4] = [0.2, 0.4]
    found = Map(mesh, Parameterization(uv, mesh.faces))
    assert found.flipped.tolist() == [False, False, True]
    layout = Layout(found, 100)
    of_all = np.abs(found._state.triangles.uv_area)
    seen = np.bincount(layout._view.face, minlength=3) / len(layout._view.face)
    # It covers its own area, all of it inside of the square that the other two fill.
    assert seen[2] == pytest.approx(of_all[2] / of_all[:2].sum(), abs=0.02)


def test_the_outline_is_the_boundary_of_the_charts() -> None:
    mesh = sheet(5)
    outline = _outline(Map(mesh, flat(mesh)))
    assert outline.shape == (16, 2, 3)
    lengths = np.linalg.norm(outline[:, 1] - outline[:, 0], axis=1)
    area = mesh.face_areas.sum()
    assert lengths.sum() == pytest.approx(4 * np.sqrt(area))


def test_a_seam_of_doubled_vertices_is_drawn_as_one_of_the_map() -> None:
    """Two triangles that meet in an edge, whose ends each has for itself."""
    points = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    mesh = Mesh(points, [[0, 1, 2], [3, 4, 5]])
    uv = np.array(points, dtype=float)[:, :2] + np.repeat([[0, 0], [1, 0]], 3, axis=0)
    found = Map(mesh, Parameterization(uv, mesh.faces))
    assert sorted(found.seams[0].tolist()) == [[0, 1, 0], [1, 0, 0]]
    assert len(found.seams) == 1


def region() -> Map:
    """A flat map of the sheet's left half; of its right half the map says nothing."""
    mesh = sheet()
    uv = flat(mesh).uv
    return Map(mesh, Parameterization(np.where(uv[:, :1] > 0.5, np.nan, uv), mesh.faces))


def test_faces_that_a_map_leaves_out_are_nowhere_in_the_plane() -> None:
    found = region()
    assert found.covered.sum() == len(found.mesh.faces) / 2
    assert np.isfinite(found.uv).all()
    a, b = found.uv[:, 1] - found.uv[:, 0], found.uv[:, 2] - found.uv[:, 0]
    areas = (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / 2
    np.testing.assert_array_equal(areas > 0, found.covered)
    assert areas.sum() == pytest.approx(found.mesh.face_areas[found.covered].sum())
    assert found.covered[Layout(found, 40)._view.face].all()
    assert np.ptp(found.uv, axis=(0, 1)).min() == pytest.approx(np.ptp(_outline(found)[..., 0]))


def test_faces_that_a_map_leaves_out_have_one_tone_and_no_marks() -> None:
    found = region()
    assert not (found.spanning | found.flipped).any()
    for values in (found.angle, found.area):
        np.testing.assert_array_equal(np.isfinite(values), found.covered)
    assert len(found.seams) == 0
    scene = Scene(found.mesh, shadows=False)
    view = scene.view(camera(found.mesh, np.eye(3)[2], np.eye(3)[1]), 40, 1)
    assert 0.3 < found.covered[view.face].mean() < 0.7
    tones = view.image(np.where(found.covered[view.face, None], 0, LEFT_OUT_TONE))
    shown, left = textured(view, found).reshape(-1, 4), ~found.covered[view.face]
    np.testing.assert_array_equal(shown[view.sample[left]], tones.reshape(-1, 4)[view.sample[left]])


def test_marks_of_a_region_stand_at_their_faces() -> None:
    """The globe without its first face: all that is marked there is marked here."""
    whole = globe()
    corners = whole.parameterization.corners
    first = int(np.flatnonzero(whole.spanning)[0])
    uv = np.vstack([whole.parameterization.uv, np.full((3, 2), np.nan)])
    kept = np.arange(len(corners)) != first - 1
    assert not whole.spanning[~kept].any()
    cut = np.where(kept[:, None], corners, len(uv) + np.array([-3, -2, -1]))
    found = Map(whole.mesh, Parameterization(uv, cut))
    np.testing.assert_array_equal(found.covered, kept)
    np.testing.assert_array_equal(found.spanning, whole.spanning)
    np.testing.assert_array_equal(found.flipped, whole.flipped)
    np.testing.assert_array_equal(np.isnan(found.angle), whole.spanning | ~kept)
