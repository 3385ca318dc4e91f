"""Charts are packed at one scale, none mirrored, none on another, and near to xatlas's density."""

import numpy as np
import pytest
import xatlas
from scipy.spatial import cKDTree

from parapoint.surfaces.parameterization import Charted, Parameterization
from parapoint.surfaces.surface import Mesh
from parapoint.textures import packing
from parapoint.textures.packing import packed

CHARTS = 30


def doubled_areas(uv, corners) -> np.ndarray:
    a, b, c = (uv[corners[:, k]] for k in range(3))
    return (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]


def flags(count: int = CHARTS) -> Charted:
    """Flags of two triangles of many sizes, all on the same place of the plane."""
    rng = np.random.default_rng(0)
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    uv = [square * rng.uniform(0.1, 2, 2) + rng.normal(size=2) for _ in range(count)]
    corners = np.concatenate([np.array([[0, 1, 2], [0, 2, 3]]) + 4 * k for k in range(count)])
    uv = np.concatenate(uv)
    return Charted(
        Mesh(np.column_stack([uv, 0 * uv[:, 0]]), corners), Parameterization(uv, corners)
    )


@pytest.mark.parametrize("border", [1 / 256, 1 / 64])
def test_charts_lie_apart_at_one_scale(border) -> None:
    given = flags()
    made = packed(given, border)
    uv = made.map.uv
    ratio = doubled_areas(uv, made.map.corners) / doubled_areas(given.map.uv, given.map.corners)
    assert ratio.min() == pytest.approx(ratio.max(), rel=1e-9)
    assert ratio.min() > 0
    assert uv.min() == pytest.approx(border, abs=1e-9)
    assert uv.max() == pytest.approx(1 - border, abs=1e-9)
    # Points along the sides of each flag are as far from those of others.
    steps = np.linspace(0, 1, 200)[:, None]
    sides = [
        np.concatenate(
            [a + steps * (b - a) for a, b in zip(ring, np.roll(ring, 1, 0), strict=True)]
        )
        for ring in uv.reshape(CHARTS, 4, 2)
    ]
    for k, points in enumerate(sides):
        others = cKDTree(np.concatenate(sides[:k] + sides[k + 1 :]))
        assert others.query(points)[0].min() > 0.9 * border
    filled = np.abs(doubled_areas(uv, made.map.corners)).sum() / 2
    assert filled > (0.8 * xatlas_fill(given) if border < 0.01 else 0.4)


def xatlas_fill(given: Charted) -> float:
    """Share of its square that xatlas fills with the charts by default, at a like distance."""
    atlas = xatlas.Atlas()
    uv, corners = given.map.uv.astype(np.float32), given.map.corners.astype(np.uint32)
    atlas.add_uv_mesh(uv, corners)
    options = xatlas.PackOptions()
    options.padding = 4
    atlas.generate(xatlas.ChartOptions(), options)
    own = atlas[0][2] * [atlas.width, atlas.height]
    assert len(own) == len(uv)
    return np.abs(doubled_areas(own, corners)).sum() / 2 / max(atlas.width, atlas.height) ** 2


@pytest.mark.parametrize("count", [12, 40])
def test_charts_far_apart_are_packed_as_densely(count) -> None:
    given = flags(count)
    steps = np.arange(4 * count) // 4
    uv = given.map.uv + np.outer(1000 * steps, [1, -1])
    made = packed(Charted(given.mesh, Parameterization(uv, given.map.corners)))
    filled = np.abs(doubled_areas(made.map.uv, made.map.corners)).sum() / 2
    assert filled > 0.8 * xatlas_fill(given)


def test_a_chart_alone_is_turned_to_its_smallest_square() -> None:
    turn = np.array([[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]])
    uv = np.array([[0, 0], [3, 0], [3, 3], [0, 3]]) @ turn
    mesh = Mesh(np.column_stack([uv, 0 * uv[:, 0]]), [[0, 1, 2], [0, 2, 3]])
    made = packed(Charted(mesh, Parameterization(uv, mesh.faces)), 0.1)
    assert np.abs(doubled_areas(made.map.uv, made.map.corners)).sum() / 2 > 0.63


def test_a_chart_without_area_is_moved_as_it_is() -> None:
    given = flags(3)
    uv = given.map.uv.copy()
    uv[8:] = uv[8]
    made = packed(Charted(given.mesh, Parameterization(uv, given.map.corners)))
    assert np.isfinite(made.map.uv).all()
    assert np.ptp(made.map.uv[8:], axis=0).max() < 1e-9


@pytest.mark.parametrize("unit", [2.0**-20, 2.0**20])
def test_the_unit_and_the_place_of_a_map_make_no_difference(unit) -> None:
    given = flags(6)
    known = packed(given).map.uv
    moved = Parameterization(unit * (given.map.uv + 8), given.map.corners)
    np.testing.assert_allclose(packed(Charted(given.mesh, moved)).map.uv, known, atol=1e-4)


def gap_between_charts(held: Parameterization) -> float:
    """The least distance of corners of two charts."""
    rows = np.unique(held.corners)
    chart = np.empty(len(held.uv), dtype=int)
    chart[held.corners] = held.charts()[:, None]
    distance, near = cKDTree(held.uv[rows]).query(held.uv[rows], k=min(40, len(rows)))
    is_other = chart[rows][near] != chart[rows][:, None]
    return np.where(is_other, distance, np.inf).min()


