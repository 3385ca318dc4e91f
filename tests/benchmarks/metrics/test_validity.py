"""Flips, degenerate faces and overlap: by hand, against igl, shapely and a raster count."""

import igl
import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from benchmarks.cases import builtin
from benchmarks.metrics import overlap, validity
from benchmarks.metrics.boxes import Hierarchy
from benchmarks.metrics.distortion import triangles
from benchmarks.metrics.evaluation import evaluate
from benchmarks.metrics.state import MapState
from parapoint import Mesh, Parameterization

EXACT = 1e-12


def lifted(points):
    return np.column_stack([points, np.zeros(len(points))])


def own_rows(images):
    """Triangles (N, 3, 2) as a map with three rows of uv for each, of equal faces in 3D."""
    count = len(images)
    faces = np.arange(3 * count).reshape(-1, 3)
    one = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.0]])
    apart = np.repeat(np.arange(count), 3)[:, None] * [2.0, 0, 0]
    return Mesh(np.tile(one, (count, 1)) + apart, faces), Parameterization(
        np.asarray(images, dtype=float).reshape(-1, 2), faces
    )


def state(mesh, parameterization):
    return MapState(mesh, parameterization)


def strip(length, width=1):
    """A planar strip of unit squares, two triangles each."""
    x, y = np.meshgrid(np.arange(length + 1.0), np.arange(width + 1.0), indexing="ij")
    return np.stack([x.ravel(), y.ravel()], 1), builtin.grid_faces(length + 1, width + 1)


def test_one_mirrored_chart_of_two_is_no_flip():
    points, faces = strip(3)
    two = np.concatenate([faces, faces + len(points)])
    uv = np.concatenate([points, points * [-1, 1] + [-5, 0]])
    values = evaluate(
        Mesh(lifted(np.concatenate([points, points + 9])), two), Parameterization(uv, two)
    )
    assert values["flipped_fraction"] == 0
    assert values["flipped_fraction_global"] == 0.5
    assert values["flipped_uv_area_fraction"] == 0
    assert values["chart_count"] == 2
    assert values["bijective"] == 1


def test_the_majority_is_by_3d_area():
    # One large face against two small ones: the small ones are the flipped ones.
    points = np.array([[0, 0], [9, 0], [0, 9], [9, 1], [9.5, 1], [1, 9.0]])
    faces = np.array([[0, 1, 2], [1, 3, 2], [2, 3, 5]])
    uv = points.copy()
    uv[0] = [20, 20]  # turns the large face over
    found = state(Mesh(lifted(points), faces), Parameterization(uv, faces)).validity
    assert found.flipped.tolist() == [False, True, True]


def test_faces_that_the_mesh_itself_turns_over_are_no_flips():
    points, faces = strip(6, 5)
    uv = points.copy()
    folded = state(Mesh(lifted(points), faces), Parameterization(uv, faces)).validity
    assert not folded.flipped.any()
    odd = np.random.default_rng(3).permutation(len(faces))[:20]
    mixed = faces.copy()
    mixed[odd] = mixed[odd][:, ::-1]
    assert not state(
        Mesh(lifted(points), mixed), Parameterization(uv, mixed)
    ).validity.flipped.any()
    corner = int(np.flatnonzero((points == points.min(axis=0)).all(axis=1))[0])
    uv[corner] = points.mean(axis=0)  # a fold, whichever way its faces were written
    expected = state(Mesh(lifted(points), faces), Parameterization(uv, faces)).validity.flipped
    assert expected.any()
    found = state(Mesh(lifted(points), mixed), Parameterization(uv, mixed)).validity.flipped
    assert found.tolist() == expected.tolist()


def test_flips_agree_with_igl():
    rng = np.random.default_rng(0)
    points, faces = strip(12, 12)
    uv = points + rng.uniform(-0.9, 0.9, points.shape)
    mesh, parameterization = Mesh(lifted(points), faces), Parameterization(uv, faces)
    expected = np.zeros(len(faces), dtype=bool)
    expected[igl.flipped_triangles(uv, faces)] = True
    assert 20 < expected.sum() < len(faces) / 2
    found = state(mesh, parameterization).validity.flipped
    assert (found == expected).all()
    values = evaluate(mesh, parameterization)
    assert_allclose(values["flipped_fraction"], expected.mean(), rtol=EXACT)
    areas = np.abs(triangles(mesh, parameterization).uv_area)
    assert_allclose(values["flipped_uv_area_fraction"], areas[expected].sum() / areas.sum())


