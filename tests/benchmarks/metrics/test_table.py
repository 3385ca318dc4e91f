"""The registry, the invariances that all metrics share, and what they say of hopeless input."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from benchmarks.cases import builtin
from benchmarks.metrics import state
from benchmarks.metrics.evaluation import evaluate, evaluate_points
from benchmarks.metrics.metric import GROUPS, WITHOUT_SPANNING
from benchmarks.metrics.table import METRICS
from parapoint import InputError, Mesh, Parameterization
from parapoint.surfaces.parameterization import PointParameterization
from parapoint.surfaces.surface import PointCloud

NAMES = {
    "angle_difference_mean",
    "angle_difference_area_weighted",
    "angle_difference_p95",
    "angle_difference_max",
    "angle_discrepancy_total",
    "angle_distortion_max",
    "quasi_conformal_mean",
    "quasi_conformal_p95",
    "quasi_conformal_max",
    "area_discrepancy_total",
    "area_distortion_max",
    "area_log_ratio_mean",
    "area_ratio_clipped_mean",
    "symmetric_dirichlet",
    "stretch_l2",
    "stretch_linf",
    "isometric_distortion_mean",
    "isometric_distortion_max",
    "singular_value_min",
    "singular_value_max",
    "flipped_fraction",
    "flipped_fraction_global",
    "flipped_uv_area_fraction",
    "degenerate_uv_count",
    "degenerate_3d_count",
    "overlap_area",
    "overlap_pair_fraction",
    "overlapped_fraction",
    "bijective",
    "spanning_fraction",
    "chart_count",
    "seam_length",
    "uv_boundary_length",
    "packing_efficiency",
    "resolution",
    "artist_correlation",
    "seam_excess",
    "local_quasi_conformal_mean",
    "local_area_log_ratio_mean",
    "neighbour_preservation",
    "neighbour_trustworthiness",
    "neighbour_continuity",
    "uv_collision_fraction",
    "starved_point_fraction",
    "point_part_area_ratio_min",
    "flipped_area_fraction",
    "area_ratio_p01",
    "part_area_ratio_min",
    "starved_area_fraction",
    "seam_jaggedness",
    "uv_outside_unit",
    "mirrored_area_fraction",
    "coverage",
    "seam_point_fraction",
    "spanning_point_fraction",
}


TWICE = {
    "flipped_fraction",
    "flipped_area_fraction",
    "flipped_uv_area_fraction",
    "overlap_area",
    "area_ratio_p01",
    "part_area_ratio_min",
    "starved_area_fraction",
}
"""Those of the validity metrics that stand without the spanning faces, too."""


def two_charts(seed, flips=False):
    """A bumpy sheet in two charts, the second mirrored, mapped with some distortion."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(6.0), np.arange(5.0), indexing="ij")
    flat = np.stack([x.ravel(), y.ravel()], 1)
    faces = builtin.grid_faces(6, 5)
    vertices = np.column_stack([flat, 0.3 * rng.normal(size=len(flat))])
    image = flat + rng.uniform(-1, 1, flat.shape) * (0.9 if flips else 0.2)
    second = flat[faces].mean(axis=1)[:, 0] > 3
    uv = np.concatenate([image, image * [-1, 1] + [-2, 0.3]])
    return Mesh(vertices, faces), Parameterization(uv, faces + len(flat) * second[:, None])


def test_the_registry_has_every_metric_and_says_all_about_it():
    assert set(METRICS) == NAMES | {n for n in METRICS if n.endswith(WITHOUT_SPANNING)}
    for name, metric in METRICS.items():
        assert metric.name == name
        assert metric.label
        assert metric.weighting
        assert metric.source
        assert metric.better in ("lower", "higher")
        assert metric.group in GROUPS
        twin = name + WITHOUT_SPANNING in METRICS
        if not name.endswith(WITHOUT_SPANNING) and metric.group != "points":
            assert twin == (metric.group in ("conformal", "authalic", "isometric") or name in TWICE)
    assert METRICS["symmetric_dirichlet"].heading == "symmetric Dirichlet energy (areas sum to 1)"


