"""Stray points: found at any distance, named by row, mapped nowhere; nothing else is."""

import logging
from collections.abc import Callable

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from scipy.spatial import cKDTree

from parapoint import ComputedMap, PointCloud
from parapoint.surfaces.strays import are_near, far_from, stray_points, unmapped
from parapoint.surfaces.surface import FloatArray


def dome(count: int = 1500) -> FloatArray:
    """Points of half a unit sphere."""
    points = np.random.default_rng(0).normal(size=(count, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    points[:, 2] = np.abs(points[:, 2])
    return points


def flying(count: int, radii: float) -> FloatArray:
    """Points in all directions, 0.3 to 1 times so many radii off."""
    rng = np.random.default_rng(1)
    points = rng.normal(size=(count, 3))
    length = radii * rng.uniform(0.3, 1, (count, 1))
    points *= length / np.linalg.norm(points, axis=1, keepdims=True)
    return points


@pytest.mark.parametrize("radii", [30, 500, 1e4, 1e6, 1e100])
@pytest.mark.parametrize("share", [0.0007, 0.01, 0.05])
def test_strays_at_any_distance(radii: float, share: float) -> None:
    """One to five of a hundred, and a single one, whatever the unit and the place."""
    strays = flying(round(1500 * share), radii)
    points = np.concatenate([dome(), strays])
    expected = np.arange(len(points)) >= 1500
    assert_array_equal(stray_points(points), expected)
    assert_array_equal(stray_points(1e-6 * points[::-1]), expected[::-1])


def test_rows_without_data_are_one_place() -> None:
    """A scanner's zeros, hundreds of times, far from its map coordinates."""
    points = np.concatenate([dome() + np.array([5e5, 5e6, 100]), np.zeros((150, 3))])
    assert_array_equal(stray_points(points), np.arange(1650) >= 1500)


@pytest.mark.parametrize("gap", [1, 12, 30])
def test_scan_lines_are_no_strays(gap: float) -> None:
    """Nor are components, repeated points, or few points."""
    x, y = np.meshgrid(np.arange(500.0), gap * np.arange(12.0))
    lines = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    assert not stray_points(lines).any()


def clump(count: int, *place: float) -> FloatArray:
    """Points close together around a place."""
    return np.random.default_rng(2).normal(scale=0.1, size=(count, 3)) + place


@pytest.mark.parametrize(
    "clumps",
    [
        [clump(60, 30, 0, 0)],
        [clump(30, 0, 30, 0)],  # two of a hundred
        [clump(25, *place) for place in [(30, 0, 0), (-30, 0, 0), (0, 40, 0), (0, 0, 500)]],
        [clump(70, 1e6, 1e6, 0)],
        [clump(5, 0, 0, -30), clump(60, 0, 0, 30)],
    ],
)
def test_clumps_of_strays(clumps: list[FloatArray]) -> None:
    """Up to five of a hundred points in one clump; in the last rows or the first."""
    points = np.concatenate([dome(), *clumps])
    expected = np.arange(len(points)) >= 1500
    assert_array_equal(stray_points(points), expected)
    assert_array_equal(stray_points(points[::-1]), expected[::-1])


def test_a_clump_is_told_and_mapped_nowhere(caplog: pytest.LogCaptureFixture) -> None:
    """As single strays are."""
    points = np.concatenate([dome(600), clump(20, 30, 0, 0)])
    with caplog.at_level(logging.WARNING):
        found = ComputedMap().parameterize(PointCloud(points), seed=0)
    assert "20 of 620 points lie far from all others" in caplog.text
    assert_array_equal(np.isnan(found.uv).all(axis=1), np.arange(620) >= 600)


def test_points_off_the_surface_that_was_found_are_named(caplog: pytest.LogCaptureFixture) -> None:
    """A clump too near to be stray is told by its rows of the file, and mapped nowhere."""
    points = np.concatenate([dome(600), clump(30, 5, 0, 0)])
    cloud = PointCloud(points, rows=np.arange(630) + 7)
    with caplog.at_level(logging.WARNING):
        found = ComputedMap().parameterize(cloud, seed=0)
    assert "30 of 630 points are not on the surface that was found: rows 607, 608," in caplog.text
    assert_array_equal(np.isnan(found.uv).all(axis=1), np.arange(630) >= 600)


@pytest.mark.parametrize("share", [0.12, 0.2, 0.3])
@pytest.mark.parametrize("radii", [100, 1e4, 1e6])
def test_many_strays(share: float, radii: float) -> None:
    """More than one of ten, as scanners of glass and water write; so are rows without data."""
    points = dome(4000)
    for strays in (flying(round(4000 * share), radii), np.full((round(4000 * share), 3), -radii)):
        both = np.concatenate([points, strays])
        assert_array_equal(stray_points(both), np.arange(len(both)) >= 4000)


@pytest.mark.parametrize("share", [0.02, 0.08, 0.2])
@pytest.mark.parametrize("away", [4, 8, 100])
def test_clouds_of_noise_are_strays_and_patches_are_none(share: float, away: float) -> None:
    """A blob spreads in all directions alike; the same number of points on a sphere does not."""
    points, count = dome(8000), round(8000 * share)
    middle = np.array([away, 0.0, 0.0])
    blob = np.random.default_rng(3).normal(scale=0.1, size=(count, 3)) + middle
    is_stray = stray_points(np.concatenate([points, blob]))
    assert_array_equal(is_stray, np.arange(8000 + count) >= 8000)
    patch = 0.3 * dome(count) + middle
    far = away > 10 and share < 0.05
    assert stray_points(np.concatenate([points, patch])).sum() == far * count


@pytest.mark.parametrize(("side", "expected"), [(4, 20), (5, 0)])
def test_of_many_points_a_group_of_a_two_hundredth_is_stray(side: int, expected: int) -> None:
    """A flat patch of 20 of 4,020 points is, one of 25 of 4,025 is a part."""
    x, y = np.meshgrid(np.arange(5.0), np.arange(side))
    patch = np.stack([8 + 0.05 * x.ravel(), 0.05 * y.ravel(), np.zeros(x.size)], axis=1)
    is_stray = stray_points(np.concatenate([dome(4000), patch]))
    assert is_stray.sum() == is_stray[4000:].sum() == expected


def test_what_hangs_together_at_the_corners_of_cells_is_one_group() -> None:
    """The sixth neighbour is three steps off, so a cell is 90 √3 wide: two hold 155 steps each.

    On either side of the middle five points are in a third cell, which is no more than a stray few.
    """
    assert not stray_points(np.arange(-316.0, 317)[:, None] * np.ones(3)).any()


def test_two_objects_of_equal_size_are_no_strays() -> None:
    """However far they are apart; nor is a small one close by."""
    for away in (10, 1e3, 1e6):
        assert not stray_points(np.concatenate([dome(), dome() + np.array([away, 0, 0])])).any()
    assert not stray_points(np.concatenate([dome(), 0.2 * dome(60) + np.array([8, 0, 0])])).any()


def test_components_and_small_clouds_are_no_strays() -> None:
    """A second dome far off; four points; one place."""
    assert not stray_points(np.concatenate([dome(), dome(400) + np.array([50, 0, 0])])).any()
    assert not stray_points(1e3 * np.eye(4)[:, :3]).any()
    assert not stray_points(np.ones((9, 3))).any()


@pytest.mark.parametrize("radii", [30, 1e3, 1e6, 1e200])
def test_a_fitted_model_maps_strays_nowhere(radii: float) -> None:
    """Those of other points than the fitted ones; points near the surface stay."""
    points = dome(800)
    model = ComputedMap(points=400).fit(points)
    near = 1.2 * points[400:]
    uv = model.transform(np.concatenate([near, flying(3, radii), points]))
    assert_array_equal(np.isnan(uv).all(axis=1), (np.arange(1203) >= 400) & (np.arange(1203) < 403))
    assert_array_equal(uv[403:], model.transform(points))
    assert not far_from(points, np.zeros((1, 3)))[0]
    assert not np.isnan(model.transform(points[:1])).any()


def test_a_map_is_as_without_its_strays(caplog: pytest.LogCaptureFixture) -> None:
    """They are counted, named by row, and NaN in the map."""
    points = dome(400)
    with caplog.at_level(logging.WARNING):
        found = ComputedMap().parameterize(
            PointCloud(np.concatenate([points, flying(2, 1e6)])), seed=0
        )
    assert "2 of 402 points lie far from all others" in caplog.text
    assert "rows 400, 401" in caplog.text
    assert found.report["strays"] == 2
    assert np.isnan(found.uv[400:]).all()
    alone = ComputedMap().parameterize(PointCloud(points), seed=0)
    assert_array_equal(found.uv[:400], alone.uv)


def box(count: int) -> FloatArray:
    """Points on the sides of a cube."""
    rng = np.random.default_rng(3)
    points = rng.uniform(-1, 1, (count, 3))
    points[np.arange(count), rng.integers(0, 3, count)] = rng.choice([-1, 1], count)
    return points


def tube(count: int) -> FloatArray:
    """Points of an open tube, three times as long as it is wide."""
    turn, z = np.random.default_rng(4).uniform([0, -3], [2 * np.pi, 3], (count, 2)).T
    return np.column_stack([np.cos(turn), np.sin(turn), z])


@pytest.mark.parametrize("surface", [dome, box, tube])
@pytest.mark.parametrize("repeated", [1, 200])
@pytest.mark.parametrize("unit", [1, 1e-4, 1e6])
def test_a_place_alone_is_a_stray(
    surface: Callable[[int], FloatArray], repeated: int, unit: float
) -> None:
    """A row without data inside of an object, nearer to it than thirty spacings."""
    for places in ([[0, 0, 0]], [[0, 0, 0], [1.7, 0, 0.2], [0, -1.9, 0.4], [-1.8, 0, 0.6]]):
        points = np.concatenate([surface(10_000), np.repeat(np.array(places, float), repeated, 0)])
        expected = np.arange(len(points)) >= 10_000
        assert_array_equal(stray_points(unit * points), expected)
        assert_array_equal(stray_points(unit * points[::-1]), expected[::-1])


@pytest.mark.parametrize("repeated", [1, 200])
def test_a_row_without_data_inside_a_small_scan(repeated: int) -> None:
    """A flat dome of 900 points, six of their spacings away."""
    points = np.concatenate([dome(900) * [1, 1.2, 0.7], np.zeros((repeated, 3))])
    assert_array_equal(stray_points(points), np.arange(len(points)) >= 900)


def thinned(points: FloatArray, share: FloatArray) -> FloatArray:
    """About this share (N,) of the points, drawn one by one."""
    return points[np.random.default_rng(5).random(len(points)) < share]


def rings(gap: float) -> FloatArray:
    """Rings of a dome so many spacings apart; its pole is a ring of one point."""
    slope = np.linspace(0, np.pi / 2, 15)
    count = np.maximum(1, 2 * np.pi * np.sin(slope) / slope[1] * gap).astype(int)
    turn = np.concatenate([np.arange(n) * 2 * np.pi / n for n in count])
    slope = np.repeat(slope, count)
    return np.column_stack(
        [np.sin(slope) * np.cos(turn), np.sin(slope) * np.sin(turn), np.cos(slope)]
    )


def in_a_box(points: FloatArray, share: float, seed: int = 1) -> FloatArray:
    """Noise all through a box a little larger than the points'."""
    low, high = points.min(axis=0), points.max(axis=0)
    at = np.random.default_rng(seed).random((round(share * len(points)), 3))
    return (low + high) / 2 + 1.1 * (at - 0.5) * (high - low)


@pytest.mark.parametrize("unit", [1e-6, 1e6])
@pytest.mark.parametrize(
    ("surface", "share"),
    [(dome, 0.005), (dome, 0.03), (dome, 0.08), (box, 0.01), (box, 0.03), (tube, 0.03)],
)
def test_noise_strewn_through_space(
    surface: Callable[[int], FloatArray], share: float, unit: float
) -> None:
    """It is found where it is farther off the surface than the points of this from each other."""
    points = surface(5000)
    noise = in_a_box(points, share)
    off = cKDTree(points).query(noise)[0] / np.median(cKDTree(points).query(points, [7])[0])
    found = stray_points(unit * (np.concatenate([points, noise]) + 7))
    assert not found[:5000].any()
    assert found[5000:][off > 3.5].mean() > 0.9
    assert not found[5000:][off < 2].any()


def test_noise_inside_a_dome_does_not_close_it() -> None:
    """One point amid the open side would let triangles as large as that side be taken."""
    points = dome(3000)
    found = ComputedMap().parameterize(
        PointCloud(np.concatenate([points, in_a_box(points, 0.01)])), seed=0
    )
    facts = found.report["found"]
    assert isinstance(facts, dict)
    assert facts["seam_edges"] == 0
    assert np.isfinite(found.uv[:3000]).all()


@pytest.mark.parametrize(
    "points",
    [
        *(thinned(of, 300.0 ** -(of[:, 0] + 1)) for of in (dome(9000), box(9000), tube(9000))),
        thinned(dome(9000), np.where(dome(9000)[:, 2] < 0.2, 0.02, 1)),
        thinned(box(9000), np.where(box(9000)[:, 0] > 0.5, 0.02, 1)),
        np.random.default_rng(6).normal(size=(3000, 3)) * [1, 1, 0],
        np.random.default_rng(7).random((3000, 3)) ** 4 * [1, 1, 0],
        *(rings(gap) for gap in (3, 12, 30, 100)),
        *(np.concatenate([rings(gap)[1:], [[0, 0, 0.999]]]) for gap in (12, 30)),
    ],
)
def test_sparse_parts_are_not_alone(points: FloatArray) -> None:
    """Rims that thin out, sides that are sparser, and scans in rings whose pole is one point."""
    assert not stray_points(points).any()


def test_many_places_alone_are_how_a_cloud_is_sampled() -> None:
    """A dozen of a thousand, as where a coarse part is joined to a fine one."""
    x, y = np.meshgrid(np.arange(30.0), np.arange(30.0))
    fine = np.column_stack([x.ravel(), y.ravel(), 0 * x.ravel()])
    coarse = np.column_stack([np.full(12, 45.0), 25.0 * np.arange(12), np.zeros(12)])
    assert not stray_points(np.concatenate([fine, coarse])).any()


def test_points_apart_that_lie_on_a_known_surface_are_no_strays() -> None:
    known = dome(1500)
    near = known[0] + 0.02 * np.random.default_rng(1).normal(size=(600, 3))
    near /= np.linalg.norm(near, axis=1, keepdims=True)  # a close-up, and three places elsewhere
    landmarks = known[np.linalg.norm(known - known[0], axis=1) > 1][:3]
    picked = PointCloud(np.concatenate([near, landmarks, [[9.0, 0, 0]]]))
    uv = np.zeros((len(picked.points), 2))
    assert np.isnan(unmapped(picked, uv)[-4:, 0]).all()
    assert_array_equal(np.flatnonzero(np.isnan(unmapped(picked, uv, known)[:, 0])), [len(uv) - 1])
    moved = 1.5 * known[:5]
    found = are_near(known, np.concatenate([known[:5], moved, [[1e300] * 3]]))
    assert_array_equal(found, [True] * 5 + [False] * 6)
