import igl
import numpy as np
import pytest

from benchmarks.metrics.evaluation import evaluate
from parapoint import clock
from parapoint.computed.layout import scaled_layout
from parapoint.computed.scale import even_scale
from parapoint.planar import bijection
from parapoint.planar.bijection import (
    BijectionError,
    bijective_map,
    is_bijective,
    signed_areas,
)
from parapoint.planar.embedding import embedded_in_disk
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import Mesh


def grid(columns: int, rows: int) -> np.ndarray:
    """(F, 3) faces of a grid of vertices, row by row."""
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    sides = [0, 1, columns + 1], [0, columns + 1, columns]
    return np.concatenate([corner[:, None] + np.array(side) for side in sides])


def ramp() -> Mesh:
    """One and a half turns of a low spiral ramp: flattened it covers half of itself twice."""
    turn, radius = np.meshgrid(np.linspace(0, 3 * np.pi, 60), np.linspace(1, 2, 8))
    turn, radius = turn.ravel(), radius.ravel()
    points = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), 0.02 * turn])
    return Mesh(points, grid(60, 8)[:, ::-1])


def ring() -> Mesh:
    """A flat square with a square hole."""
    x, y = np.meshgrid(np.arange(13.0), np.arange(13.0))
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(169)])
    faces = grid(13, 13)
    hole = (np.abs(points[faces].mean(axis=1)[:, :2] - 6) < 2).all(axis=1)
    return Mesh(*igl.remove_unreferenced(points, faces[~hole])[:2])


def score(mesh: Mesh, uv: np.ndarray) -> dict[str, float]:
    return evaluate(mesh, Parameterization(uv, mesh.faces))