@pytest.mark.parametrize("scale", [1.0, 1e-8, 1e8])
def test_a_strip_folded_on_itself(scale):
    # Ten squares, folded after the eighth: two squares of ten lie on two others, so of the area
    # 4/10 is covered twice, and the 4 x 4 triangles there overlap.
    points, faces = strip(10)
    uv = np.where(points > [8, 9], [16, 0] - points * [1, -1], points) * scale
    values = evaluate(Mesh(lifted(points), faces), Parameterization(uv, faces))
    assert_allclose(values["overlap_area"], 0.4, rtol=1e-9)
    assert_allclose(values["overlapped_fraction"], 0.4, rtol=EXACT)
    assert_allclose(values["flipped_fraction"], 0.2, rtol=EXACT)
    assert_allclose(values["packing_efficiency"], 8 / 64, rtol=1e-4)  # scanlines
    assert values["bijective"] == 0
    assert values["chart_count"] == 1


def test_overlap_is_divided_by_the_magnification_of_each_face():
    # The second face is drawn as a copy of the first at half the size, inside it: of the first a
    # quarter is covered, of the second everything.
    large = np.array([[0, 0], [4, 0], [0, 4.0]])
    mesh, parameterization = own_rows([large, large / 2 + 0.1])
    values = evaluate(mesh, parameterization)
    assert_allclose(values["overlap_area"], (1 / 4 + 1) / 2, rtol=1e-9)
    assert values["overlap_pair_fraction"] == 1
    assert values["overlapped_fraction"] == 1


@pytest.mark.parametrize("scale", [1.0, 1e-8, 1e6])
@pytest.mark.parametrize(
    "other",
    [
        [[1, 0], [1, 1], [2, 0]],  # a vertex
        [[1, 0], [0, 1], [1, 1]],  # a whole side, other rows
        [[0, 0], [-1, 0], [0, -1]],  # a vertex, of two triangles in one line
        [[0.5, 0.5], [2, 0], [2, 2]],  # a vertex on a side
        [[0.2, 0], [0.7, 0], [0.4, -1]],  # part of a side
        [[3, 3], [4, 3], [3, 4]],  # nothing
    ],
)
def test_touching_is_no_overlap(scale, other):
    angle = 0.7
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    pair = np.array([[[0, 0], [1, 0], [0, 1.0]], other]) @ turn * scale
    found = state(*own_rows(pair)).validity
    assert found.overlaps.pair_count == 0
    assert not found.overlaps.overlapped.any()
    # Nearer by a ten-thousandth they do overlap, if only by a hundred-millionth of their area.
    pair[1] += 1e-4 * (pair[0].mean(axis=0) - pair[1].mean(axis=0))
    moved = state(*own_rows(pair)).validity.overlaps.pair_count
    assert moved == (other[0] != [3, 3])


def test_a_fan_that_winds_twice_overlaps_though_no_face_is_flipped():
    count = 12
    angle = 4 * np.pi * np.arange(count) / count
    uv = np.concatenate([[[0, 0]], np.stack([np.cos(angle), np.sin(angle)], 1)])
    ring = 1 + np.arange(count)
    faces = np.stack([np.zeros(count, dtype=int), ring, np.roll(ring, -1)], 1)
    flat = 2 * np.pi * np.arange(count) / count
    vertices = np.concatenate(
        [[[0, 0, 0]], np.stack([np.cos(flat), np.sin(flat), np.zeros(count)], 1)]
    )
    values = evaluate(Mesh(vertices, faces), Parameterization(uv, faces))
    assert values["flipped_fraction"] == 0
    assert_allclose(values["overlap_area"], 1, rtol=1e-9)  # each face lies on exactly one other
    assert values["overlap_pair_fraction"] == 0  # all share the centre: neighbours
    assert values["bijective"] == 0


