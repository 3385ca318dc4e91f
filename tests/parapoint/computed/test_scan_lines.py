"""Clouds scanned in lines and rings are mapped, however far apart these are."""

from collections.abc import Callable

import numpy as np
import pytest

from parapoint.computed.flattening import flat_map
from parapoint.surfaces.components import cloud_labels
from parapoint.surfaces.frame import Frame
from parapoint.surfaces.scan_lines import NEAREST, breadth, thinned
from parapoint.surfaces.surface import FloatArray


def strips(gap: float, count: int = 1000) -> FloatArray:
    """Lines of points about 1 apart, `gap` from line to line, on a plane."""
    lines = max(round((count / gap) ** 0.5), 4)
    rng = np.random.default_rng(0)
    x, y = np.meshgrid(np.arange(count // lines) * 1.0, gap * np.arange(lines))
    x = x + rng.uniform(0, 1, (lines, 1)) + rng.normal(0, 0.05, x.shape)
    return np.stack([x, y, 0 * x], axis=2).reshape(-1, 3)


def terrain(gap: float) -> FloatArray:
    """The same over hills."""
    points = strips(gap)
    x, y, _ = points.T / np.ptp(points[:, 0])
    points[:, 2] = 0.04 * np.ptp(points[:, 0]) * np.sin(5 * x) * np.cos(4 * y + 1)
    return points


def tube(gap: float, apart: float, rings: int, arc: float = 2 * np.pi) -> FloatArray:
    """Rings around a cylinder of radius 1, `apart` from one to the next; or arcs of rings."""
    around = round(arc * gap / apart)
    turn = np.random.default_rng(0).uniform(0, 1, (rings, 1))
    angle = arc * np.arange(around) / around + (turn if arc > 6 else turn * apart / gap)
    z = apart * np.arange(rings)[:, None] + 0 * angle
    return np.stack([np.cos(angle), np.sin(angle), z], axis=2).reshape(-1, 3)


def helix(gap: float, apart: float, turns: int) -> FloatArray:
    """One line wound around the same cylinder."""
    angle = np.arange(0, 2 * np.pi * turns, apart / gap)
    return np.stack([np.cos(angle), np.sin(angle), apart * angle / (2 * np.pi)], axis=1)


def noisy(points: FloatArray, spacing: float = 1.0) -> FloatArray:
    """With noise of 0.3 of the distance along the lines."""
    return points + 0.3 * spacing * np.random.default_rng(1).normal(size=points.shape)


def lidar() -> FloatArray:
    """The unit sphere as seen by a spinning lidar 3 away from its middle."""
    up = np.radians(np.linspace(-17, 17, 14))[:, None]
    turn = np.radians(np.arange(-20, 20, 0.25))[None]
    rays = np.stack([np.cos(up) * np.cos(turn), np.cos(up) * np.sin(turn), np.sin(up) + 0 * turn])
    rays = rays.reshape(3, -1).T
    middle = rays @ [3.0, 0.0, 0.0]
    hits = middle**2 > 8.05
    return rays[hits] * (middle[hits] - np.sqrt(middle[hits] ** 2 - 8))[:, None]


@pytest.mark.parametrize(
    ("points", "loops", "distortion"),
    [
        (lambda: strips(8), 1, 1e-6),
        (lambda: strips(12), 1, 1e-6),
        (lambda: strips(20), 1, 1e-6),
        (lambda: strips(30), 1, 1e-6),
        (lambda: terrain(12), 1, 0.02),
        (lambda: terrain(30), 1, 0.03),
        (lambda: strips(100, 4000), 1, 1e-6),
        (lambda: noisy(strips(15)), 1, 1e-3),
        (lambda: noisy(helix(120, 1, 6), 1 / 120), 2, 0.05),
        (lambda: noisy(terrain(12)), 1, 0.03),
        (lambda: tube(12, 0.4, 8), 2, 0.02),
        (lambda: tube(30, 0.4, 4), 2, 0.02),
        (lambda: tube(30, 1, 5), 2, 0.1),
        (lambda: tube(60, 0.2, 6), 2, 0.02),
        (lambda: noisy(tube(20, 0.7, 6), 0.7 / 20), 2, 0.05),
        (lambda: tube(20, 0.5, 6, arc=4.0), 1, 0.02),
        (lambda: helix(20, 0.4, 10), 2, 0.02),
        (lidar, 1, 0.05),
    ],
)
def test_lines_show_the_surface(
    points: Callable[[], FloatArray], loops: int, distortion: float
) -> None:
    """The points that are kept are on one piece with its true rims, and angles stay."""
    cloud = points()
    flat = flat_map(Frame.of(cloud).inside(cloud))
    assert len(flat.missed) <= 0.02 * len(flat.anchors)
    assert len(flat.anchors) + len(flat.missed) + flat.facts["thinned"] == len(cloud)
    assert flat.facts["genus"] == 0
    assert flat.facts["boundary_loops"] == loops
    ratio = np.divide(*np.linalg.svd(flat.jacobians, compute_uv=False).T)
    assert np.median(ratio) < 1 + distortion


def test_lines_on_a_grid_are_mapped() -> None:
    """Whole millimetres leave many points on one line, which span no triangle."""
    cloud = np.unique(np.round(terrain(12)), axis=0)
    flat = flat_map(Frame.of(cloud).inside(cloud))
    assert len(flat.missed) < 0.05 * len(flat.anchors)
    assert (flat.charted.mesh.face_areas > 0).all()


def test_lines_are_one_component() -> None:
    """Two sheets of lines are two."""
    sheet = strips(20, 2000)
    both = np.concatenate([sheet, sheet + np.array([0, 0, 2000.0])])
    np.testing.assert_array_equal(cloud_labels(both), np.arange(4000) >= 2000)


def test_neighbourhoods_grow_on_lines_alone() -> None:
    """As wide as the next line is away; clouds that are dense in all directions have none."""
    count = breadth(strips(20))
    assert count is not None
    assert (count >= 20).all()
    grid = np.stack(np.meshgrid(np.arange(20.0), np.arange(20.0), [0.0]), axis=-1).reshape(-1, 3)
    assert breadth(grid) is None
    mixed = np.concatenate([grid, strips(20) + np.array([0, 100, 0])])
    found = breadth(mixed)
    assert found is not None
    assert (found[:400] == NEAREST).mean() > 0.9
    lines = thinned(mixed)
    assert lines is not None
    assert np.array_equal(lines.rows[:400], np.arange(400))  # what is no line is not thinned
    assert (lines.gap[:400] == 0).mean() > 0.9


def test_lines_are_thinned_to_what_the_next_line_shows() -> None:
    """Points stay 0.4 times as far apart as the lines, however noisy; no line is lost."""
    for points in (strips(20, 4000), noisy(strips(20, 4000))):
        lines = thinned(points)
        assert lines is not None
        kept = points[lines.rows]
        apart = np.linalg.norm(kept[:, None] - kept, axis=2) + 1e9 * np.eye(len(kept))
        assert 7 < apart.min() <= apart.min(axis=1).max() < 20
        assert len(np.unique(lines.line)) == len(np.unique(np.round(points[:, 1] / 20)))
        np.testing.assert_allclose(lines.gap, 20, rtol=0.1)
    assert thinned(np.random.default_rng(0).uniform(size=(800, 3)) * [1, 1, 0]) is None
