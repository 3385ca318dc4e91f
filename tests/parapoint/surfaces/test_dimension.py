"""What is no surface is said, and every scale that a number holds has its map."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from parapoint import ComputedMap
from parapoint.errors import InputError
from parapoint.files.reading import read_surface
from parapoint.surfaces.dimension import dimensions
from parapoint.surfaces.surface import FloatArray, Mesh
from parapoint.testing import irregular_disk

RNG = np.random.default_rng(0)
T = RNG.uniform(0, 2 * np.pi, 600)


def normal(count: int) -> FloatArray:
    """Points in all directions."""
    return np.random.default_rng(1).normal(size=(count, 3))


def sphere(count: int) -> FloatArray:
    """Points of the unit sphere."""
    points = normal(count)
    return points / np.linalg.norm(points, axis=1, keepdims=True)


CURVES = {
    "line": np.outer(T, [1, 2, 3]),
    "line with noise": np.outer(T, [1, 2, 3]) + 1e-4 * normal(600),
    "circle": np.stack([np.cos(T), np.sin(T), 0 * T], axis=1),
    "two lines": np.stack([T, 100.0 * (T > 3), 0 * T], axis=1),
    "spiral": np.stack([T * np.cos(T), T * np.sin(T), T], axis=1),
}
SOLIDS = {
    "ball": sphere(600) * RNG.uniform(size=(600, 1)) ** (1 / 3),
    "cube": RNG.uniform(size=(600, 3)),
    "noise": normal(600),
    "grid": np.stack(np.meshgrid(*[np.arange(9.0)] * 3), axis=-1).reshape(-1, 3)
    + 1e-9 * normal(729),
    "ellipsoid": normal(600) * [1, 2, 3],
}
SURFACES = {
    "sphere": sphere(600),
    "noisy sphere": sphere(2000) + 0.05 * normal(2000),
    "plane": np.stack([*RNG.uniform(size=(2, 600)), np.zeros(600)], axis=1),
    "grid": np.stack([*np.meshgrid(np.arange(25.0), np.arange(25.0)), np.zeros((25, 25))], -1),
    "strip": np.stack(
        [30 * RNG.uniform(size=3000), RNG.uniform(size=3000), np.zeros(3000)], axis=1
    ),
    "tube": np.stack([30 * RNG.uniform(size=3000), *sphere(3000)[:, :2].T], axis=1),
    "lines of a scan": np.stack(
        [*np.meshgrid(np.arange(200.0), 9 * np.arange(30.0)), np.zeros((30, 200))], -1
    ),
}


@pytest.mark.parametrize("name", CURVES)
def test_a_curve_is_refused(name: str) -> None:
    """In one line."""
    with pytest.raises(InputError, match="lie along a curve"):
        ComputedMap().fit(CURVES[name])


@pytest.mark.parametrize("name", SOLIDS)
def test_a_solid_is_said(name: str, caplog: pytest.LogCaptureFixture) -> None:
    """A map of some surface through it comes with a warning, and the report has the fact."""
    with caplog.at_level(logging.WARNING):
        model = ComputedMap(points=120).fit(SOLIDS[name])
    assert "the points fill space" in caplog.text
    assert model.report_["fills_space"] is True


@pytest.mark.parametrize("name", SURFACES)
def test_of_surfaces_nothing_is_said(name: str) -> None:
    """Their dimension is near 2 at some scale; noise and the spacing hide it at others."""
    found = dimensions(SURFACES[name].reshape(-1, 3))
    assert ((found > 1.5) & (found < 2.4)).any()


def test_the_dimension_is_that_of_known_sets() -> None:
    """1, 2 and 3, but for the rims."""
    assert_allclose(dimensions(CURVES["circle"]), 1, atol=0.1)
    assert_allclose(dimensions(SURFACES["sphere"]), 2, atol=0.15)
    assert_allclose(dimensions(np.random.default_rng(2).uniform(size=(20_000, 3)))[:3], 3, atol=0.3)
    assert len(dimensions(normal(99))) == 0


@pytest.mark.parametrize("exponent", [-1060, -660, -530, -300, 300, 512, 660, 1020])
def test_a_map_scales_with_its_cloud(exponent: int) -> None:
    """By powers of two the same map, bit for bit; near the ends of float64 as nearly as it can."""
    dome = sphere(400)
    dome[:, 2] = np.abs(dome[:, 2])
    dome = np.round(dome, 3)  # few bits: the smallest numbers have no more
    scale = 2.0**exponent
    model = ComputedMap(points=300).fit(scale * dome)
    expected = ComputedMap(points=300).fit(dome).transform(dome)
    assert_allclose(model.transform(scale * dome) / scale, expected, rtol=1e-3, atol=1e-2)
    if exponent > -1000:
        assert_array_equal(model.transform(scale * dome) / scale, expected)


@pytest.mark.parametrize("exponent", [-660, 660])
def test_a_map_scales_with_its_mesh(exponent: int) -> None:
    """Points of its faces too, which areas decide."""
    mesh, scale = irregular_disk(), 2.0**exponent
    scaled = Mesh(mesh.vertices * scale, mesh.faces)
    expected = ComputedMap(points=300).parameterize(mesh, seed=0)
    found = ComputedMap(points=300).parameterize(scaled, seed=0)
    assert_array_equal(found.uv / scale, expected.uv)


def test_what_no_number_can_say_is_one_line() -> None:
    """Points at both ends of float64, whose distance is beyond it."""
    with pytest.raises(InputError, match="farther apart than a number can say"):
        ComputedMap().fit(1.7e308 * sphere(200))


@pytest.mark.parametrize("size", ["1e-320", "1e-200", "1e-90", "1e90", "1e200", "1.7e308"])
def test_a_mesh_whose_areas_no_number_can_say_is_one_line(size: str, tmp_path: Path) -> None:
    """Every command reads it by the same function."""
    path = tmp_path / "mesh.off"
    path.write_text(f"OFF\n3 1 0\n-{size} 0 0\n{size} 0 0\n0 {size} 0\n3 0 1 2\n")
    with pytest.raises(InputError, match=r"mesh\.off: its size is .* scale it to between"):
        read_surface(path)
