import numpy as np

from parapoint.computed.interpolation import (
    Anchors,
    Interpolant,
    InterpolatedMap,
    shepard_weights,
)

JACOBIAN = np.array([[1.0, 2.0, 0.0], [0.0, 1.0, -1.0], [3.0, 0.0, 1.0]])


def affine(points: np.ndarray) -> Anchors:
    return Anchors(points, points @ JACOBIAN.T + 1, np.repeat(JACOBIAN[None], len(points), axis=0))


def random_points(count: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-1, 1, (count, 3))


def test_values_are_kept_at_the_anchors_and_an_affine_map_everywhere() -> None:
    anchors = affine(random_points(200))
    x = np.concatenate([anchors.points, random_points(50, seed=1)])
    np.testing.assert_allclose(Interpolant.of(anchors)(x), affine(x).values, atol=1e-9)


def test_nothing_is_blended_across_a_seam() -> None:
    # Points left and right of x = 0 are moved apart by 50.
    points = random_points(400)
    side = np.sign(points[:, :1])
    identity = np.repeat(np.eye(3)[None], len(points), axis=0)
    made = Interpolant.of(Anchors(points, points + [50.0, 0, 0] * side, identity))
    x = random_points(300, seed=1)
    np.testing.assert_allclose(np.abs((made(x) - x)[:, 0]), 50, atol=1e-9)


def test_two_anchors_lie_apart_where_they_jump_three_times_what_the_derivative_allows() -> None:
    # 20 anchors in a row, one apart, slope 1: a step of 3 is still a slope, one of 3.1 a seam.
    points = np.column_stack([np.arange(20.0), np.zeros(20), np.zeros(20)])
    slope = np.repeat(np.eye(3)[None], 20, axis=0)
    for step, across in ((3.0, True), (3.1, False)):
        values = points + [[step - 1, 0, 0]] * (points[:, :1] > 9.5)
        near = Interpolant.of(Anchors(points, values, slope)).neighbours
        assert (10 in near[9]) == across


def test_weights_are_squares_of_inverse_distances_less_that_of_the_reach() -> None:
    # Distances 1 and 2, R = 4: (1 - 1/4)² = 9/16 and (1/2 - 1/4)² = 1/16, nine to one.
    np.testing.assert_allclose(shepard_weights(np.array([[1.0, 4.0, 16.0]])), [[0.9, 0.1]])


def test_where_the_last_distance_is_missing_the_reach_is_half_as_much_again_in_squares() -> None:
    # Distances 1 and √2, so R² = 3. A missing one counts for nothing at all.
    one, two = (1 - 1 / 3**0.5) ** 2, (1 / 2**0.5 - 1 / 3**0.5) ** 2
    made = shepard_weights(np.array([[1.0, 2.0, np.inf, np.inf]]))
    np.testing.assert_allclose(made, [[one / (one + two), two / (one + two), 0]])


def test_distances_that_are_all_as_far_as_the_reach_weigh_alike() -> None:
    np.testing.assert_allclose(shepard_weights(np.full((1, 4), 2.0)), [[1 / 3] * 3])


def test_points_on_coinciding_anchors_have_finite_values() -> None:
    anchors = affine(np.repeat(random_points(10), 20, axis=0))
    assert np.isfinite(Interpolant.of(anchors)(anchors.points[:40])).all()


def test_a_map_of_few_anchors_works() -> None:
    anchors = affine(random_points(5))
    np.testing.assert_allclose(Interpolant.of(anchors)(anchors.points), anchors.values)


def test_the_inverse_of_a_map_undoes_it() -> None:
    # A plane, turned and moved in space, and laid down.
    flat = np.random.default_rng(0).uniform(-1, 1, (300, 2))
    axes = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0][:, :2]
    forward = Anchors(flat @ axes.T + 1, flat, np.repeat(axes.T[None], 300, axis=0))
    made = InterpolatedMap.of(forward, np.repeat(axes[None], 300, axis=0))
    uv = np.random.default_rng(2).uniform(-0.9, 0.9, (50, 2))
    np.testing.assert_allclose(made.lift(uv), uv @ axes.T + 1, atol=1e-12)
    np.testing.assert_allclose(made.flatten(made.lift(uv)), uv, atol=1e-12)
    restored = InterpolatedMap.restored(made.arrays())
    assert np.array_equal(restored.lift(uv), made.lift(uv))


def test_the_steeper_of_two_anchors_says_what_a_jump_is() -> None:
    # 20 anchors in a row, one apart, of slope 1 up to the tenth and of slope 4 from there on. A
    # step of 9 between these two is more than 3 · 1, but not than 3 · 4.
    points = np.column_stack([np.arange(20.0), np.zeros(20), np.zeros(20)])
    steep = points[:, 0] > 9.5
    slope = np.where(steep, 4.0, 1.0)[:, None, None] * np.eye(3)
    values = points * np.where(steep, 4.0, 1.0)[:, None] + [[-22.0, 0, 0]] * steep[:, None]
    assert values[10, 0] - values[9, 0] == 9
    near = Interpolant.of(Anchors(points, values, slope)).neighbours
    assert 10 in near[9]
    assert 9 in near[10]


def test_the_six_nearest_anchors_are_blended_and_the_seventh_is_the_reach() -> None:
    # In a row, one apart: midway between two, six are at 1/2, 3/2 and 5/2, and R = 7/2. The map
    # says y = x, but for one anchor at distance 1/2 that says 1/100 more: as much as its weight,
    # of twice (2 − 2/7)², (2/3 − 2/7)² and (2/5 − 2/7)², counts.
    points = np.column_stack([np.arange(20.0), np.zeros(20), np.zeros(20)])
    values = points + [[0.01, 0, 0]] * (points[:, :1] == 9)
    made = Interpolant.of(Anchors(points, values, np.repeat(np.eye(3)[None], 20, axis=0)))
    weight = [(2 / k - 2 / 7) ** 2 for k in (1, 3, 5)]
    found = made(np.array([[9.5, 0.0, 0.0]]))
    np.testing.assert_allclose(found, [[9.5 + 0.01 * weight[0] / (2 * sum(weight)), 0, 0]])
