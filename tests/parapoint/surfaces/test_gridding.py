import numpy as np
import pytest
from numpy.testing import assert_allclose

from parapoint.surfaces.gridding import CELLS, gridded

RNG = np.random.default_rng(0)


def cylinder(uv: np.ndarray) -> np.ndarray:
    return np.column_stack([np.cos(uv[:, 0]), np.sin(uv[:, 0]), uv[:, 1]])


def test_the_grid_covers_the_images_and_lies_on_the_surface() -> None:
    known = RNG.random((3000, 2)) * [3, 2]
    mesh, own = gridded(known, cylinder)
    assert_allclose(mesh.vertices, cylinder(own.uv))
    assert mesh.topology == "disk"
    assert_allclose(mesh.face_areas.sum(), 6, rtol=0.1)
    assert len(mesh.faces) < 2 * (CELLS + 1) ** 2


def test_what_no_image_is_near_is_left_out() -> None:
    known = RNG.random((8000, 2)) * [3, 2]
    hole = np.linalg.norm(known - [1.5, 1], axis=1) > 0.5
    mesh, own = gridded(known[hole], cylinder)
    assert len(mesh.boundary_loops) == 2
    assert (np.linalg.norm(own.uv - [1.5, 1], axis=1) > 0.25).all()


@pytest.mark.parametrize("height", [0.1, 5.0])  # 25 cells, and 1,280
def test_faces_over_a_tear_are_left_out(height: float) -> None:
    known = RNG.random((3000, 2))
    torn = gridded(known, lambda uv: np.column_stack([uv, height * (uv[:, 0] > 0.5)])).mesh
    assert torn.component_count == 2


def test_points_that_stand_twice_cover_the_plane_as_single_ones_do() -> None:
    """Their median distance to the nearest other point is 0."""
    known = np.repeat(RNG.random((20_000, 2)), 2, axis=0)
    mesh, _ = gridded(known, lambda uv: np.column_stack([uv, 0 * uv[:, 0]]))
    assert_allclose(mesh.face_areas.sum(), 1, rtol=0.1)


@pytest.mark.parametrize(("gap", "is_open"), [(7, False), (12, True)])
def test_a_gap_is_bridged_up_to_four_and_a_half_spacings_from_either_side(gap, is_open) -> None:
    """A square lattice of 40 by 40 points, one apart, with a gap of some columns in the middle."""
    x, y = (of.ravel() for of in np.meshgrid(np.arange(40.0), np.arange(40.0)))
    known = np.column_stack([x + (gap - 1) * (x >= 20), y])
    mesh, own = gridded(known, lambda uv: np.column_stack([uv, 0 * uv[:, 0]]))
    assert mesh.component_count == (2 if is_open else 1)
    inside = (own.uv[:, 0] > 19) & (own.uv[:, 0] < 19 + gap)
    reached = np.minimum(own.uv[inside, 0] - 19, 19 + gap - own.uv[inside, 0]).max()
    assert reached == pytest.approx(min(4.5, gap / 2), abs=0.3)