HIGHER_IS_BETTER = {
    "singular_value_min",
    "bijective",
    "part_area_ratio_min",
    "area_ratio_p01",
    "coverage",
    "packing_efficiency",
    "neighbour_preservation",
    "neighbour_trustworthiness",
    "neighbour_continuity",
    "point_part_area_ratio_min",
}
WITHOUT_IDEAL = {
    "seam_length",
    "uv_boundary_length",
    "resolution",
    "seam_point_fraction",
    "spanning_point_fraction",
}


def test_a_square_laid_on_itself_has_every_metric_at_its_ideal():
    steps = np.linspace(0, 1, 15)
    uv = np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=2).reshape(-1, 2)
    points = np.column_stack([uv, np.zeros(len(uv))])
    faces = builtin.grid_faces(15, 15)
    square = Parameterization(uv, faces)
    values = evaluate(Mesh(points, faces), square, square)
    values |= evaluate_points(PointCloud(points), PointParameterization(uv))
    for name, metric in METRICS.items():
        root = name.removesuffix(WITHOUT_SPANNING)
        assert (metric.ideal is None) == (root in WITHOUT_IDEAL), name
        assert metric.better == ("higher" if root in HIGHER_IS_BETTER else "lower"), name
        if metric.ideal is not None:
            assert_allclose(values[name], metric.ideal, atol=1e-9, err_msg=name)


def test_the_result_has_the_names_of_the_registry_in_order():
    mesh, parameterization = two_charts(0)
    alone = evaluate(mesh, parameterization)
    both = evaluate(mesh, parameterization, parameterization)
    grouped = [m.name for m in METRICS.values() if m.group != "points"]
    assert list(both) == grouped
    assert list(alone) == [n for n in grouped if METRICS[n].group != "reference"]
    assert all(type(value) is float for value in both.values())


unit = st.floats(0, 1)


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 9),
    flips=st.booleans(),
    angle=unit,
    log_scale=st.integers(-6, 6),
    mirrored=st.booleans(),
)
def test_a_similarity_of_the_plane_changes_nothing(seed, flips, angle, log_scale, mirrored):
    mesh, parameterization = two_charts(seed, flips)
    c, s = np.cos(7 * angle), np.sin(7 * angle)
    turn = np.array([[c, s], [-s, c]]) * ([-1, 1] if mirrored else [1, 1])
    moved = Parameterization(
        10.0**log_scale * (parameterization.uv @ turn + [3, -1]), parameterization.corners
    )
    before, after = evaluate(mesh, parameterization), evaluate(mesh, moved)
    for name, value in before.items():
        # The box turns not with the map.
        if name not in ("packing_efficiency", "resolution", *OF_THE_PLACE):
            assert_allclose(after[name], value, rtol=1e-8, atol=1e-12, err_msg=name)


