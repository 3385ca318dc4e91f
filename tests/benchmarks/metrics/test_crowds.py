"""Faces that lie on one another by the thousand, and slivers whose boxes do."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from benchmarks.metrics import crowds, overlap, pointwise
from benchmarks.metrics.boxes import Hierarchy
from benchmarks.metrics.crowds import Crowd
from benchmarks.metrics.evaluation import evaluate, evaluate_points
from benchmarks.metrics.state import MapState
from parapoint.surfaces.parameterization import Parameterization, PointParameterization
from parapoint.surfaces.places import places
from parapoint.surfaces.surface import Mesh, PointCloud

COUNT = 3000


@pytest.fixture(autouse=True)
def few(monkeypatch):
    """Bounds so low that these files need not be large."""
    monkeypatch.setattr(overlap, "FEW_CANDIDATES", 20_000)
    monkeypatch.setattr(overlap, "MOST_CANDIDATES", 16)
    monkeypatch.setattr(crowds, "SAMPLE", 1 << 14)


def own_rows(images):
    """A mesh and a map whose faces each have rows of their own."""
    uv = images.reshape(-1, 2)
    faces = np.arange(len(uv)).reshape(-1, 3)
    heights = np.random.default_rng(1).random(len(uv))
    return Mesh(np.column_stack([uv, heights]), faces), Parameterization(uv, faces)


def found(images):
    return MapState(*own_rows(images)).validity.overlaps


def copies(moved):
    triangle = np.tile([[0, 0], [1, 0], [0, 1.0]], (COUNT, 1, 1))
    return triangle + moved * np.random.default_rng(0).normal(size=triangle.shape)


def aslant():
    """Slivers side by side, each of whose boxes overlaps all others'."""
    x = np.arange(COUNT) / COUNT
    end = np.stack([x + 1, 1 - x], 1)
    return np.stack([np.stack([x, -x], 1), end, end + np.array([0.4, -0.4]) / COUNT], 1)


def around():
    """A whole turn of slivers around one point."""
    angle = np.linspace(0, 2 * np.pi, COUNT + 1)
    rim = np.stack([np.cos(angle), np.sin(angle)], 1)
    return np.stack([np.zeros((COUNT, 2)), rim[:-1], rim[1:]], 1)


def through():
    """Slivers all of which pass through one point."""
    angle = np.linspace(0, np.pi, COUNT, endpoint=False)
    along = np.stack([np.cos(angle), np.sin(angle)], 1)
    return np.stack([-along, along, along + 1e-3 * along[:, ::-1] * [-1, 1]], 1)


@pytest.mark.parametrize("moved", [0, 1e-9, 1e-6, 1e-3])
def test_thousands_of_copies_overlap_by_what_they_must(moved):
    overlaps = found(copies(moved))
    pairs = COUNT * (COUNT - 1) / 2
    assert overlaps.sampled
    assert overlaps.overlapped.all()
    assert_allclose(overlaps.pair_count, pairs, rtol=0.01)
    assert_allclose(overlaps.area.sum(), pairs, rtol=0.01 + 5 * moved)  # halves, in both orders


def test_the_work_is_bounded(monkeypatch):
    clipped = []
    exactly = overlap.common_area

    def common_area(a, b):
        clipped.append(a.shape[2])
        return exactly(a, b)

    monkeypatch.setattr(overlap, "common_area", common_area)
    for images in (copies(0), copies(1e-6), through()):
        clipped.clear()
        assert found(images).overlapped.all()
        assert sum(clipped) < 2 * crowds.SAMPLE


@pytest.mark.parametrize("images", [aslant(), around()], ids=["aslant", "around"])
def test_slivers_side_by_side_overlap_nothing(images):
    overlaps = found(images)
    assert not overlaps.sampled
    assert not overlaps.overlapped.any()
    assert overlaps.pair_count == 0


@pytest.mark.parametrize("images", [aslant(), around()], ids=["aslant", "around"])
def test_one_overlap_among_slivers_is_found(images):
    images = images.copy()
    images[1000] = images[2000]
    overlaps = found(images)
    assert np.flatnonzero(overlaps.overlapped).tolist() == [1000, 2000]
    assert overlaps.pair_count == 1


def test_a_pair_beside_a_crowd_is_found_and_what_is_alone_is_not():
    apart = np.array(
        [[[5, 0], [6, 0], [5, 1]], [[5, 0.1], [6, 0], [5, 1]], [[9, 0], [10, 0], [9, 1]]]
    )
    overlaps = found(np.concatenate([apart, copies(1e-6)]))
    assert overlaps.overlapped[:2].all()
    assert not overlaps.overlapped[2]
    assert overlaps.overlapped[3:].all()


