import numpy as np
import pytest

from parapoint import ComputedMap, InputError
from parapoint.surfaces.seam_points import seam_points

COUNTS = [300, 1500, 10_000, 100_000]


def sheet(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Points of half a cylinder, and its isometric map."""
    uv = np.random.default_rng(count).random((count, 2)) * [np.pi, 2]
    return np.column_stack([np.cos(uv[:, 0]), np.sin(uv[:, 0]), uv[:, 1]]), uv


def tube(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Points of a whole cylinder, cut open at the angle 0."""
    uv = np.random.default_rng(count).random((count, 2)) * [2 * np.pi, 6]
    return np.column_stack([np.cos(uv[:, 0]), np.sin(uv[:, 0]), uv[:, 1]]), uv


@pytest.mark.parametrize("count", COUNTS)
def test_an_open_sheet_has_no_seam(count) -> None:
    assert not seam_points(*sheet(count)).any()


@pytest.mark.parametrize("stretch", [[3, 1], [1, 4]])
def test_a_sheet_that_is_stretched_has_none_either(stretch) -> None:
    points, uv = sheet(3000)
    assert not seam_points(points, uv * stretch).any()
    turn = uv[:, 1]
    conformal = np.exp(uv[:, :1]) * np.column_stack([np.cos(turn), np.sin(turn)])
    assert not seam_points(points, conformal).any()


@pytest.mark.parametrize("count", COUNTS)
def test_a_cylinder_has_one_line(count) -> None:
    points, uv = tube(count)
    seam = seam_points(points, uv)
    spacing = np.sqrt(12 * np.pi / count)
    from_line = np.minimum(uv[:, 0], 2 * np.pi - uv[:, 0])
    assert from_line[seam].max() < 3 * spacing
    # Of a point beside the line all three neighbours are on its own side one time in eight.
    assert seam[from_line < spacing / 4].mean() > 0.8
    heights = np.sort(uv[seam, 1])
    assert np.diff(heights).max() < 8 * spacing  # random points leave gaps


def test_the_papers_rule_is_for_the_papers_density() -> None:
    points, uv = sheet(1500)
    assert seam_points(points, uv, "paper").mean() > 0.9
    grid = np.stack(np.meshgrid(np.arange(101), np.arange(101)), axis=2).reshape(-1, 2)
    flat = np.column_stack([grid, np.zeros(len(grid))])
    marked = seam_points(flat, grid, "paper").reshape(101, 101)
    assert not marked[1:-1, 1:-1].any()


def test_points_that_coincide_do_not_count_as_torn() -> None:
    points, uv = sheet(500)
    assert not seam_points(np.tile(points, (2, 1)), np.tile(uv, (2, 1))).any()


def test_a_fitted_sheet_has_no_seam_and_wrong_use_is_refused() -> None:
    points, _ = sheet(400)
    model = ComputedMap().fit(points)
    assert not model.seams().any()
    assert not model.seams(sheet(4000)[0]).any()
    with pytest.raises(InputError, match="rule must be stretch or paper"):
        model.seams(rule="none")
    with pytest.raises(InputError, match="more than 3 points"):
        model.seams(points[:3])
