import numpy as np
import pytest

from benchmarks.cases.builtin import sphere, torus
from parapoint.computed.flattening import FlatMap, flat_map
from parapoint.computed.reconstruction import ReconstructionError

SPHERE, TORUS = sphere().vertices, torus().vertices


def distances(points: np.ndarray) -> np.ndarray:
    return np.linalg.norm(points[:, None] - points, axis=2)


def plane() -> np.ndarray:
    xy = np.random.default_rng(0).uniform(size=(400, 2))
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    return np.pad(xy, ((0, 0), (0, 1))) @ turn


def angles_kept(flat: FlatMap) -> np.ndarray:
    """(A,) ratio of the singular values of each Jacobian, 1 where the map is conformal."""
    values = np.linalg.svd(flat.jacobians, compute_uv=False)
    return values[:, 1] / values[:, 0]


def test_a_plane_keeps_its_distances() -> None:
    points = plane()
    flat = flat_map(points)
    assert np.array_equal(flat.anchors, np.arange(400))
    np.testing.assert_allclose(distances(flat.uv), distances(points), atol=1e-6)
    assert flat.facts["seam_edges"] == 0
    assert flat.facts["genus"] == 0


def test_a_half_cylinder_is_unrolled() -> None:
    # The rows are rings of straight-sided strips: the triangulation itself is developable.
    turn, height = np.meshgrid(np.linspace(0, np.pi, 25), np.linspace(0, 2, 17))
    turn, height = turn.ravel(), height.ravel()
    flat = flat_map(np.column_stack([np.cos(turn), np.sin(turn), height]))
    side = 2 * np.sin(np.pi / 48) * 24 / np.pi
    unrolled = np.column_stack([side * turn, height])
    np.testing.assert_allclose(distances(flat.uv), distances(unrolled), atol=1e-5)


@pytest.mark.parametrize(("points", "genus"), [(SPHERE, 0), (TORUS, 1)])
def test_a_closed_surface_is_cut_and_nearly_conformal(points: np.ndarray, genus: int) -> None:
    flat = flat_map(points)
    assert flat.facts["genus"] == genus
    assert flat.facts["boundary_loops"] == 0
    assert flat.facts["seam_edges"] > 0
    assert np.median(angles_kept(flat)) > 0.85


def test_a_thin_pin_on_a_plate_is_mapped() -> None:
    # Six points around and sixty rings: in Tutte's embedding its tip is too small for numbers.
    x, y = (side.ravel() for side in np.meshgrid(*[np.linspace(-3, 3, 31)] * 2))
    outside = np.hypot(x, y) > 0.3
    ring, place = (rows.ravel() for rows in np.indices((60, 6)))
    turn = (place + ring % 2 / 2) * np.pi / 3
    plate = np.column_stack([x, y, 0 * x])[outside]
    pin = np.column_stack([0.2 * np.cos(turn), 0.2 * np.sin(turn), 0.17 * ring])
    points = np.concatenate([plate, pin, [[0, 0, 10.15]]])
    flat = flat_map(points)
    assert len(flat.anchors) == len(points)
    assert flat.facts["genus"] == 0
    assert flat.facts["boundary_loops"] == 1
    assert 60 <= flat.facts["seam_edges"] <= 90  # along the pin and from its foot to the rim
    assert np.median(angles_kept(flat)) > 0.9


def test_a_strip_that_hangs_into_a_hole_is_mapped() -> None:
    # Fifty triangles in a row: in Tutte's embedding each is a fraction of the one before.
    x, y = (side.ravel() for side in np.meshgrid(*[np.linspace(-5, 5, 51)] * 2))
    in_strip = (np.abs(x - 0.1) < 0.15) & (y < 1.01)
    points = np.column_stack([x, y, 0 * x])[(np.hypot(x, y) > 4) | in_strip]
    flat = flat_map(points)
    assert len(flat.anchors) == len(points)
    assert flat.facts["boundary_loops"] == 2
    assert 1 <= flat.facts["seam_edges"] <= 10  # from the rim of the plate to the hole
    assert np.median(angles_kept(flat)) > 0.9


def test_the_inverse_derivatives_undo_the_derivatives() -> None:
    flat = flat_map(SPHERE)
    back = flat.jacobians @ flat.inverse_jacobians
    close = np.abs(back - np.eye(2)).max(axis=(1, 2)) < 1e-9
    assert close.mean() > 0.95  # all but those where a seam squeezes the map flat


def test_the_map_is_the_same_each_time_and_scales_with_the_points() -> None:
    first, second = flat_map(SPHERE), flat_map(4 * SPHERE)
    assert np.array_equal(first.uv, flat_map(SPHERE).uv)
    np.testing.assert_allclose(second.uv, 4 * first.uv, atol=1e-6)


def test_points_without_a_surface_are_refused() -> None:
    parts = [SPHERE[::4] + np.array([4.0 * k, 0, 0]) for k in range(3)]
    with pytest.raises(ReconstructionError, match="holds 161 of 483 points"):
        flat_map(np.concatenate(parts))