OF_THE_PLACE = ("uv_outside_unit", "mirrored_area_fraction")
"""Metrics of where a map lies and which way it turns."""


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 9), flips=st.booleans(), order=st.randoms(use_true_random=False))
def test_relabelling_changes_nothing(seed, flips, order):
    mesh, parameterization = two_charts(seed, flips)

    def shuffled(count):
        return np.array(order.sample(range(count), count))

    vertex, row = shuffled(len(mesh.vertices)), shuffled(len(parameterization.uv))
    face = shuffled(len(mesh.faces))
    turn = np.array([[(k + order.randrange(3)) % 3 for k in [0]] for _ in face]) + np.arange(3)
    faces = np.take_along_axis(np.argsort(vertex)[mesh.faces][face], turn % 3, axis=1)
    corners = np.take_along_axis(np.argsort(row)[parameterization.corners][face], turn % 3, axis=1)
    before = evaluate(mesh, parameterization)
    after = evaluate(
        Mesh(mesh.vertices[vertex], faces), Parameterization(parameterization.uv[row], corners)
    )
    for name, value in before.items():
        assert_allclose(after[name], value, rtol=1e-9, atol=1e-12, err_msg=name)


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 9), flips=st.booleans())
def test_mirroring_a_chart_changes_nothing_but_the_global_count(seed, flips):
    mesh, parameterization = two_charts(seed, flips)
    half = len(parameterization.uv) // 2
    rows = np.unique(parameterization.corners[parameterization.corners >= half])
    uv = parameterization.uv.copy()
    uv[rows, 0] = uv[rows, 0].min() + uv[rows, 0].max() - uv[rows, 0]
    before = evaluate(mesh, parameterization)
    after = evaluate(mesh, Parameterization(uv, parameterization.corners))
    for name, value in before.items():
        if name not in ("flipped_fraction_global", *OF_THE_PLACE):
            # The part of the packing under overlapping faces is integrated along scanlines.
            rtol = 1e-3 if name == "packing_efficiency" else 1e-9
            assert_allclose(after[name], value, rtol=rtol, atol=1e-12, err_msg=name)


@settings(max_examples=25, deadline=None)
@given(
    rows=st.lists(
        st.tuples(st.integers(-2, 2), st.integers(-2, 2)).map(
            lambda uv: (uv[0] * 1.0, uv[1] * 1.0)
        ),
        min_size=9,
        max_size=9,
    ),
    flat=st.booleans(),
)
def test_no_map_has_nan(rows, flat):
    # Lattice points: many collapsed, folded and stacked faces; the surface may be a line itself.
    x, y = np.meshgrid(np.arange(3.0), np.arange(3.0), indexing="ij")
    mesh = Mesh(np.stack([x.ravel(), y.ravel() * flat, 0 * x.ravel()], 1), builtin.grid_faces(3, 3))
    parameterization = Parameterization(np.array(rows, dtype=float), mesh.faces)
    values = evaluate(mesh, parameterization, parameterization)
    assert not any(np.isnan(value) for value in values.values())
    assert values["degenerate_uv_count"] + values["degenerate_3d_count"] <= 8


def test_a_map_to_a_point_has_finite_counts_and_infinite_maxima():
    mesh, parameterization = two_charts(0)
    values = evaluate(
        mesh, Parameterization(np.zeros_like(parameterization.uv), parameterization.corners)
    )
    assert values["degenerate_uv_count"] == len(mesh.faces)
    assert values["degenerate_3d_count"] == 0
    assert values["bijective"] == 0
    assert values["overlap_area"] == 0
    assert values["singular_value_min"] == 0
    for name, metric in METRICS.items():
        if metric.group in ("conformal", "authalic", "isometric") and metric.better == "lower":
            assert values[name] == np.inf, name
    assert values["resolution"] == np.inf


def test_a_surface_without_area_has_no_distortion_to_measure():
    mesh, parameterization = two_charts(0)
    values = evaluate(Mesh(np.zeros_like(mesh.vertices), mesh.faces), parameterization)
    assert values["degenerate_3d_count"] == len(mesh.faces)
    assert values["degenerate_uv_count"] == 0
    assert values["quasi_conformal_mean"] == np.inf
    assert values["singular_value_min"] == 0


def test_unreferenced_vertices_and_rows_do_not_matter():
    mesh, parameterization = two_charts(3)
    before = evaluate(mesh, parameterization)
    after = evaluate(
        Mesh(np.concatenate([mesh.vertices, [[9e9, 0, 0]]]), mesh.faces),
        Parameterization(
            np.concatenate([parameterization.uv, [[-9e9, 0]]]), parameterization.corners
        ),
    )
    for name, value in before.items():
        assert_allclose(after[name], value, rtol=1e-9, err_msg=name)


def test_a_map_of_other_faces_is_refused():
    mesh, parameterization = two_charts(0)
    short = Parameterization(parameterization.uv, parameterization.corners[:-1])
    with pytest.raises(InputError, match="the map has 39 faces, the mesh 40"):
        evaluate(mesh, short)
    with pytest.raises(InputError, match="the reference has 39 faces"):
        evaluate(mesh, parameterization, short)