def test_two_fans_at_one_row_may_overlap():
    # Two fans that share only a vertex, pinched, one turned onto the other.
    uv = np.array([[0, 0], [1, 0], [1, 1], [0.8, 0.1], [0.8, 0.5]])
    faces = np.array([[0, 1, 2], [0, 3, 4]])
    found = state(Mesh(lifted(uv * [1, 3]), faces), Parameterization(uv, faces)).validity.overlaps
    assert found.pair_count == 1
    assert found.distant_pair_count == 0


def test_an_edge_with_three_faces_or_two_on_one_side_is_looked_at():
    uv = np.array([[0, 0], [1, 0], [0.5, 1], [0.4, -1], [0.6, 0.5]])
    for faces in ([[0, 1, 2], [1, 0, 3], [0, 1, 4]], [[0, 1, 2], [0, 1, 4]]):
        mesh = Mesh(lifted(uv), np.array(faces))
        found = state(mesh, Parameterization(uv, mesh.faces)).validity.overlaps
        assert found.pair_count == 1


def test_pairs_and_areas_agree_with_shapely():
    rng = np.random.default_rng(5)
    images = rng.uniform(size=(120, 3, 2)) * rng.choice([0.1, 1.0], size=(120, 1, 1))
    images += rng.uniform(size=(120, 1, 2))
    mesh, parameterization = own_rows(images)
    found = state(mesh, parameterization).validity.overlaps
    shapes = shapely.polygons(images)
    common = shapely.area(shapely.intersection(shapes[:, None], shapes[None, :]))
    np.fill_diagonal(common, 0)
    assert_allclose(found.area, common.sum(axis=1), rtol=1e-9)
    assert found.pair_count == (common > 1e-12).sum() / 2
    assert found.distant_pair_count == found.pair_count
    assert (found.overlapped == (common > 1e-12).any(axis=1)).all()


def test_areas_agree_with_a_raster_count():
    # On every cell of a fine grid, how many triangles cover it: c faces there are c (c - 1)
    # ordered pairs.
    rng = np.random.default_rng(6)
    points, faces = strip(6, 6)
    uv = points + rng.uniform(-0.8, 0.8, points.shape)
    parameterization = Parameterization(uv, faces)
    found = state(Mesh(lifted(points), faces), parameterization).validity
    low, side, cells = uv.min(axis=0), np.ptp(uv, axis=0), 700
    centre = (np.arange(cells) + 0.5) / cells
    x, y = np.meshgrid(low[0] + side[0] * centre, low[1] + side[1] * centre)
    cover = np.zeros(x.shape)
    for a, b, c in uv[faces]:
        signs = [
            (q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0])
            for p, q in ((a, b), (b, c), (c, a))
        ]
        cover += (np.minimum.reduce(signs) > 0) | (np.maximum.reduce(signs) < 0)
    cell = side.prod() / cells**2
    # The count errs by some cells along every side.
    assert_allclose(found.overlaps.area.sum(), (cover * (cover - 1)).sum() * cell, rtol=5e-3)
    assert_allclose(overlap.covered_area(uv[faces]), (cover > 0).sum() * cell, rtol=5e-3)


def test_covered_area_agrees_with_the_union_by_shapely():
    rng = np.random.default_rng(7)
    images = rng.uniform(size=(80, 3, 2)) * 0.4 + rng.uniform(size=(80, 1, 2))
    expected = shapely.union_all(shapely.polygons(images)).area
    assert_allclose(overlap.covered_area(images), expected, rtol=1e-4)  # 4096 scanlines
    assert overlap.covered_area(images[:0]) == 0


def test_candidate_pairs_are_all_pairs_of_boxes_once():
    rng = np.random.default_rng(8)
    lower = rng.uniform(size=(300, 2))
    upper = lower + rng.exponential(0.05, size=(300, 2))
    pairs = np.concatenate([np.stack(found, 1) for found in boxed(lower, upper).pairs()])
    expected = (lower[:, None] < upper[None]).all(axis=2)
    expected &= expected.T
    i, j = np.nonzero(np.triu(expected, 1))
    assert sorted(map(tuple, np.sort(pairs, axis=1).tolist())) == list(zip(i, j, strict=True))


@pytest.mark.parametrize("count", [1, 2, 3])
def test_few_boxes(count):
    lower = np.zeros((count, 2))
    found = [len(i) for i, _ in boxed(lower, lower + 1).pairs()]
    assert sum(found) == count * (count - 1) // 2