def test_one_large_face_over_crowds_of_small_ones_counts_by_its_area(monkeypatch):
    rng = np.random.default_rng(2)
    small = 1e-3 * copies(1e-3)[:600] + rng.integers(0, 3, size=(600, 1, 2))
    images = np.concatenate([[[[-9, -9], [9, -9], [0, 20.0]]], small, small[:5] * 1000])
    sampled = found(images)
    monkeypatch.setattr(overlap, "FEW_CANDIDATES", 10**9)
    exact = found(images)
    assert sampled.sampled
    assert_allclose(sampled.area.sum(), exact.area.sum(), rtol=0.01)
    assert_allclose(sampled.pair_count, exact.pair_count, rtol=0.01)
    assert (sampled.overlapped == exact.overlapped).all()


def test_a_sample_that_is_whole_gives_what_all_pairs_give(monkeypatch):
    rng = np.random.default_rng(3)
    images = rng.normal(size=(400, 1, 2)) + 0.4 * rng.normal(size=(400, 3, 2))
    monkeypatch.setattr(overlap, "FEW_CANDIDATES", 10**9)
    exact = found(images)
    monkeypatch.setattr(overlap, "FEW_CANDIDATES", 0)
    monkeypatch.setattr(overlap, "MOST_CANDIDATES", 0)
    monkeypatch.setattr(crowds, "SAMPLE", 10**6)
    whole = found(images)
    assert not whole.sampled
    assert_allclose(whole.area, exact.area, rtol=1e-12)
    assert whole.pair_count == exact.pair_count
    assert (whole.overlapped == exact.overlapped).all()
    monkeypatch.setattr(crowds, "SAMPLE", 4096)
    sampled = found(images)
    assert sampled.sampled
    assert_allclose(sampled.area.sum(), exact.area.sum(), rtol=0.03)
    assert_allclose(sampled.pair_count, exact.pair_count, rtol=0.03)
    assert (sampled.overlapped == exact.overlapped).all()


def test_estimates_hit_the_truth_on_average():
    rng = np.random.default_rng(4)
    images = rng.normal(size=(300, 1, 2)) + 0.5 * rng.normal(size=(300, 3, 2))
    tree = Hierarchy(images)
    crowd = Crowd(tree)
    i, _, weight, whole = crowd.sample()
    assert whole
    assert (weight == 1).all()
    expected = len(i)
    pytest.MonkeyPatch().setattr(crowds, "SAMPLE", 2000)
    totals = [crowd.sample()[2].sum() for _ in range(200)]
    assert_allclose(np.mean(totals), expected, rtol=0.01)


@pytest.mark.parametrize("images", [copies(0), copies(1e-6), aslant()])
def test_all_metrics_of_a_crowd_are_numbers(images):
    values = evaluate(*own_rows(images))
    assert not np.isnan(list(values.values())).any()
    assert values["bijective"] == (images.std(axis=0).max() > 0.1)


def test_vertices_that_crowd_at_one_place_are_one():
    rng = np.random.default_rng(5)
    points = np.concatenate([1e-9 * rng.random((2000, 3)), [[1, 0, 0], [1, 1e-8, 0], [0, 1, 0]]])
    place = places(points, 1e-7)
    assert (place[:2000] == place[0]).all()
    assert place[2000] == place[2001]
    assert len(set(place.tolist())) == 3


def test_points_that_crowd_at_one_place_are_scored(monkeypatch):
    rng = np.random.default_rng(6)
    points = rng.normal(size=(2000, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    uv = np.zeros((2000, 2))
    uv[:500] = points[:500, :2]
    cloud = PointCloud(points)
    exact = evaluate_points(cloud, PointParameterization(uv))
    monkeypatch.setattr(pointwise, "COUNTED", 1_000_000)
    bounded = evaluate_points(cloud, PointParameterization(uv))
    assert not np.isnan(list(exact.values())).any()
    for name, value in exact.items():
        assert_allclose(bounded[name], value, rtol=0.02, err_msg=name)


def test_nearest_others_of_a_crowd_lie_at_its_place():
    points = np.concatenate([np.zeros((50, 2)), np.random.default_rng(7).random((50, 2))])
    found = pointwise.nearest_others(pointwise.cKDTree(points), 8)
    assert (found != np.arange(100)[:, None]).all()
    assert all(len(set(row)) == 8 for row in found.tolist())
    distance = np.linalg.norm(points[found] - points[:, None], axis=2)
    all_of = np.linalg.norm(points[:, None] - points[None], axis=2)
    np.fill_diagonal(all_of, np.inf)
    assert_allclose(distance, np.sort(all_of, axis=1)[:, :8])
