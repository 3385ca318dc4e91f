import numpy as np
import pytest
from numpy.testing import assert_allclose

from benchmarks.cases.builtin import grid_faces
from benchmarks.metrics.evaluation import evaluate, evaluate_points
from benchmarks.metrics.pointwise import (
    point_map,
    point_part_area_ratio_min,
    starved_point_fraction,
)
from benchmarks.metrics.table import METRICS
from benchmarks.metrics.usability import _lines
from parapoint import InputError, Mesh, Parameterization, PointCloud, PointParameterization


def plate(columns: int, rows: int = 2) -> Mesh:
    """A flat plate of (columns - 1) x (rows - 1) unit squares, two faces each."""
    x, y = np.meshgrid(np.arange(float(columns)), np.arange(float(rows)), indexing="ij")
    faces = grid_faces(columns, rows)
    return Mesh(np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], 1), faces)


def squeezed(mesh: Mesh, places: dict[float, float]) -> Parameterization:
    """The plate with each x moved to a place; others between by interpolation."""
    uv = mesh.vertices[:, :2].copy()
    uv[:, 0] = np.interp(uv[:, 0], list(places), list(places.values()))
    return Parameterization(uv, mesh.faces)


def test_an_isometry_is_perfect():
    mesh = plate(11, 11)
    values = evaluate(mesh, Parameterization(mesh.vertices[:, :2] / 10, mesh.faces))
    for metric in METRICS.values():
        if metric.group == "use":
            assert_allclose(values[metric.name], metric.ideal, atol=1e-12, err_msg=metric.name)


def test_a_squeezed_end_is_a_starved_part_with_the_ratio_it_has():
    # 100 squares in a row, the last 10 squeezed to a tenth: 90 + 1 = 91 of UV area, so
    # r = 0.1 / 0.91 there, over 10 % of the surface.
    mesh = plate(101)
    values = evaluate(mesh, squeezed(mesh, {0: 0, 90: 90, 100: 91}))
    assert_allclose(values["part_area_ratio_min"], 0.1 / 0.91)
    assert_allclose(values["starved_area_fraction"], 0.1)
    assert_allclose(values["area_ratio_p01"], 0.1 / 0.91)


def test_parts_below_one_percent_are_starved_but_no_part():
    # Two squares of 400, apart, are half a percent each.
    mesh = plate(401)
    places = {0: 0, 100: 100, 101: 100.1, 200: 199.1, 201: 199.2, 400: 398.2}
    values = evaluate(mesh, squeezed(mesh, places))
    assert_allclose(values["starved_area_fraction"], 2 / 400)
    assert values["part_area_ratio_min"] == 1
    # Eight squares side by side are two percent: one part.
    values = evaluate(mesh, squeezed(mesh, {0: 0, 100: 100, 108: 100.8, 400: 392.8}))
    assert_allclose(values["part_area_ratio_min"], 0.1 / (392.8 / 400))


def test_parts_connect_across_seams_and_doubled_vertices():
    # The map is cut in the middle of a starved part: two charts and, where vertices are doubled,
    # two components. Each half has 0.75 % of the surface, both together 1.5 %.
    mesh = plate(401)
    whole = squeezed(mesh, {0: 0, 100: 100, 106: 100.6, 400: 394.6})
    right = mesh.vertices[mesh.faces].mean(axis=1)[:, 0] > 103
    corners = np.where(right[:, None], mesh.faces + len(mesh.vertices), mesh.faces)
    cut = Parameterization(np.concatenate([whole.uv, whole.uv + np.array([9.0, 0])]), corners)
    doubled = Mesh(np.tile(mesh.vertices, (2, 1)), corners)
    expected = 0.1 / (394.6 / 400)
    for surface in (mesh, doubled):
        values = evaluate(surface, cut)
        assert values["chart_count"] == 2
        assert_allclose(values["part_area_ratio_min"], expected)


def test_parts_that_touch_at_a_corner_alone_are_apart():
    # Two starved squares of a checkerboard of 10 x 10 squares meet at a vertex: 1 % each.
    mesh = plate(11, 11)
    centre = mesh.vertices[mesh.faces].mean(axis=1)
    small = [(np.floor(centre[:, :2]) == at).all(axis=1) for at in ([3, 3], [4, 4])]
    uv = mesh.vertices[mesh.faces][..., :2].reshape(-1, 2).copy()
    scale = np.ones(len(mesh.faces))
    scale[small[0]], scale[small[1]] = 0.2, 0.4
    uv *= np.repeat(scale, 3)[:, None]
    map_ = Parameterization(uv, np.arange(len(uv)).reshape(-1, 3))
    total = (98 + 0.2**2 + 0.4**2) / 100
    assert_allclose(evaluate(mesh, map_)["part_area_ratio_min"], 0.2**2 / total)


