"""Scales of conformal maps, with known answers."""

import numpy as np
import pytest

from parapoint.computed.scale import (
    area_discrepancy,
    even_scale,
    laplacian,
    log_scale,
    mapped_areas,
    turning,
)
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


def half_cap() -> Mesh:
    """Half of a cap of the unit sphere: as far as 2 radians from a point, on one side of it."""
    grid = np.meshgrid(np.linspace(0.1, 2, 20), np.linspace(0, np.pi, 25), indexing="ij")
    polar, turn = (of.ravel() for of in grid)
    ring = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    points = np.column_stack([np.sin(polar)[:, None] * ring, np.cos(polar)])
    corner = (25 * np.arange(19)[:, None] + np.arange(24)).ravel()
    faces = np.concatenate([corner[:, None] + [0, 25, 26], corner[:, None] + [0, 26, 1]])
    return Mesh(points, faces)


def test_no_wave_around_the_boundary_makes_the_scale_more_even() -> None:
    # What is least is Σ area √((ratio − 1)² + 0.05²) over the faces, the ratio of the shares of the
    # mapped and the real area: along each wave, harmonic inside, its derivative is 0. It is 0.01 to
    # 0.1 where the descent follows a wrong gradient, or ends at another energy.
    mesh = half_cap()
    (loop,) = mesh.boundary_loops
    sides = np.linalg.norm(mesh.vertices[np.roll(loop, -1)] - mesh.vertices[loop], axis=1)
    place = 2 * np.pi * (np.cumsum(sides) - sides) / sides.sum()
    inside = np.setdiff1d(np.arange(len(mesh.vertices)), loop)
    matrix = laplacian(mesh).toarray()
    area = mesh.face_areas / mesh.face_areas.sum()
    scale = even_scale(mesh)

    def energy(moved: np.ndarray) -> float:
        mapped = mapped_areas(mesh, moved)
        ratio = mapped / mapped.sum() / area
        return float(area @ np.sqrt((ratio - 1) ** 2 + 0.05**2))

    for wave in (f(k * place) for k in (1, 2, 3) for f in (np.cos, np.sin)):
        height = np.zeros(len(scale))
        height[loop] = wave
        pull = -matrix[np.ix_(inside, loop)] @ wave
        height[inside] = np.linalg.solve(matrix[np.ix_(inside, inside)], pull)
        slope = (energy(scale + 1e-4 * height) - energy(scale - 1e-4 * height)) / 2e-4
        assert abs(slope) < 1e-3


def test_areas_go_by_the_square_of_the_scale() -> None:
    # Two halves of a square; the third corner of one alone is scaled by 8, which makes it 2 in the
    # mean of the logarithms, and its area 4 times as large: 4/5 and 1/5 in place of 1/2 and 1/2.
    mesh = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    scale = np.log([1.0, 8.0, 1.0, 1.0])
    np.testing.assert_allclose(mapped_areas(mesh, scale), [2, 0.5])
    assert area_discrepancy(mesh, scale) == pytest.approx(0.6)
