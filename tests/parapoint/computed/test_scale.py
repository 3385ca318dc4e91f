"""Scales of conformal maps, with known answers."""

import numpy as np
import pytest

from parapoint.computed.scale import laplacian, log_scale, turning
from parapoint.surfaces.surface import Mesh


def ring_faces(around: int, rows: int) -> np.ndarray:
    """(F, 3) two triangles a cell of a ring, whose vertex `around · j + i` is in row j."""
    j, i = np.divmod(np.arange(around * (rows - 1)), around)
    a, b = around * j + i, around * j + (i + 1) % around
    c, d = a + around, b + around
    return np.concatenate([np.stack([a, b, d], axis=1), np.stack([a, d, c], axis=1)])


def tube(around: int, rows: int) -> Mesh:
    """A tube around z of squares of side 1, each of two triangles."""
    j, i = np.divmod(np.arange(around * rows), around)
    turn, radius = 2 * np.pi * i / around, 1 / (2 * np.sin(np.pi / around))
    points = np.stack([radius * np.cos(turn), radius * np.sin(turn), j], axis=1)
    return Mesh(points, ring_faces(around, rows))


@pytest.mark.parametrize(
    ("apex", "weights"),
    [
        (2.0, (0.25, 0.375)),
        (0.01, (20.0, 0.02)),  # of a sliver they would be 50 and −25
    ],
)
def test_edge_weights_are_half_cotangents_kept_in_their_range(
    apex: float, weights: tuple[float, float]
) -> None:
    # The triangle (0, 0), (2, 0), (1, h) has 1 / h at its base, (h² − 1) / 2 h at its apex.
    matrix = laplacian(Mesh([[0, 0, 0], [2, 0, 0], [1, apex, 0]], [[0, 1, 2]])).toarray()
    side, base = weights
    expected = [[side + base, -base, -side], [-base, side + base, -side], [-side, -side, 2 * side]]
    np.testing.assert_allclose(matrix, expected, rtol=1e-9)


def test_a_tube_is_scaled_like_the_ring_that_it_is_mapped_to() -> None:
    # z → exp(2π z / C) maps a tube of circumference C to a flat ring: the log scale rises along it
    # by 2π a circumference. Each cell's edges along z weigh 1, its diagonal the least weight, 0.02,
    # so that of the flow of 2π through C = 24 columns 1.02 go through a column at slope 1.
    mesh = tube(24, 9)
    scale = log_scale(mesh)
    by_row = scale.reshape(9, 24)
    np.testing.assert_allclose(by_row, np.repeat(by_row[:, :1], 24, axis=1), atol=1e-12)
    slopes = np.diff(by_row[:, 0])
    np.testing.assert_allclose(np.abs(slopes), 2 * np.pi / 24 / 1.02, rtol=1e-9)
    assert abs(slopes.sum()) == pytest.approx(np.abs(slopes).sum())  # it rises all along
    np.testing.assert_allclose(sorted(turning(mesh, scale)), [-2 * np.pi, 2 * np.pi], atol=1e-9)
    # The loops of the tube as it is are straight, and its scale is even.
    flat = log_scale(mesh, flat_loops=False)
    np.testing.assert_allclose(flat, 0, atol=1e-12)
    np.testing.assert_allclose(turning(mesh, flat), 0, atol=1e-9)


def test_a_flat_ring_is_flat_though_its_hole_has_the_longer_boundary() -> None:
    # The hole is a star, 24 sides of 0.98 around a square of 8 sides of 4: 23.6 in place of 16.
    # Which loop is the outer one its turn of 2π tells, not its length.
    turn = 2 * np.pi * np.arange(24) / 24
    rows = [np.where(np.arange(24) % 2, 1.9, 1.0), np.full(24, 2.2), np.full(24, 2.5)]
    ring = np.concatenate([np.stack([r * np.cos(turn), r * np.sin(turn)], axis=1) for r in rows])
    mesh = Mesh(np.pad(ring, ((0, 0), (0, 1))), ring_faces(24, 3)[:, ::-1])
    assert mesh.boundary_loops[0].max() < 24  # the star
    np.testing.assert_allclose(log_scale(mesh), 0, atol=1e-9)
    np.testing.assert_allclose(sorted(turning(mesh, log_scale(mesh))), [-2 * np.pi, 2 * np.pi])