def filled(held: Parameterization) -> float:
    return np.abs(doubled_areas(held.uv, held.corners)).sum() / 2


def flat(uv, corners) -> Charted:
    """A flat mesh, and itself as its map."""
    uv = np.asarray(uv, dtype=float)
    return Charted(
        Mesh(np.column_stack([uv, 0 * uv[:, 0]]), corners), Parameterization(uv, corners)
    )


@pytest.mark.parametrize("spread", [1.0, 1.5, 3.0])
def test_charts_of_very_different_sizes_keep_their_scale_and_distance(spread) -> None:
    rng = np.random.default_rng(0)
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    sizes = np.exp(spread * rng.normal(size=400))
    uv = np.concatenate([size * square for size in sizes])
    corners = np.concatenate([np.array([[0, 1, 2], [0, 2, 3]]) + 4 * k for k in range(400)])
    given = flat(uv, corners)
    made = packed(given).map
    ratio = doubled_areas(made.uv, corners) / doubled_areas(uv, corners)
    assert ratio.max() == pytest.approx(ratio.min(), rel=1e-6)
    assert filled(made) > 0.6
    assert gap_between_charts(made) > 0.75 / 256


def test_many_like_charts_fill_the_square_as_if_set_in_rows() -> None:
    """400 squares, each turned: 20 a row, each with a room of 1/256 of the whole."""
    rng = np.random.default_rng(0)
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    angles = rng.uniform(0, 2 * np.pi, 400)
    uv = np.concatenate(
        [square @ [[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]] for a in angles]
    )
    corners = np.concatenate([np.array([[0, 1, 2], [0, 2, 3]]) + 4 * k for k in range(400)])
    made = packed(flat(uv, corners)).map
    # 20 sides and 21 rooms make the square; the shelves may need one more row or column.
    least, most = (((1 - (n + 1) / 256) / n) ** 2 * 400 for n in (21, 20))
    assert least - 0.01 < filled(made) < most + 0.01
    assert gap_between_charts(made) > 0.9 / 256


@pytest.mark.parametrize("resolution", [512, 724, 1024])
def test_the_layout_that_fills_the_square_best_counts(monkeypatch, resolution) -> None:
    """Whichever grid it comes from: xatlas's layouts are in texels of theirs."""
    real = packing._packed

    def spoilt(held, border, grid):
        uv = real(held, border, grid)
        if grid != resolution:
            uv = uv + grid * (np.arange(len(uv)) // 4 == 0)[:, None]  # one chart far away
        return uv

    best = [real(flags().map, 1 / 256, resolution)]
    monkeypatch.setattr(packing, "_packed", spoilt)
    made = packed(flags()).map
    sides = np.linalg.norm(made.uv[1::4] - made.uv[::4], axis=1)
    alone = np.linalg.norm(best[0][1::4] - best[0][::4], axis=1)
    places = (made.uv - made.uv.mean(axis=0)) / sides[0]
    expected = (best[0] - best[0].mean(axis=0)) / alone[0]
    assert np.linalg.norm(places, axis=1) == pytest.approx(np.linalg.norm(expected, axis=1))


def test_a_corner_of_flat_faces_alone_stays_at_its_chart() -> None:
    # The third triangle of each flag hangs, without area, at its lower side.
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0]])
    uv = np.concatenate([square * size for size in (1, 2, 3, 4, 5)])
    one = np.array([[0, 1, 2], [0, 2, 3], [0, 4, 1]])
    made = packed(flat(uv, np.concatenate([one + 5 * k for k in range(5)]))).map
    for ring in made.uv.reshape(5, 5, 2):
        np.testing.assert_allclose(ring[4], (ring[0] + ring[1]) / 2, atol=1e-9)
    assert gap_between_charts(made) > 0.9 / 256
    assert filled(made) > 0.4


def test_a_chart_that_flat_faces_hold_together_stays_whole() -> None:
    # Two squares above one another, joined by two triangles that lie on one line.
    two = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [1, 3], [2, 3], [2, 4], [1, 4]])
    faces = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7], [1, 2, 4], [2, 4, 7]])
    count = 6
    uv = np.concatenate([two * (1 + k / 4) for k in range(count)])
    made = packed(flat(uv, np.concatenate([faces + 8 * k for k in range(count)]))).map
    for ring in made.uv.reshape(count, 8, 2):
        up = ring[2] - ring[1]
        np.testing.assert_allclose(ring[[4, 7]], ring[1] + np.outer([3, 4], up), atol=1e-9)
    assert gap_between_charts(made) > 0.9 / 256
    assert filled(made) > 0.15


def test_charts_that_touch_at_a_place_come_apart() -> None:
    corners = [[0, 1, 2], [2, 3, 4]]
    uv = [[0, 0], [1, 0], [1, 1], [2, 1], [2, 2]]
    made = packed(flat(uv, corners)).map
    areas = doubled_areas(made.uv, made.corners)
    assert areas[0] == pytest.approx(areas[1], rel=1e-9)
    assert areas[0] > 0.3
    assert made.corners[0, 2] != made.corners[1, 0]
    assert gap_between_charts(made) > 0.9 / 256
