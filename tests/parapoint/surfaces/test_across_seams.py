"""Which edges lie across a seam, and what becomes of their faces: grids with known answers."""

import numpy as np
import pytest

from parapoint.surfaces import across_seams
from parapoint.surfaces.across_seams import edges_across_seam, learned_seam, opened
from parapoint.surfaces.surface import Mesh


def grid(columns: int, rows: int) -> Mesh:
    """Vertices at whole x and y, x by x, in squares whose diagonals go up to the right."""
    x, y = (of.ravel() for of in np.indices((columns, rows)))
    a = (rows * np.arange(columns - 1)[:, None] + np.arange(rows - 1)).ravel()
    b, c, d = a + rows, a + rows + 1, a + 1
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return Mesh(np.stack([x, y, 0 * x], axis=1), faces)


@pytest.mark.parametrize(
    ("columns", "shift", "is_across"),
    [
        (101, 4.5, True),  # 5.5 times as long as it was, and 5 % of the box
        (101, 3.5, False),  # 4.5 times: that may be the map
        (1001, 4.5, False),  # 0.5 % of the box: too short to see
    ],
)
def test_an_edge_across_is_five_times_its_length_and_a_hundredth_of_the_box(
    columns: int, shift: float, is_across: bool
) -> None:
    # What is right of the middle is moved to the right. A diagonal across becomes √(1 + 5.5²) / √2,
    # less than 4 times as long, so three straight edges may lie across.
    mesh = grid(columns, 3)
    uv = mesh.vertices[:, :2] + [shift, 0] * (mesh.vertices[:, :1] > 50)
    ends = mesh.vertices[mesh.edges]
    across = (ends[:, :, 0].sum(axis=1) == 101) & (ends[:, 0, 1] == ends[:, 1, 1])
    assert across.sum() == 3
    assert np.array_equal(edges_across_seam(mesh, uv), across & is_across)


def test_one_calm_end_is_enough() -> None:
    # One vertex is moved away: all its six edges are long, but the other ends have calm ones.
    mesh = grid(9, 9)
    uv = mesh.vertices[:, :2].copy()
    uv[40] += [30, 10]
    assert np.array_equal(edges_across_seam(mesh, uv), (mesh.edges == 40).any(axis=1))


def test_a_third_of_the_edges_makes_an_end_calm() -> None:
    # Two columns beside each other are moved apart. Of the six edges of an inner vertex of theirs
    # only the two along the column are calm, yet the four others all lie across.
    mesh = grid(9, 9)
    x, y = mesh.vertices[:, 0], mesh.vertices[:, 1]
    uv = mesh.vertices[:, :2] + np.where(x == 4, 30, np.where(x == 5, -60, 0))[:, None]
    inner = ((y[mesh.edges] > 0) & (y[mesh.edges] < 8)).all(axis=1)
    left, right = np.sort(x[mesh.edges], axis=1).T
    spans = (left < right) & (left >= 3) & (right <= 6)
    assert np.array_equal(edges_across_seam(mesh, uv)[inner], spans[inner])


@pytest.mark.parametrize("mirror", [1, -1])
def test_faces_across_are_turned_as_the_others(mirror: int) -> None:
    mesh = grid(21, 3)
    uv = (mesh.vertices[:, :2] + [30, 50] * (mesh.vertices[:, :1] > 10)) * [mirror, 1]
    result = opened(mesh, uv, edges_across_seam(mesh, uv))
    a, b, c = (result.uv[result.corners[:, k]] for k in range(3))
    first, second = b - a, c - a
    area = (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / 2
    np.testing.assert_allclose(area, mirror / 2)


def test_a_seam_follows_the_tear_where_another_cut_is_shorter() -> None:
    # The tear goes from (0, 5) on the rim to (20, 5): what is below is moved down, less and less to
    # the right. From the lower rim its end is 5 away and not 20; but off the tear cuts cost ten
    # times as much.
    mesh = grid(31, 31)
    x, y = mesh.vertices[:, 0], mesh.vertices[:, 1]
    uv = np.stack([x, y - 3 * ((x < 20) & (y < 5)) * (20 - x)], axis=1)
    seam = learned_seam(mesh, uv)
    x, y = x[mesh.edges[seam]], y[mesh.edges[seam]]
    assert x.min() == 0
    assert x.max() >= 17
    assert (np.abs(y - 4.5) <= 0.5).all()


def test_the_pieces_of_an_edge_are_measured_one_by_one() -> None:
    # A triangle of sides 3, 4 and 5 whose map squares x: pieces of an edge along x grow.
    mesh = Mesh([[0, 0, 0], [3, 0, 0], [0, 4, 0]], [[0, 1, 2]])

    def squared(points):
        return points[:, :2] * np.column_stack([points[:, 0], np.ones(len(points))])

    edges = [tuple(edge) for edge in mesh.edges.tolist()]
    count = np.array([{(0, 1): 3, (0, 2): 2, (1, 2): 1}[edge] for edge in edges])
    found = across_seams._piece_lengths(mesh, squared(mesh.vertices), squared, count)
    wanted = {(0, 1): [1, 3, 5], (0, 2): [2, 2], (1, 2): [np.hypot(9, 4)]}
    np.testing.assert_allclose(found, np.concatenate([wanted[edge] for edge in edges]))
    whole = across_seams._piece_lengths(mesh, squared(mesh.vertices), None, np.ones(3, int))
    np.testing.assert_allclose(np.sort(whole), [4, 9, np.hypot(9, 4)])


def test_an_edge_lies_across_where_one_of_its_pieces_does() -> None:
    # Between the columns 10 and 11 the map goes far away and comes back: the ends tell nothing.
    mesh = grid(21, 3)

    def around(points: np.ndarray) -> np.ndarray:
        return points[:, :2] + [100, 0] * (np.abs(points[:, :1] - 10.5) < 0.1)

    uv = around(mesh.vertices)
    spans = (mesh.vertices[mesh.edges, 0].sum(axis=1) == 21) & (
        np.ptp(mesh.vertices[mesh.edges, 0], axis=1) == 1
    )
    assert not edges_across_seam(mesh, uv).any()
    assert np.array_equal(edges_across_seam(mesh, uv, around, 0.25), spans)


def test_a_face_with_all_edges_across_is_a_chart_in_the_scale_of_the_map() -> None:
    mesh = grid(5, 5)
    uv = 2 * mesh.vertices[:, :2]
    across = np.zeros(len(mesh.edges), dtype=bool)
    across[mesh.edge_of_halfedge[3 * 12 : 3 * 13]] = True
    result = opened(mesh, uv, across)
    a, b, c = (result.uv[result.corners[:, k]] for k in range(3))
    first, second = b - a, c - a
    doubled = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    np.testing.assert_allclose(doubled, 4)
    sides = np.linalg.norm([first[12], second[12], (c - b)[12]], axis=1)
    np.testing.assert_allclose(np.sort(sides), [2, 2, 8**0.5])
    assert np.bincount(result.corners.ravel())[result.corners[12]].tolist() == [1, 1, 1]


def test_faces_that_all_lie_across_are_charts_as_large_as_in_space() -> None:
    mesh = grid(3, 3)
    result = opened(mesh, mesh.vertices[:, 1::-1], np.ones(len(mesh.edges), dtype=bool))
    a, b, c = (result.uv[result.corners[:, k]] for k in range(3))
    first, second = b - a, c - a
    np.testing.assert_allclose(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0], 1)
    assert len(np.unique(result.corners)) == 3 * len(mesh.faces)
