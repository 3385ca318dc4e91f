import numpy as np

from benchmarks.cases.builtin import sphere, torus
from parapoint.computed.denoising import denoised, noise
from parapoint.computed.flattening import flat_map
from parapoint.surfaces.surface import FloatArray


def ball(count: int, deviation: float) -> FloatArray:
    """Points near the unit sphere, evenly spread."""
    rng = np.random.default_rng(0)
    turn = np.pi * (1 + 5**0.5) * np.arange(count)
    height = 1 - (2 * np.arange(count) + 1) / count
    radius = np.sqrt(1 - height**2)
    points = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), height])
    return points + deviation * rng.standard_normal(points.shape)


def test_noise_on_a_sphere_is_found_and_taken_away() -> None:
    points = ball(3000, 0.03)
    still = denoised(points)
    before, after = (np.abs(np.linalg.norm(of, axis=1) - 1) for of in (points, still))
    assert noise(points) > 0.2
    assert np.sqrt((after**2).mean()) < 0.4 * np.sqrt((before**2).mean())
    assert np.linalg.norm(still - points, axis=1).max() < 0.15
    assert abs(np.linalg.norm(still, axis=1).mean() - 1) < 0.005  # it does not shrink


def test_clean_clouds_stay_as_they_are() -> None:
    corner = np.random.default_rng(1).uniform(-1, 1, (2000, 3))
    corner[np.arange(2000), np.arange(2000) % 3] = 0  # three planes that meet
    for points in (ball(3000, 0), corner, sphere().vertices, torus().vertices, corner[:20]):
        assert denoised(points) is points


def test_a_point_goes_along_the_normal_alone() -> None:
    points = np.random.default_rng(2).uniform(-1, 1, (2000, 3))
    points[:, 2] *= 0.04
    still = denoised(points)
    inner = (np.abs(points[:, :2]) < 0.8).all(axis=1)
    moved = np.abs(still - points)[inner]
    assert np.sqrt((still[inner, 2] ** 2).mean()) < 0.4 * np.sqrt((points[inner, 2] ** 2).mean())
    assert np.median(moved[:, :2]) < 0.2 * np.median(moved[:, 2])


def test_a_map_is_of_denoised_points_where_these_have_fewer_defects() -> None:
    assert flat_map(ball(1500, 0.03)).facts["denoised"]
    assert not flat_map(ball(1500, 0)).facts["denoised"]


def test_thin_sheets_that_look_like_noise_stay_apart() -> None:
    side = np.random.default_rng(0).uniform(-1, 1, (1500, 2))
    side = side[(side**2).sum(axis=1) < 1]
    rim = np.sqrt(1 - (side**2).sum(axis=1))
    points = np.column_stack([side, 0.06 * rim * np.where(np.arange(len(side)) % 2, 1, -1)])
    assert noise(points) > 0.2
    assert not flat_map(points).facts["denoised"]


def test_a_second_pass_takes_away_what_the_first_leaves() -> None:
    # Of the noise a fit to 48 points leaves 0.31 to 0.33, whatever its size, as measured: the
    # share of these points' own. They are fitted again, and 0.26 to 0.28 of it is left.
    for deviation in (0.02, 0.03):
        points = ball(3000, deviation)
        before, after = (np.linalg.norm(of, axis=1) - 1 for of in (points, denoised(points)))
        assert np.sqrt((after**2).mean()) < 0.295 * np.sqrt((before**2).mean())


def test_a_saddle_has_no_noise() -> None:
    # A height x y is a quadratic one; what is left of it comes of the planes that are not level,
    # 0.0002 of the spacing. Without the product among the terms it is 0.012.
    x, y = np.random.default_rng(2).uniform(-1, 1, (2, 3000))
    assert noise(np.column_stack([x, y, x * y])) < 0.001


def test_a_cloud_with_half_the_noise_that_counts_stays_as_it_is() -> None:
    # A deviation of 1 % where the spacing is some 7 %; noise shows as 0.11, and counts from 0.2 on.
    points = ball(3000, 0.01)
    assert 0.09 < noise(points) < 0.13
    assert denoised(points) is points


def test_a_ridge_stays_sharp() -> None:
    # Within 0.1 of the ridge of a roof, less than two spacings, it comes down by 0.0035, as
    # measured; by 0.0068 where all 48 neighbours count alike.
    rng = np.random.default_rng(3)
    x, y = np.random.default_rng(2).uniform(-1, 1, (2, 3000))
    still = denoised(np.column_stack([x, y, -np.abs(x)]) + 0.02 * rng.standard_normal((3000, 3)))
    near = (np.abs(still[:, 0]) < 0.1) & (np.abs(still[:, 1]) < 0.8)
    assert (still[near, 2] + np.abs(still[near, 0])).mean() > -0.005