def test_a_surface_that_would_cover_itself_does_not() -> None:
    mesh = ramp()
    loop = mesh.boundary_loops[0]
    pins = loop[[0, len(loop) // 2]]
    linear = igl.lscm(mesh.vertices, mesh.faces, pins, np.array([[0.0, 0.0], [1.0, 0.0]]))[0]
    assert score(mesh, linear)["overlap_area"] > 0.1
    found = score(mesh, bijective_map(mesh, linear))
    start = score(mesh, embedded_in_disk(mesh))
    assert found["bijective"] == 1
    assert found["angle_difference_mean"] < start["angle_difference_mean"] / 3


def pin(radius: float) -> Mesh:
    """A disk of radius 1 with a tube on a hole of its middle, as tall as wide, with a tip."""
    rings, along, around = 20, 10, 16
    radii = np.append(np.geomspace(1, radius, rings), np.full(along, radius))
    height = np.append(np.zeros(rings), np.linspace(0, radius, along + 1)[1:])
    turn = 2 * np.pi * np.arange(around) / around
    x, y = (np.outer(radii, of(turn)).ravel() for of in (np.cos, np.sin))
    tip = [[0.0, 0.0, 1.3 * radius]]
    points = np.concatenate([np.column_stack([x, y, np.repeat(height, around)]), tip])
    corner = np.arange(len(points) - 1 - around)
    beside = np.where(corner % around == around - 1, corner + 1 - around, corner + 1)
    last, top = np.arange(around) + len(corner), np.full(around, len(points) - 1)
    faces = [
        np.stack([corner, beside, beside + around], axis=1),
        np.stack([corner, beside + around, corner + around], axis=1),
        np.stack([last, np.roll(last, -1), top], axis=1),
    ]
    return Mesh(points, np.concatenate(faces))


def test_small_parts_are_mapped_as_well_as_large_ones() -> None:
    # libigl's line search turned over the faces of the smaller tube, and the descent ended there.
    angles = [
        score(mesh, bijective_map(mesh, None))["angle_difference_mean"]
        for mesh in (pin(1e-3), pin(1e-5))
    ]
    assert angles[1] == pytest.approx(angles[0], rel=0.05)


def test_a_map_that_is_held_up_sets_out_again(monkeypatch) -> None:
    mesh = ramp()
    layout = scaled_layout(mesh, even_scale(mesh))
    free = score(mesh, bijective_map(mesh, layout))
    descended, energies = bijection.descended, []

    def held_up_once(of, uv, energy, *rest):
        energies.append(energy)
        return uv if len(energies) == 1 else descended(of, uv, energy, *rest)

    monkeypatch.setattr(bijection, "descended", held_up_once)
    held_up = score(mesh, bijective_map(mesh, layout))
    isometric, conformal = igl.SYMMETRIC_DIRICHLET, igl.CONFORMAL
    assert energies == [isometric, conformal, isometric, conformal]
    for name in ("angle_difference_mean", "area_discrepancy_total"):
        assert held_up[name] == pytest.approx(free[name], abs=0.01)


def test_a_hole_stays_open_and_a_flat_surface_as_it_is() -> None:
    mesh = ring()
    assert len(mesh.boundary_loops) == 2
    found = score(mesh, bijective_map(mesh, mesh.vertices[:, :2]))
    assert found["bijective"] == 1
    assert found["angle_difference_max"] < 1e-4
    assert found["area_discrepancy_total"] < 1e-4


def test_of_the_conformal_maps_it_finds_one_near_the_layout() -> None:
    mesh = ring()
    images = mesh.vertices[:, 0] + 1j * mesh.vertices[:, 1]
    images = np.exp(images / 8)  # conformal, of scales 1 to 4.5
    layout = np.stack([images.real, images.imag], axis=1)
    found = bijective_map(mesh, layout)
    area, wanted = (np.abs(signed_areas(of, mesh.faces)) for of in (found, layout))
    assert np.abs(area / area.sum() / (wanted / wanted.sum()) - 1).max() < 0.2


def test_a_layout_of_flat_triangles_is_no_guide() -> None:
    mesh = ring()
    found = score(mesh, bijective_map(mesh, np.zeros((len(mesh.vertices), 2))))
    assert found["bijective"] == 1
    assert found["angle_difference_max"] < 0.05


def test_a_crossing_or_turned_map_is_not_bijective() -> None:
    mesh = ramp()
    loop = mesh.boundary_loops[0]
    pins = loop[[0, len(loop) // 2]]
    covering = igl.lscm(mesh.vertices, mesh.faces, pins, np.array([[0.0, 0.0], [1.0, 0.0]]))[0]
    assert (signed_areas(covering, mesh.faces) > 0).all()
    assert not is_bijective(mesh, covering)
    assert is_bijective(mesh, embedded_in_disk(mesh))
    assert not is_bijective(mesh, embedded_in_disk(mesh)[:, ::-1])


def test_a_face_without_area_is_refused() -> None:
    points = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [1, 1, 0]])
    with pytest.raises(BijectionError, match="no area"):
        bijective_map(Mesh(points, np.array([[0, 1, 2], [0, 2, 3]])), points[:, :2])


def test_the_descents_end_with_the_time_and_leave_what_they_have(monkeypatch) -> None:
    mesh = ramp()
    whole = bijective_map(mesh, None)
    steps = iter(range(1000))
    monkeypatch.setattr(clock, "worked", lambda: float(next(steps)))
    some = bijective_map(
        mesh, None, deadline=4.5
    )  # five steps of the first descent, none of the others
    assert score(mesh, some)["bijective"] == 1
    start, end = (
        score(mesh, uv)["angle_difference_mean"] for uv in (embedded_in_disk(mesh), whole)
    )
    assert end < score(mesh, some)["angle_difference_mean"] < start
    none = bijective_map(mesh, None, deadline=0.0)
    size = np.sqrt(
        mesh.face_areas.sum() / igl.doublearea(embedded_in_disk(mesh), mesh.faces).sum() * 2
    )
    np.testing.assert_allclose(none, size * embedded_in_disk(mesh))


def test_a_map_is_at_the_layout_when_it_is_that_and_not_merely_near(monkeypatch) -> None:
    # Of a flat square the layout is the square itself. The first descent is held up at Tutte's
    # embedding, a disk whose energy exceeds the square's by less than 10 times the least: that is
    # near, not there, so the map sets out again and comes to the square.
    x, y = np.meshgrid(np.linspace(0, 1, 9), np.linspace(0, 1, 9))
    mesh = Mesh(np.column_stack([x.ravel(), y.ravel(), np.zeros(81)]), grid(9, 9))
    start = embedded_in_disk(mesh) / np.sqrt(np.pi)
    assert 0.1 < bijection.excess(mesh, start, igl.SYMMETRIC_DIRICHLET) < 10
    descended, calls = bijection.descended, []

    def held_up_once(of, uv, *rest):
        calls.append(uv)
        return uv if len(calls) == 1 else descended(of, uv, *rest)

    monkeypatch.setattr(bijection, "descended", held_up_once)
    led = bijection._led(mesh, mesh, start, np.inf)
    i, j = mesh.edges.T
    lengths = [np.linalg.norm(of[i] - of[j], axis=1) for of in (mesh.vertices, led)]
    np.testing.assert_allclose(lengths[1], lengths[0], rtol=0.02)


@pytest.mark.parametrize(
    ("turn", "growth", "is_apart"),
    [
        (300, 0.0, True),  # the ends of the strip are 60 degrees apart
        (420, 0.0, False),  # the last 60 degrees cover the first ones
        (420, 0.05, False),  # a turn later it has moved out by 0.3: less than its width
        (420, 0.15, True),  # by 0.9: more than that
    ],
)
def test_a_strip_of_width_a_half_that_winds_around_a_circle(
    turn: float, growth: float, is_apart: bool
) -> None:
    angle = np.radians(np.linspace(0, turn, 31))
    for start in (0.0, 1.0, 2.0, 3.0):
        unit = np.column_stack([np.cos(angle + start), np.sin(angle + start)])
        radii = 1 + growth * angle[:, None], 1.5 + growth * angle[:, None]
        uv = np.concatenate([radius * unit for radius in radii])
        mesh = Mesh(np.pad(uv, ((0, 0), (0, 1))), grid(31, 2)[:, ::-1])
        assert (signed_areas(uv, mesh.faces) > 0).all()
        assert is_bijective(mesh, uv) == is_apart


def test_the_two_long_sides_of_a_slanted_strip_do_not_cross() -> None:
    # Their boxes overlap, but all of one is to the left of the other.
    uv = np.array([[0.2, 0.05], [1.3, 1.15], [1.0, 1.0], [0.0, 0.0]])
    mesh = Mesh(np.pad(uv, ((0, 0), (0, 1))), [[0, 1, 2], [0, 2, 3]])
    assert (signed_areas(uv, mesh.faces) > 0).all()
    assert is_bijective(mesh, uv)
