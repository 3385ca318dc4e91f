"""Colours of clouds whose right picture is known anywhere: sums of waves of bounded length."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal

from benchmarks.cases.builtin import cone
from benchmarks.cases.coloured import coloured, wave_colours
from parapoint.surfaces.surface import Mesh

POINTS = np.random.default_rng(0).uniform(size=(500, 3))


def test_colours_are_those_of_the_waves_in_units_of_the_longest_side() -> None:
    """So a model that is drawn ten times as large has the same colours. Strays do not count."""
    mesh = cone()  # its base, 2 x 2, is as wide as it is high
    cloud = coloured(mesh, 3.0, count=200)
    found = cloud.attributes["colours"]
    assert found.dtype == np.uint8
    assert_array_equal(found, np.rint(255 * wave_colours(cloud.points / 2, 3.0)))
    stray = np.concatenate([10 * mesh.vertices, [[1e6, 0, 0]]])
    large = coloured(Mesh(stray, mesh.faces), 3.0, count=200)
    assert_allclose(large.points, 10 * cloud.points)
    assert_array_equal(large.attributes["colours"], found)


def test_twice_the_waves_are_those_of_a_cloud_twice_as_large() -> None:
    assert_allclose(wave_colours(POINTS, 6.0), wave_colours(2 * POINTS, 3.0), atol=1e-12)
    assert np.ptp(wave_colours(POINTS, 0.0), axis=0).max() == 0


def test_colours_vary_and_are_seldom_cut_off() -> None:
    colours = wave_colours(POINTS, 3.0)
    assert 0 <= colours.min() < 0.2
    assert 0.8 < colours.max() <= 1
    assert colours.std(axis=0).min() > 0.1
    assert np.mean((colours == 0) | (colours == 1)) < 0.2
