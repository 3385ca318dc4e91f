"""What works in single precision maps a similar surface alike, wherever it lies, in any unit."""

import numpy as np
import pytest

from baselines import registry
from parapoint.method import MissingError
from parapoint.planar.domains import FlatteningError
from parapoint.surfaces.frame import UNIT, in_unit
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import Mesh
from parapoint.testing import sphere

SIMILARITIES = [(5e5, 1.0), (6e6, 1.0), (0.0, 1e-6), (0.0, 1e6), (-7e5, 1e-3)]
"""Shifts, in sizes of the surface, and scales."""


@pytest.mark.parametrize("name", ["xatlas", "uvunwrap", "meshlab_triangles"])
def test_place_and_unit_make_no_difference(name: str) -> None:
    """The same charts, and the same map up to rounding of the positions."""
    mesh = sphere()
    _, method = registry.method(name)
    try:
        known = method.parameterize(mesh, seed=0)
    except (MissingError, FlatteningError) as error:
        pytest.skip(str(error))
    assert isinstance(known, Parameterization)
    for shift, scale in SIMILARITIES:
        moved = Mesh(scale * (mesh.vertices + 2 * shift), mesh.faces)
        found = method.parameterize(moved, seed=0)
        assert isinstance(found, Parameterization)
        assert found.charts().max() == known.charts().max()


def test_a_unit_for_float32() -> None:
    """Centred, and as large as said."""
    points = np.array([[5e5, 5e6, 0], [5e5 + 2, 5e6, 0], [5e5, 5e6 + 1, 0]])
    inside = in_unit(points, np.array([[0, 1, 2]]))
    assert np.linalg.norm(inside, axis=1).max() == pytest.approx(UNIT)


@pytest.mark.parametrize(
    ("name", "option", "value", "power"),
    [
        ("xatlas", "max_chart_area", 0.5, 2),
        ("xatlas", "max_boundary_length", 3.0, 1),
        ("xatlas", "texels_per_unit", 30.0, -1),
        ("uvunwrap", "max_chart_area", 0.5, 2),
        ("uvunwrap", "max_boundary_length", 3.0, 1),
    ],
)
def test_options_that_are_lengths_are_in_the_unit_of_the_surface(
    name: str, option: str, value: float, power: int
) -> None:
    """On a surface a thousand times as large they make the same charts, so many times as large."""
    pytest.importorskip(name)
    mesh, found = sphere(), []
    for unit in (1.0, 1024.0):
        _, method = registry.method(f"{name}({option}={value * unit**power})")
        result = method.parameterize(Mesh(unit * mesh.vertices, mesh.faces), seed=0)
        assert isinstance(result, Parameterization)
        charts = result.charts()
        found.append([charts.max(), *np.ptp(result.uv, axis=0)])
        if option == "max_chart_area":
            areas = np.bincount(charts, unit**2 * mesh.face_areas)
            assert 0.8 * value * unit**2 < areas.max() <= value * unit**2
    assert found[1] == pytest.approx(found[0], rel=1e-2)
