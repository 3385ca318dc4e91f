"""Point-cloud metrics: planar clouds with known maps, ranks counted by hand, sheets, tears."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial import cKDTree, distance

from benchmarks.cases import builtin
from benchmarks.metrics.evaluation import evaluate_points
from benchmarks.metrics.pointwise import (
    nearest_others,
    point_map,
    point_part_area_ratio_min,
    starved_point_fraction,
)
from benchmarks.metrics.table import METRICS
from parapoint import InputError, PointCloud, PointParameterization

EXACT = 1e-9


def plane(count=400, seed=0):
    return np.random.default_rng(seed).uniform(size=(count, 2))


def scores(points, uv):
    if points.shape[1] == 2:
        points = np.column_stack([points, np.zeros(len(points))])
    return evaluate_points(PointCloud(points), PointParameterization(uv))


@pytest.mark.parametrize("scale", [1e-8, 1.0, 1e9])
def test_a_similarity_is_perfect(scale):
    points = plane()
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(2, 2)))[0]
    values = scores(points, scale * points @ turn + scale)
    expected = {m.name for m in METRICS.values() if m.group == "points"}
    assert set(values) == expected | {"coverage"}
    for name in expected:
        ideal = METRICS[name].ideal
        if ideal is not None:
            assert_allclose(values[name], ideal, atol=1e-6 if scale < 1 else EXACT, err_msg=name)
    assert values["spanning_point_fraction"] == 0


@pytest.mark.parametrize("stretch", [1.0, 3.0])
def test_scan_lines_are_judged_across_the_lines(stretch):
    """Lines 20 times as far apart as their points: the eight nearest all lie on one."""
    x, y = np.meshgrid(np.arange(60.0), 20 * np.arange(6.0))
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    values = scores(points, points * [1, stretch])
    assert_allclose(values["local_quasi_conformal_mean"], stretch, atol=1e-6)


@pytest.mark.parametrize("k", [2.0, 7.0])
def test_a_stretch_is_measured_in_any_plane(k):
    points = plane()
    frame = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0][:2]
    values = scores(points @ frame, points * [k, 1])
    assert_allclose(values["local_quasi_conformal_mean"], k, rtol=EXACT)
    assert_allclose(values["local_area_log_ratio_mean"], 0, atol=EXACT)


def test_an_area_factor_is_measured_from_its_median():
    # u -> u^2 stretches by 2u; each local fit is exact only in the limit of a dense cloud.
    points = plane(4000) + np.array([0.5, 0])
    values = scores(points, np.stack([points[:, 0] ** 2, points[:, 1]], 1))
    log = np.log(2 * points[:, 0])
    expected = np.abs(log - np.median(log)).mean()
    assert_allclose(values["local_area_log_ratio_mean"], expected, rtol=1e-2)


def test_a_sphere_cap_in_stereographic_projection_is_nearly_conformal():
    cap = builtin.sphere_cap(60, 40).vertices
    uv = cap[:, :2] / (1 + cap[:, 2:])
    values = scores(cap, uv)
    assert values["local_quasi_conformal_mean"] < 1.02
    assert values["neighbour_preservation"] > 0.999
    assert values["uv_collision_fraction"] == 0


def rank_formula(points, uv, k):
    """Trustworthiness as Venna and Kaski print it, by sorting all distances."""
    count = len(points)
    near = [np.argsort(row)[1 : k + 1] for row in distance.cdist(points, points)]
    rank = np.argsort(np.argsort(distance.cdist(points, points), axis=1), axis=1)
    found = [np.argsort(row)[1 : k + 1] for row in distance.cdist(uv, uv)]
    total = sum(
        rank[i, j] - k for i in range(count) for j in found[i] if j not in set(near[i].tolist())
    )
    return 1 - 2 / (count * k * (2 * count - 3 * k - 1)) * total


def test_trustworthiness_and_continuity_by_their_formula():
    points, uv = plane(60, 3), plane(60, 4)
    uv[:30] = points[:30]
    values = scores(points, uv)
    assert_allclose(values["neighbour_trustworthiness"], rank_formula(points, uv, 8), rtol=EXACT)
    assert_allclose(values["neighbour_continuity"], rank_formula(uv, points, 8), rtol=EXACT)
    assert values["neighbour_preservation"] == min(
        values["neighbour_trustworthiness"], values["neighbour_continuity"]
    )
    assert values["neighbour_preservation"] < 0.9


def test_two_sheets_on_one_another_collide():
    points = plane(500)
    sheet = np.column_stack([points, np.zeros(500)])
    above = np.column_stack([plane(500, 9), np.full(500, 3.0)])
    cloud = np.concatenate([sheet, above])
    stacked = scores(cloud, cloud[:, :2])
    apart = scores(cloud, cloud[:, :2] + cloud[:, 2:])
    assert stacked["uv_collision_fraction"] > 0.4  # every second nearest is of the other sheet
    assert apart["uv_collision_fraction"] == 0
    assert stacked["neighbour_trustworthiness"] < apart["neighbour_trustworthiness"]


@pytest.mark.parametrize(("apart", "share"), [(20, 0), (21, 34 / 42)])
def test_only_what_lies_five_neighbourhoods_away_collides(apart, share):
    # Points at 0, 1, 2, ... on a line: the 8th neighbour of all but the 4 at each end is 4 away.
    # The map puts each point beside the one `apart` away, which collides from above 5 * 4 on.
    x = np.arange(2.0 * apart)
    uv = np.column_stack([10 * (x % apart) + (x >= apart), 0 * x])
    values = scores(np.column_stack([x, 0 * x]), uv)
    assert_allclose(values["uv_collision_fraction"], share, rtol=EXACT)


def test_seam_points_by_hand():
    # Nine points on a line, of which the map moves the last three away by a fifth of L.
    x = np.arange(9.0)
    points = np.stack([x, np.zeros(9), np.zeros(9)], 1)
    uv = np.stack([x + np.where(x > 5, 2.5, 0), np.zeros(9)], 1) / 1000
    uv[0, 1] = 2.0  # L is 2, T 0.02: the line itself is shorter than that
    values = scores(points, uv)
    # Point 0 lies far off; it is among the three nearest of points 1 and 2 (ties go either way).
    near = nearest_others(cKDTree(points), 3)
    expected = [0 in near[i] or i == 0 for i in range(9)]
    assert_allclose(values["seam_point_fraction"], np.mean(expected), rtol=EXACT)


def test_a_tear_is_found_and_left_out():
    points = plane(2000)
    torn = points + np.where(points[:, :1] > 0.5, [[5.0, 0]], [[0.0, 0]])
    values = scores(points, torn)
    assert 0.02 < values["spanning_point_fraction"] < 0.15
    assert values["local_quasi_conformal_mean"] > 1.1
    assert_allclose(values["local_quasi_conformal_mean_without_spanning"], 1, rtol=EXACT)
    assert_allclose(values["local_area_log_ratio_mean_without_spanning"], 0, atol=1e-6)


def test_duplicates_are_no_neighbours_of_themselves():
    points = np.repeat(plane(20), 4, axis=0)
    found = nearest_others(cKDTree(points), 3)
    assert (found != np.arange(80)[:, None]).all()
    assert all(len(set(row)) == 3 for row in found.tolist())


@pytest.mark.parametrize(
    "uv",
    [np.zeros((50, 2)), np.repeat([[0.0, 1.0]], 50, axis=0), np.arange(100.0).reshape(50, 2)],
)
def test_a_collapsed_map_has_no_nan(uv):
    values = scores(plane(50), uv)
    assert not any(np.isnan(value) for value in values.values())
    assert values["local_quasi_conformal_mean"] == np.inf


def test_collinear_and_duplicate_points_have_no_nan():
    line = np.stack([np.arange(30.0), np.zeros(30)], 1)
    for points in (line, np.repeat(line[:6], 5, axis=0)):
        values = scores(points, points)
        assert not any(np.isnan(value) for value in values.values())
        assert values["local_quasi_conformal_mean"] == np.inf


def test_few_points_and_other_lengths_are_refused():
    with pytest.raises(InputError, match="4 are needed"):
        point_map(PointCloud(np.eye(3)), PointParameterization(np.zeros((3, 2))))
    with pytest.raises(InputError, match="5 uv rows for a cloud of 6 points"):
        point_map(PointCloud(np.zeros((6, 3))), PointParameterization(np.zeros((5, 2))))
    assert len(scores(plane(4), plane(4))) == 13


def test_a_seam_starves_no_point():
    # A flat grid whose right half lies far away in UV: its area is right everywhere.
    x, y = (of.reshape(-1) for of in np.meshgrid(np.arange(20.0), np.arange(20.0)))
    uv = np.stack([x + 500 * (x > 9), y], axis=1)
    torn = point_map(PointCloud(np.column_stack([x, y, 0 * x])), PointParameterization(uv))
    assert torn.spanning.sum() == 44  # two columns, and one more at each of the four corners
    assert starved_point_fraction(torn) == 0
    assert point_part_area_ratio_min(torn) == 1