def test_without_spanning_the_worst_part_is_that_of_the_other_faces():
    # A tube whose map has one uv a vertex: the faces between the last and the first column reach
    # across the whole map, and shrink no part of what is left.
    angle = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    height = np.arange(20) * 0.1
    vertices = np.concatenate([np.column_stack([ring, np.full(60, z)]) for z in height])
    i, j = (a.ravel() for a in np.meshgrid(np.arange(19), np.arange(60), indexing="ij"))
    a, b, c, d = 60 * i + j, 60 * i + (j + 1) % 60, 60 * i + 60 + (j + 1) % 60, 60 * i + 60 + j
    mesh = Mesh(vertices, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]))
    uv = np.column_stack([np.tile(angle, 20), np.repeat(height, 60)])
    values = evaluate(mesh, Parameterization(uv, mesh.faces))
    assert values["spanning_fraction"] == pytest.approx(1 / 60)
    assert values["starved_area_fraction_without_spanning"] == 0
    assert_allclose(values["area_ratio_p01_without_spanning"], 1, rtol=1e-9)
    assert values["area_ratio_p01"] < 0.6  # the spanning faces take half of the UV area


def zigzag(height: float, count: int = 21) -> tuple[Mesh, Parameterization]:
    """A flat strip cut along a zigzag between its two rows of squares; its halves lie apart."""
    x = np.arange(float(count))
    middle = np.where(np.arange(count) % 2 == 1, height, -height)
    middle[[0, -1]] = -height
    rows = [np.stack([x, y, 0 * x], 1) for y in (0 * x - 2, middle, 0 * x + 2)]
    vertices = np.stack(rows, axis=1).reshape(-1, 3)
    mesh = Mesh(vertices, grid_faces(count, 3))
    upper = mesh.vertices[mesh.faces].mean(axis=1)[:, 1] > 0
    corners = np.where(upper[:, None], mesh.faces + len(vertices), mesh.faces)
    uv = np.concatenate([vertices[:, :2], vertices[:, :2] + [0, 9]])
    return mesh, Parameterization(uv, corners)


def test_a_straight_cut_is_not_jagged_and_a_saw_is_as_jagged_as_it_is():
    assert_allclose(evaluate(*zigzag(0.0))["seam_jaggedness"], 1)
    # Teeth ± h at a distance of one: each edge has √(1 + 4h²). Over five vertices the mean of
    # ± h is ± h/5, over three ± h/3; the two end vertices stay. With h = 1/2 and 20 edges there
    # are 16 between means of five, 2 between -h/5 and -h/3, and 2 from -h/3 to -h at the ends.
    h = 0.5
    middle, next_, end = (np.hypot(1, height) for height in (2 * h / 5, h / 3 - h / 5, h - h / 3))
    smooth = 16 * middle + 2 * next_ + 2 * end
    assert_allclose(
        evaluate(*zigzag(h))["seam_jaggedness"], 20 * np.hypot(1, 2 * h) / smooth, rtol=1e-12
    )


def test_a_closed_cut_is_smoothed_all_around():
    # A disk of two rings, its inner hexagon cut out whole: a regular polygon of 12 corners, each
    # replaced by the mean of five: its radius shrinks to (1 + 2 cos 30° + 2 cos 60°) / 5.
    turn = np.arange(12) * np.pi / 6
    ring = np.stack([np.cos(turn), np.sin(turn), 0 * turn], 1)
    vertices = np.concatenate([[[0, 0, 0]], ring, 2 * ring])
    k = np.arange(12)
    inner = np.stack([0 * k, 1 + k, 1 + (k + 1) % 12], 1)
    outer = np.concatenate(
        [
            np.stack([1 + k, 13 + k, 13 + (k + 1) % 12], 1),
            np.stack([1 + k, 13 + (k + 1) % 12, 1 + (k + 1) % 12], 1),
        ]
    )
    mesh = Mesh(vertices, np.concatenate([inner, outer]))
    uv = np.concatenate([vertices[:, :2], vertices[:, :2] + [5, 0]])
    corners = np.concatenate([inner, outer + len(vertices)])
    shrunk = (1 + 2 * np.cos(np.pi / 6) + 2 * np.cos(np.pi / 3)) / 5
    assert_allclose(evaluate(mesh, Parameterization(uv, corners))["seam_jaggedness"], 1 / shrunk)


