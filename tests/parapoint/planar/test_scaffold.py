"""Descents of a map that stays one to one, also from one whose boundary touches itself."""

from collections.abc import Iterator

import igl
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from benchmarks.cases import builtin
from parapoint.planar import scaffold
from parapoint.planar.bijection import embedded, is_bijective
from parapoint.planar.scaffold import (
    cut_opened,
    descended,
    energy_densities,
    excess,
    moved_apart,
    of_area_one,
)
from parapoint.surfaces.areas import signed_areas
from parapoint.surfaces.cutting import cut_along, origin
from parapoint.surfaces.surface import Mesh


def slit() -> tuple[Mesh, np.ndarray]:
    """A flat disk cut along a radius, and its map, whose two sides of the cut touch."""
    points, faces = builtin.disk_points(4)
    mesh = Mesh(np.column_stack([points, 0 * points[:, 0]]), faces)
    first = [0, *(1 + 3 * k * (k - 1) for k in range(1, 5))]
    cut = cut_along(mesh, np.stack([first[:-1], first[1:]], axis=1))
    return cut, cut.vertices[:, :2]


def test_energies_of_a_map_by_its_singular_values() -> None:
    mesh = Mesh(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]]), [[0, 1, 2]])
    uv = np.array([[0, 0], [2.0, 0], [0, 3.0]])
    dirichlet = (4 + 1 / 4 + 9 + 1 / 9) / 4
    assert_allclose(energy_densities(mesh, uv, igl.SYMMETRIC_DIRICHLET), [dirichlet])
    assert_allclose(energy_densities(mesh, uv, igl.CONFORMAL), [(2 / 3 + 3 / 2) / 2])
    with pytest.raises(ValueError, match="no formula"):
        energy_densities(mesh, uv, igl.ARAP)


def test_the_sides_of_a_cut_move_apart_and_nothing_else_moves() -> None:
    mesh, uv = slit()
    _, place, copies = np.unique(uv, axis=0, return_inverse=True, return_counts=True)
    twice = copies[place.reshape(-1)] > 1
    moved = moved_apart(mesh, uv, twice)
    assert twice.sum() == 8  # four vertices of the radius; the centre is its tip
    assert_array_equal(moved[~twice], uv[~twice])
    assert (signed_areas(moved, mesh.faces) > 0).all()
    assert is_bijective(mesh, moved)
    # Inner vertices of a straight cut along x move straight up and down, by equal shares.
    inner = twice & (np.linalg.norm(uv, axis=1) < 0.99)
    step = (moved - uv)[inner]
    assert_allclose(step[:, 0], 0, atol=1e-12)
    assert (np.sign(step[:, 1]) == [1, 1, 1, -1, -1, -1]).sum() in {0, 6} or sorted(
        np.sign(step[:, 1])
    ) == [-1, -1, -1, 1, 1, 1]
    corners = uv[mesh.faces]
    sides = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    heights = 2 * signed_areas(uv, mesh.faces) / sides.max(axis=1)
    assert np.abs(step[:, 1]).max() <= 0.3 * heights.max() + 1e-12
    assert np.abs(step[:, 1]).min() >= 0.3 * heights.min() - 1e-12


def test_a_cut_opens_where_that_lowers_the_energy() -> None:
    cap = builtin.sphere_cap(150, rings=8)
    mesh = of_area_one(cap.vertices, cap.faces)
    points, _ = builtin.disk_points(8)
    uv = descended(mesh, points / np.sqrt(np.pi), igl.SYMMETRIC_DIRICHLET)
    first = [0, *(1 + 3 * k * (k - 1) for k in range(1, 9))][4:]
    cut = cut_along(mesh, np.stack([first[:-1], first[1:]], axis=1))
    opened = cut_opened(cut, uv[origin(mesh, cut)], igl.SYMMETRIC_DIRICHLET)
    assert is_bijective(cut, opened)
    before = excess(mesh, uv, igl.SYMMETRIC_DIRICHLET)
    assert excess(cut, opened, igl.SYMMETRIC_DIRICHLET) < 0.9 * before


@pytest.mark.parametrize(("last", "steps"), [(0.495, 3), (0.48, 5)])
def test_a_descent_ends_once_a_step_gains_little(monkeypatch, last: float, steps: int) -> None:
    """The excess is halved, and then falls by a hundredth or by four; two are little."""
    mesh, uv = slit()
    falls = iter([1.0, 0.5, last, 0.2, 0.1])

    def down(*_: object) -> Iterator[np.ndarray]:
        for k in range(1, 6):
            yield uv + k

    monkeypatch.setattr(scaffold, "steps_down", down)
    monkeypatch.setattr(scaffold, "excess", lambda *_: next(falls))
    assert_array_equal(descended(mesh, uv, igl.CONFORMAL), uv + steps)


@pytest.mark.parametrize(("fall", "steps"), [(0.0005, 20), (0.002, 30)])
def test_a_cut_has_twenty_steps_to_open_before_they_must_gain(monkeypatch, fall, steps) -> None:
    """The excess of 1 falls by so much a step: in twenty steps by a hundredth, or by four."""
    mesh, uv = slit()
    falls = iter(1 - fall * np.arange(31))

    def down(*_: object) -> Iterator[np.ndarray]:
        for k in range(1, 31):
            yield uv + k

    monkeypatch.setattr(scaffold, "steps_down", down)
    monkeypatch.setattr(scaffold, "excess", lambda *_: next(falls))
    assert_array_equal(cut_opened(mesh, uv, igl.CONFORMAL), uv + steps)


@pytest.mark.parametrize("degrees", [0, 30, 45, 120])
def test_a_long_map_is_not_held_up_by_what_is_around_it(degrees: float) -> None:
    columns = 100
    x = np.arange(columns + 1.0)
    vertices = np.concatenate([np.stack([x, y + 0 * x, 0 * x], 1) for y in (0, 1)])
    strip = of_area_one(vertices, builtin.grid_faces(2, columns + 1))
    _, disk = embedded(strip)
    angle = np.radians(degrees)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    uv = descended(strip, disk @ turn, igl.SYMMETRIC_DIRICHLET)
    assert is_bijective(strip, uv)
    assert excess(strip, uv, igl.SYMMETRIC_DIRICHLET) < 1e-4
