"""Surfaces that unroll without distortion, and those that do not."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from benchmarks.cases import builtin
from parapoint.planar.bijection import is_bijective
from parapoint.planar.descent import UNROLLED, Run, sound
from parapoint.planar.unrolling import conformal_layout
from parapoint.surfaces.cutting import edge_lengths
from parapoint.surfaces.surface import Mesh


def band(*rims: np.ndarray) -> Mesh:
    """Triangles between lines of points (n, 3) that run beside one another."""
    return Mesh(np.concatenate(rims), builtin.grid_faces(len(rims), len(rims[0])))


def straight(length: float) -> Mesh:
    x = np.linspace(0, length, 101)
    return band(*(np.stack([x, y + 0 * x, 0 * x], 1) for y in (0, 1)))


def bent(turns: float, rise: float) -> Mesh:
    """A ribbon that runs around a cylinder, `rise` of its widths higher with each turn."""
    angle = np.linspace(0, 2 * np.pi * turns, 301)
    x, y = 20 * np.cos(angle), 20 * np.sin(angle)
    height = rise * angle / (2 * np.pi)
    return band(*(np.stack([x, y, height + up], 1) for up in (0, 1)))


def winding(turns: float, growth: float) -> Mesh:
    """A flat ribbon around a point, `growth` of its widths farther out with each turn."""
    angle = np.linspace(0, 2 * np.pi * turns, 301)
    radius = 5 + growth * angle / (2 * np.pi)
    way = np.stack([np.cos(angle), np.sin(angle), 0 * angle], 1)
    return band(*((radius + out)[:, None] * way for out in (1, 0)))


def ring() -> Mesh:
    mesh = winding(1, 0)
    is_last = mesh.faces % 301 == 300
    return sound(Mesh(mesh.vertices, np.where(is_last, mesh.faces - 300, mesh.faces)))


SURFACES = {
    "strip": straight(100),
    "thin strip": straight(10_000),
    "arch": bent(0.8, 0),
    "coil": bent(3, 2),
    "spiral": winding(4, 2),
    "ring": ring(),
    "half a pipe": builtin.half_cylinder(),
    "roll": builtin.swiss_roll(),
}


@pytest.mark.parametrize("name", SURFACES)
def test_a_surface_unrolls_to_its_own_lengths(name: str) -> None:
    mesh = SURFACES[name]
    flat = conformal_layout(mesh)
    assert flat is not None
    assert is_bijective(mesh, flat)
    assert Run(mesh).energy_of(flat) < UNROLLED
    laid = Mesh(np.pad(flat, ((0, 0), (0, 1))), mesh.faces)
    assert_allclose(edge_lengths(laid), edge_lengths(mesh), rtol=2e-3)


@pytest.mark.parametrize(
    "mesh",
    [
        builtin.sphere_cap(90),
        builtin.saddle(),
        builtin.cone(),  # its tip is inside
        winding(2, 0),  # it unrolls, but onto itself
    ],
    ids=["cap", "saddle", "cone", "two turns"],
)
def test_other_surfaces_do_not_unroll(mesh: Mesh) -> None:
    flat = conformal_layout(mesh)
    assert flat is None or Run(mesh).energy_of(flat) > UNROLLED


def test_a_run_begins_with_the_surface_unrolled() -> None:
    run = Run(SURFACES["coil"])
    run.begin()
    assert run.start == "unrolled"
    assert run.energy == pytest.approx(4, abs=1e-3)
    cap = Run(builtin.sphere_cap(90))
    cap.begin()
    assert cap.start == "embedded"
