"""A figure of a surface and its map."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

pytest.importorskip("matplotlib")

from matplotlib.collections import PathCollection

from parapoint import picturing
from parapoint.picturing import figure, html
from parapoint.surfaces.parameterization import Charted, Parameterization
from parapoint.surfaces.surface import Mesh

POINTS = np.array([[0.0, 0, 0], [4, 0, 1], [4, 2, 2], [0, 2, 5]])
UV = np.array([[1.0, 1], [5, 1], [5, 3], [1, 3]])


def test_points_and_images_have_the_same_colours_and_seams_are_black():
    made = figure(POINTS, UV, np.array([False, False, True, False]))
    space, plane = made.axes
    assert (space.get_title(), plane.get_title()) == ("surface", "map")
    assert not space.axison
    assert not plane.axison
    assert plane.get_aspect() == 1
    box = np.asarray(space._box_aspect)
    assert_allclose(box / box[0], [1, 0.5, 1.25])
    assert space.get_subplotspec().get_geometry()[2] == 0
    assert plane.get_subplotspec().get_geometry() == (1, 2, 1, 1)
    (dots,) = (one for one in plane.collections if isinstance(one, PathCollection))
    assert_allclose(dots.get_offsets(), UV)
    # u and v in widths of the map are (0, 0), (1, 0), (1, 1/2) and (0, 1/2).
    wanted = [[0, 0.5, 1], [1, 0.5, 1], [0, 0, 0], [0, 0.35, 1]]
    assert_allclose(dots.get_facecolor()[:, :3], wanted)
    (there,) = space.collections
    assert_allclose(np.column_stack([np.asarray(of) for of in there._offsets3d]), POINTS)
    assert made._repr_png_().startswith(b"\x89PNG")


@pytest.mark.parametrize("axis", range(3))
def test_a_flat_cloud_is_drawn_flat(axis):
    points = POINTS * np.where(np.arange(3) == axis, 0.0, 1.0)
    made = figure(points, UV, np.zeros(4, dtype=bool))
    box = np.asarray(made.axes[0]._box_aspect)
    assert box[axis] / box.max() == picturing.FLATTEST
    assert made._repr_png_().startswith(b"\x89PNG")


@pytest.mark.parametrize(("count", "drawn"), [(9, 9), (10, 5), (11, 6), (20, 7), (100, 10)])
def test_of_many_points_some_are_drawn(monkeypatch, count, drawn):
    monkeypatch.setattr(picturing, "MOST_DRAWN", 10)
    points = np.random.default_rng(0).random((count, 3))
    made = figure(points, points[:, :2], np.zeros(count, dtype=bool))
    (dots,) = made.axes[1].collections
    assert len(dots.get_offsets()) == drawn


def test_colours_follow_the_places_in_widths_of_the_map():
    hues = picturing._hues(np.array([[0.0, 0], [2, 1], [1, 0.5]]))
    assert_allclose(hues, [[0, 0.5, 1], [1, 0.35, 0.5], [0.5, 0.425, 0.875]])


def test_a_notebook_sees_the_text_and_a_picture_where_there_is_one():
    assert html("a < b", None) == "<code>a &lt; b</code>"
    flat = Mesh(POINTS, [[0, 1, 2], [0, 2, 3]])
    shown = html("x", Charted(flat, Parameterization(UV, flat.faces)))
    assert shown.startswith('<code>x</code><br><img alt="the surface and its map" src="data:image')
