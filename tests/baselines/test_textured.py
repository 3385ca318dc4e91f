import time

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial import cKDTree

from baselines.textured import Textured, _places, looked_up, nearest_baked, seen_points
from baselines.tools.optional import Missing
from benchmarks.cases.coloured import coloured, wave_colours
from parapoint import Mesh, Parameterization, PointCloud
from parapoint.method import MissingError, UnsupportedError
from parapoint.surfaces.parameterization import Charted

FACES = np.array([[0, 1, 2], [0, 2, 3]])
PLATE = Charted(
    Mesh([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], FACES),
    Parameterization(np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]]), FACES),
)
RNG = np.random.default_rng(0)


def test_a_texture_is_read_bilinearly_at_the_nearest_place() -> None:
    ramp = np.arange(256, dtype=np.uint8)
    texture = np.stack(np.broadcast_arrays(ramp[None], 255 - ramp[:, None], 0 * ramp[None]), axis=2)
    at = 0.05 + 0.9 * RNG.random((100, 2))
    read = looked_up(PLATE, texture, np.column_stack([at, 0.3 * RNG.random(100)]))
    wanted = (at * 256 - 0.5) / 255
    assert_allclose(read, np.column_stack([wanted, np.zeros(100)]), atol=1e-12)


def test_the_bake_of_today_takes_the_nearest_colour() -> None:
    points = np.array([[0.2, 0.5, 0.0], [0.9, 0.5, 0.0]])
    colours = np.array([[200, 0, 255], [0, 127, 0]], dtype=np.uint8)
    pixels = nearest_baked(PLATE, PointCloud(points, attributes={"colours": colours}), 20)
    assert (pixels[:, :11] == colours[0]).all()
    assert (pixels[:, 11:] == colours[1]).all()


def test_waves_are_no_finer_than_said() -> None:
    line = np.column_stack([np.linspace(0, 1, 5000), np.zeros((5000, 2))])
    steps = np.abs(np.diff(wave_colours(line, 5.0), axis=0)).max() * 5000
    assert 5 < steps < 2 * np.pi * 5 * 12 / 8 * 3


def test_ours_reads_back_better_than_the_nearest_colour() -> None:
    cloud = coloured(PLATE.mesh, 5.0, 3000)
    made = Textured(texels=128).parameterize(cloud, seed=0)
    assert len(made.uv) == 3000
    assert made.report["held_out"] == pytest.approx(600, abs=60)
    seen = cloud.points[seen_points(3000, 0)]
    assert made.report["bake_psnr"] > 30
    assert made.report["charts"] == 1
    rows = np.flatnonzero(~np.isin(cloud.points[:, 0], seen[:, 0]))
    nearest = nearest_baked(PLATE, PointCloud(seen, attributes={"colours": colours_at(seen)}), 128)
    wrong = looked_up(PLATE, nearest, cloud.points[rows]) - wave_colours(cloud.points[rows], 5.0)
    assert made.report["bake_psnr"] > -10 * np.log10((wrong**2).mean()) > 15


def colours_at(points) -> np.ndarray:
    return np.rint(255 * wave_colours(points, 5.0)).astype(np.uint8)


def test_a_cloud_without_colours_shows_its_coordinates_and_a_mesh_is_skipped(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("baselines.meshed.pymeshlab", Missing("needs MeshLab"))  # not for ours
    points = np.column_stack([RNG.random((400, 2)), np.zeros(400)])
    report = Textured(texels=64).parameterize(PointCloud(points), seed=0).report
    assert report["bake_psnr"] > 35
    with pytest.raises(MissingError, match="needs MeshLab"):
        Textured(pipeline="poisson").parameterize(PointCloud(points), seed=0)
    with pytest.raises(UnsupportedError, match="is a mesh"):
        Textured().parameterize(PLATE.mesh, seed=0)


def test_the_way_of_today_reads_back_colours_that_stand_a_spacing_away() -> None:
    """Of as many points ours makes 34 dB."""
    pytest.importorskip("pymeshlab")
    cloud = coloured(PLATE.mesh, 2.0, 400)
    report = Textured(pipeline="ball_pivoting", texels=64).parameterize(cloud, seed=0).report
    assert 20 < report["bake_psnr"] < 30


def test_points_held_out_lie_among_the_others() -> None:
    cloud = coloured(PLATE.mesh, 5.0, 4000)
    is_seen = seen_points(4000, 0)
    assert is_seen.mean() == pytest.approx(0.8, abs=0.03)
    near = cKDTree(cloud.points[is_seen]).query(cloud.points[~is_seen])[0]
    assert np.median(near) < 0.75 / np.sqrt(is_seen.sum())  # of a random draw 0.47


def test_a_cloud_of_one_colour_is_read_back_as_well_as_is_told() -> None:
    points = np.column_stack([RNG.random((400, 2)), np.zeros(400)])
    colours = np.full((400, 4), 200, dtype=np.uint8)  # the fourth is opacity
    begun = time.process_time()
    report = (
        Textured(texels=64)
        .parameterize(PointCloud(points, attributes={"colours": colours}), seed=0)
        .report
    )
    assert report["bake_psnr"] == pytest.approx(100)
    assert 0 < report["bake_cpu_seconds"] < time.process_time() - begun


@pytest.mark.parametrize("unit", [1e-3, 1e3])
def test_coordinates_as_colours_fill_the_longest_side_of_the_box(unit: float) -> None:
    points = unit * np.array([[5.0, 7, 9], [7, 8, 9], [5, 7, 9.5]])
    assert_allclose(_places(points), [[0, 0, 0], [1, 0.5, 0], [0, 0, 0.25]], atol=1e-9)
    assert not _places(points[:1]).any()