def without_face(parameterization, face):
    """The map with a row of uv for each corner, and none for one face."""
    uv = parameterization.uv[parameterization.corners]
    uv[face] = np.nan
    return Parameterization(uv.reshape(-1, 2), np.arange(3 * len(uv)).reshape(-1, 3))


def test_a_reference_that_leaves_faces_out_is_refused():
    mesh, parameterization = two_charts(0)
    partial = without_face(parameterization, 5)
    with pytest.raises(InputError, match="the reference leaves out 1 of the faces that the map"):
        evaluate(mesh, parameterization, partial)
    # What the map leaves out, the reference may leave out, too.
    assert evaluate(mesh, partial, partial)["artist_correlation"] == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize(
    "name", [name for name in METRICS if METRICS[name].group not in ("points", "reference")]
)
def test_no_metric_is_nan_where_every_face_spans_a_seam(name):
    mesh, parameterization = two_charts(0)
    spanned = state.MapState(mesh, parameterization)
    vars(spanned)["spanning"] = np.ones(len(mesh.faces), dtype=bool)
    assert not np.isnan(METRICS[name].function(spanned))


def planar_map(factors):
    """A strip of unit squares, the images stretched by a factor a square, one chart each."""
    uv, corners, points, faces = [], [], [], []
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
    for k, (u, v) in enumerate(factors):
        points.append(square + np.array([2.0 * k, 0]))
        uv.append(square * [u, v] + np.array([20.0 * k, 0]))
        faces += [[4 * k, 4 * k + 1, 4 * k + 2], [4 * k, 4 * k + 2, 4 * k + 3]]
        corners = faces
    flat = np.concatenate(points)
    return Mesh(np.column_stack([flat, 0 * flat[:, 0]]), faces), Parameterization(
        np.concatenate(uv), corners
    )


def test_artist_correlation_by_hand():
    mesh, ours = planar_map([(1, 1), (np.e, np.e)])
    assert evaluate(mesh, ours, ours)["artist_correlation"] == pytest.approx(0, abs=1e-12)
    # log sigma is (0, 1) against (1, 0): correlation -1.
    opposite = planar_map([(np.e, np.e), (1, 1)])[1]
    assert_allclose(evaluate(mesh, ours, opposite)["artist_correlation"], 2, rtol=1e-12)
    # (0, 0, 1, 1) against (1, 0, 1, 0), larger values first: no correlation.
    across = planar_map([(np.e, 1), (1, np.e)])[1]
    assert_allclose(evaluate(mesh, ours, across)["artist_correlation"], 1, rtol=1e-12)
    # Nothing varies in an isometry.
    same = planar_map([(1, 1), (1, 1)])[1]
    assert evaluate(mesh, same, same)["artist_correlation"] == 0
    assert evaluate(mesh, ours, same)["artist_correlation"] == 1
    point = Parameterization(np.zeros_like(ours.uv), ours.corners)
    assert evaluate(mesh, ours, point)["artist_correlation"] == np.inf


def test_seam_excess_is_what_the_cut_is_longer():
    mesh = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    whole = Parameterization(mesh.vertices[:, :2], mesh.faces)
    cut = Parameterization(np.tile(mesh.vertices[:, :2], (2, 1)), mesh.faces + np.array([[0], [4]]))
    assert_allclose(evaluate(mesh, cut, whole)["seam_excess"], np.sqrt(2), rtol=1e-12)
    assert evaluate(mesh, whole, cut)["seam_excess"] == 0


def test_what_metrics_share_is_computed_once(monkeypatch):
    mesh, parameterization = two_charts(0)
    calls = []
    original = state.triangles
    monkeypatch.setattr(state, "triangles", lambda *a: calls.append(1) or original(*a))
    evaluate(mesh, parameterization)
    assert len(calls) == 1