def test_lines_run_from_node_to_node():
    # A T with a loop at its foot: 0-1-2-3-4, 2-5-6, 6-7-8-6, and a loop 9-10-11 by itself.
    edges = [(0, 1), (1, 2), (2, 3), (3, 4), (2, 5), (5, 6), (6, 7), (7, 8), (6, 8)]
    edges += [(9, 10), (10, 11), (9, 11)]
    lines = _lines(np.array(edges))
    found = {tuple(min(line, line[::-1])) for line in lines}
    assert {(0, 1, 2), (2, 3, 4), (2, 5, 6)} <= found
    assert sorted(map(len, lines)) == [3, 3, 3, 4, 4]
    assert sum(len(line) - 1 for line in lines) == len(edges)


def test_what_leaves_the_unit_square_and_what_turns_against_the_faces():
    mesh = plate(11, 11)
    unit = mesh.vertices[:, :2] / 10
    for uv, outside, mirrored in (
        (unit, 0, 0),
        (unit + np.array([0.25, 0]), 0.25, 0),
        (unit - [0.3, 0.4], 0.5, 0),
        (unit * [-1, 1] + [1, 0], 0, 1),
    ):
        values = evaluate(mesh, Parameterization(uv, mesh.faces))
        assert_allclose(values["uv_outside_unit"], outside, atol=1e-15)
        assert values["mirrored_area_fraction"] == mirrored
    # A quarter of the plate, a chart of its own, lies mirrored: a quarter of the UV area.
    left = mesh.vertices[mesh.faces].mean(axis=1)[:, 0] < 2.5
    chart = Parameterization(
        np.concatenate([unit, unit * [-1, 1]]),
        np.where(left[:, None], mesh.faces + len(unit), mesh.faces),
    )
    assert_allclose(evaluate(mesh, chart)["mirrored_area_fraction"], left.mean(), rtol=1e-12)


def test_faces_without_a_uv_are_left_out_and_counted():
    mesh = plate(11)
    uv = mesh.vertices[:, :2] * [1, 3]
    whole = evaluate(mesh, Parameterization(uv, mesh.faces))
    holed = uv.copy()
    holed[mesh.vertices[:, 0] == 10] = np.nan  # the last of ten squares
    values = evaluate(mesh, Parameterization(holed, mesh.faces))
    assert_allclose(values["coverage"], 0.9)
    assert not any(np.isnan(value) for value in values.values())
    assert_allclose(values["quasi_conformal_mean"], whole["quasi_conformal_mean"])
    assert whole["coverage"] == 1
    with pytest.raises(InputError, match="covers no face"):
        evaluate(mesh, Parameterization(np.full_like(uv, np.nan), mesh.faces))


@pytest.mark.parametrize("bad", [[np.nan, 1.0], [np.inf, np.inf], [np.inf, np.nan]])
def test_a_row_of_uv_is_finite_or_left_out_whole(bad):
    mesh = plate(3)
    uv = mesh.vertices[:, :2].copy()
    uv[2] = bad
    with pytest.raises(InputError, match="uv must be finite; row 2"):
        Parameterization(uv, mesh.faces)
    with pytest.raises(InputError, match="uv must be finite; row 2"):
        PointParameterization(uv)


def grid_cloud(side: int = 40) -> np.ndarray:
    x, y = np.meshgrid(np.arange(float(side)), np.arange(float(side)), indexing="ij")
    return np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1)


def test_a_cloud_s_starved_part_is_found_without_faces():
    # The last 8 of 40 columns are squeezed to a tenth along x. Local areas are 1 and 0.1, and
    # about 8/40 of the points are starved; their mean ratio is 0.1 over the mean of all.
    points = grid_cloud()
    uv = points[:, :2].copy()
    uv[:, 0] = np.interp(uv[:, 0], [0, 31, 39], [0, 31, 31.8])
    cloud = PointCloud(points)
    state = point_map(cloud, PointParameterization(uv))
    assert starved_point_fraction(state) == pytest.approx(8 / 40, abs=0.03)
    assert point_part_area_ratio_min(state) == pytest.approx(0.1 / 0.82, rel=0.1)
    even = point_map(cloud, PointParameterization(points[:, :2]))
    assert (starved_point_fraction(even), point_part_area_ratio_min(even)) == (0, 1)


def test_stray_points_without_a_uv_are_left_out_and_counted():
    points = np.concatenate([grid_cloud(10), [[50.0, 0, 0]]])
    uv = points[:, :2].copy()
    uv[-1] = np.nan
    values = evaluate_points(PointCloud(points), PointParameterization(uv))
    assert_allclose(values["coverage"], 100 / 101)
    assert_allclose(values["local_quasi_conformal_mean"], 1)
    none = PointParameterization(np.full((101, 2), np.nan))
    with pytest.raises(InputError, match="a place for 0 points"):
        evaluate_points(PointCloud(points), none)