def boxed(lower, upper):
    """The hierarchy of triangles that have these boxes."""
    return Hierarchy(np.stack([lower, np.stack([upper[:, 0], lower[:, 1]], 1), upper], axis=1))


coordinate = st.integers(-6, 6)
triangle = st.lists(st.tuples(coordinate, coordinate), min_size=3, max_size=3)


@settings(max_examples=200, deadline=None)
@given(first=triangle, second=triangle, shift=st.sampled_from([0.0, 0.25, 1e-3]))
def test_any_two_triangles_against_shapely(first, second, shift):
    # On a coarse lattice triangles often share points, sides, and lines.
    images = np.array([first, second], dtype=float)
    images[1] += shift
    mesh, parameterization = own_rows(images)
    found = state(mesh, parameterization).validity
    a, b = shapely.polygons(images)
    flat = a.area == 0 or b.area == 0
    common = 0 if flat else shapely.intersection(a, b).area
    assert_allclose(found.overlaps.area, common, rtol=1e-9, atol=1e-12)
    assert found.overlaps.pair_count == (common > 1e-12)


def test_neighbours_in_a_sound_fan_are_never_compared(monkeypatch):
    mesh = builtin.sphere_cap(60, 10)
    parameterization = Parameterization(mesh.vertices[:, :2], mesh.faces)
    compared = []

    def separated(a, _, __):
        compared.append(a.shape[2])
        return np.ones(a.shape[2], dtype=bool)

    monkeypatch.setattr(overlap, "separated", separated)
    found = state(mesh, parameterization).validity.overlaps
    assert found.pair_count == 0
    assert sum(compared) < 2 * len(mesh.faces)  # each face has some 12 neighbours


def test_a_part_of_a_map_is_flipped_where_the_whole_is():
    # A strip whose last face is folded back over the one before it.
    uv = np.array([[0, 0], [1, 0], [0, 1], [1, 1], [2, 0], [1.0, 0.5]])
    corners = np.array([[0, 1, 2], [1, 3, 2], [1, 4, 3], [4, 5, 3]])
    vertices = np.column_stack([uv, np.zeros(6)])
    vertices[5] = [2, 1, 0]
    mesh = Mesh(vertices, corners)
    state = MapState(mesh, Parameterization(uv, corners)).validity
    assert state.flipped.tolist() == [False, False, False, True]
    part = state.of(np.array([False, False, False, True]))
    assert part.flipped.tolist() == [True]  # alone it would be its own majority
    assert validity.flipped_uv_area_fraction(part) == 1
    assert validity.overlap_area(part) == 0 < validity.overlap_area(state)


def test_rows_of_a_flat_sheet_are_sound_at_its_rim_too() -> None:
    """So are rows of two sheets apart; not the one at which two faces meet by a corner alone."""
    points, faces = strip(4, 3)
    apart = np.concatenate([points, points + 9])
    for uv, corners in ((points, faces), (apart, np.concatenate([faces, faces + len(points)]))):
        angle = igl.internal_angles(lifted(uv), corners)
        sign = np.ones(len(corners), dtype=np.int64)
        assert overlap.sound_fans(Parameterization(uv, corners), sign, angle).all()
    bow = np.array([[0, 0], [1, 0], [1, 1], [-1, 0], [-1, -1.0]])
    tie = np.array([[0, 1, 2], [0, 3, 4]])
    angle, sign = igl.internal_angles(lifted(bow), tie), np.ones(2, dtype=np.int64)
    found = overlap.sound_fans(Parameterization(bow, tie), sign, angle)
    assert found.tolist() == [False, True, True, True, True]


@pytest.mark.parametrize(("depth", "overlapped"), [(1e-11, 0), (1e-9, 1)])
def test_a_strip_that_rounding_could_make_is_no_overlap(depth: float, overlapped: int) -> None:
    """Two triangles side by side, the one `depth` inside the other: a share of twice as much."""
    right = [[0, 0], [1, 0], [0, 1]]
    left = [[depth, 0], [depth, 1], [-1, 0]]
    values = evaluate(*own_rows([right, left]))
    assert values["overlapped_fraction"] == overlapped
    assert values["bijective"] == 1 - overlapped
