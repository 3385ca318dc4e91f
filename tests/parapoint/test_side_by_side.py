"""A fitted map and several beside one another, with maps known by hand."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from parapoint import ComputedMap
from parapoint.fitting import Fitted, Progress, Session
from parapoint.side_by_side import GAP, fitted_side_by_side, joined, side_by_side
from parapoint.surfaces.frame import Frame
from parapoint.surfaces.parameterization import Charted, Parameterization
from parapoint.surfaces.surface import Mesh, PointCloud

SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
FACES = np.array([[0, 1, 2], [0, 2, 3]])


class Dropped:
    """Drops z, and draws all out along u by `stretch`."""

    def __init__(self, stretch=1.0, mesh=None):
        self.stretch, self.mesh = stretch, mesh

    def flatten(self, points):
        return points[:, :2] * [self.stretch, 1]

    def lift(self, uv):
        return np.column_stack([uv / [self.stretch, 1], np.zeros(len(uv))])

    def charted(self):
        if self.mesh is None:
            return None
        return Charted(self.mesh, Parameterization(self.flatten(self.mesh.vertices), FACES))

    def arrays(self):
        return {"stretch": np.array([self.stretch])}

    def facts(self):
        return {"stretch": self.stretch}


def fitted(points, stretch=1.0, mesh=None, **facts):
    """A fitted map of points in a frame of its own: its centre, and half of its largest extent."""
    frame = Frame(points.mean(axis=0), float(np.ptp(points, axis=0).max()) / 2)
    return Fitted(Dropped(stretch, mesh), frame, points, (), {"seconds": 0.25, **facts})


@pytest.mark.parametrize("unit", [1.0, 1000.0])
def test_a_map_is_in_the_unit_of_the_surface_and_back(unit):
    points = unit * (SQUARE + np.array([7, 8, 9]))
    made = fitted(points, 2.0)
    uv = made.flatten(points)
    assert_allclose(uv, unit * (SQUARE[:, :2] - 0.5) * [2, 1])
    assert_allclose(made.lift(uv), points)


def test_the_mesh_of_a_map_is_where_the_surface_is():
    points = 10 * SQUARE + [5, 0, 3]
    inside = Mesh((points - points.mean(axis=0)) / 5, FACES)
    held = fitted(points, 2.0, inside).charted()
    assert_allclose(held.mesh.vertices, points)
    assert_allclose(held.map.uv, 10 * (SQUARE[:, :2] - 0.5) * [2, 1])
    assert fitted(points).charted() is None


def test_maps_stand_on_shelves_a_gap_apart_the_highest_first():
    # Squares of sides 1 and 4, the second drawn out to a width of 8.
    parts = [fitted(SQUARE, iterations=3), fitted(4 * SQUARE + [10, 0, 5], 2.0, iterations=4)]
    whole = side_by_side(parts)
    first, second = whole.flatten(SQUARE), whole.flatten(4 * SQUARE + [10, 0, 5])
    gap = first[0, 1] - 4
    assert GAP * 8 <= gap < 2 * GAP * 8
    assert_allclose(first, SQUARE[:, :2] + [0, 4 + gap], atol=1e-12)
    assert_allclose(second, 4 * SQUARE[:, :2] * [2, 1], atol=1e-12)
    # Each place is lifted by the map that it is in, or nearest to.
    assert_allclose(whole.lift(second), 4 * SQUARE + [10, 0, 5], atol=1e-12)
    assert_allclose(whole.lift(first), SQUARE, atol=1e-12)
    near = np.array([[0.5, 4 + 0.6 * gap], [0.5, 4 + 0.4 * gap]])
    assert_allclose(whole.lift(near)[:, 2], [0, 5], atol=1e-12)


def test_many_maps_fill_most_of_their_square():
    whole = side_by_side([fitted(SQUARE + np.array([3 * k, 0, 0])) for k in range(9)])
    assert np.ptp(whole.flatten(whole.points), axis=0).max() < 4.2


def test_the_report_of_several_maps_adds_up():
    parts = [fitted(SQUARE, iterations=3), fitted(4 * SQUARE + [10, 0, 5], 2.0, iterations=4)]
    whole = side_by_side(parts)
    assert whole.report["components"] == 2
    assert (whole.report["points"], whole.report["iterations"]) == (8, 7)
    assert whole.report["seconds"] == 0.5
    assert "iterations" not in side_by_side([fitted(SQUARE), fitted(SQUARE)]).report


def test_the_report_of_several_maps_hides_no_other_start_and_no_divergence():
    starts = ["computed", "hull", "computed"]
    parts = [fitted(SQUARE, start=of, divergences=k) for k, of in enumerate(starts)]
    report = side_by_side(parts).report
    assert (report["start"], report["divergences"]) == ("computed, hull", 3)


def test_the_state_of_several_maps_names_the_component():
    parts = [fitted(SQUARE), fitted(4 * SQUARE + [10, 0, 5], 2.0)]
    whole = side_by_side(parts).map
    arrays, facts = whole.arrays(), whole.facts()["components"]
    assert_array_equal(arrays["label"], [0, 0, 0, 0, 1, 1, 1, 1])
    assert_array_equal(arrays["component1.stretch"], [2.0])
    assert_allclose(arrays["high"] - arrays["low"], [[1, 1], [8, 4]])
    assert [of["scale"] for of in facts] == [0.5, 2.0]
    assert facts[1]["centre"] == [12, 2, 5]
    assert facts[1]["facts"] == {"stretch": 2.0}
    assert facts[0]["map"] == "Dropped"


def test_meshes_are_joined_only_where_all_maps_have_one():
    inside = Mesh(2 * SQUARE - [1, 1, 0], FACES)
    one, two = fitted(SQUARE, 1.0, inside), fitted(SQUARE + np.array([3, 0, 0]), 1.0, inside)
    held = side_by_side([one, two]).charted()
    assert_allclose(held.mesh.vertices, np.concatenate([SQUARE, SQUARE + np.array([3, 0, 0])]))
    assert_array_equal(held.mesh.faces, [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    assert_allclose(np.ptp(held.map.uv[4:], axis=0), [1, 1])
    assert held.map.uv[4:, 1].min() - 1 >= GAP  # above the other
    assert side_by_side([one, fitted(SQUARE)]).charted() is None


def test_joined_meshes_count_vertices_and_rows_apart():
    torn = Parameterization(np.arange(12.0).reshape(6, 2), [[0, 1, 2], [3, 4, 5]])
    whole = Parameterization(SQUARE[:, :2], FACES)
    made = joined([Charted(Mesh(SQUARE, FACES), of) for of in (torn, whole, torn)])
    assert_array_equal(made.mesh.faces[2:4], FACES + 4)
    assert_array_equal(made.map.corners[2:4], FACES + 6)
    assert_array_equal(made.map.corners[4:], [[10, 11, 12], [13, 14, 15]])
    assert len(made.map.uv) == 16


def test_each_part_has_the_share_of_its_size_and_a_checkpoint_of_its_own(tmp_path):
    told = []

    def strategy(part, share, session):
        told.append((len(part.points), share, session.checkpoint, session.watched))
        if session.checkpoint is not None:
            session.checkpoint.mkdir(parents=True)
        return fitted(part.points)

    session = Session(checkpoint=tmp_path, watched=SQUARE)
    parts = [PointCloud(SQUARE), PointCloud(np.concatenate([SQUARE, 2 * SQUARE, 3 * SQUARE]))]
    fitted_side_by_side(strategy, parts, session)
    assert told == [
        (4, 0.25, tmp_path / "component-0", None),
        (12, 0.75, tmp_path / "component-1", None),
    ]
    assert list(tmp_path.iterdir()) == []  # empty folders do not stay
    told.clear()
    fitted_side_by_side(strategy, parts[:1], Session(watched=SQUARE))
    assert told[0][:3] == (4, 1.0, None)
    assert told[0][3] is SQUARE


def test_a_session_is_told_nothing_by_default_and_compares_without_points():
    Session().tell(Progress("training"))
    assert Session(watched=SQUARE) == Session(watched=2 * SQUARE)
    assert Session().of_component(3).checkpoint is None


def test_what_one_map_misses_gets_maps_of_its_own(caplog):
    # Each part misses its last 120 points, as long as it has more; what has 110 fails.
    told = []

    def strategy(part, share, session):
        told.append((len(part.points), round(share, 6), session.checkpoint))
        if len(part.points) == 110:
            raise RuntimeError("shows no surface")
        count = len(part.points) - 120 if len(part.points) > 300 else len(part.points)
        of = fitted(part.points[:count])
        return replace(of, missed=part.points[count:])

    far = np.repeat(np.arange(3), [400, 120, 110])[:, None] * np.array([50.0, 0, 0])
    points = np.random.default_rng(0).random((630, 3)) * [1, 1, 0] + far
    apart = [PointCloud(points[:520]), PointCloud(points[520:])]
    with pytest.raises(RuntimeError, match="no surface"):  # a part that was asked for
        fitted_side_by_side(strategy, apart, Session(), whole=True)
    told.clear()
    made = fitted_side_by_side(strategy, [PointCloud(points[:520])], Session(), whole=True)
    assert told == [(520, 1.0, None), (120, round(120 / 520, 6), None)]
    assert len(made.points) == 520
    assert "these make 1 further component: each is fitted" in caplog.messages
    told.clear()
    one = fitted_side_by_side(strategy, [PointCloud(points[:520])], Session())
    assert (len(told), len(one.points)) == (1, 400)

    def misses(part, share, session):  # the rest has 110 points, of which no map is found
        found = strategy(part, share, session)
        return replace(found, points=part.points[:-110], missed=part.points[-110:])

    caplog.clear()
    made = fitted_side_by_side(misses, [PointCloud(points[400:])], Session(), whole=True)
    assert len(made.points) == 120
    assert caplog.messages[-1] == "110 points stay without a map: shows no surface"


def test_crowns_close_above_the_ground_are_mapped_with_each_component(caplog):
    rng = np.random.default_rng(0)
    points = [np.column_stack([25 * rng.random((600, 2)), np.zeros(600)])]
    for middle in ([7, 7, 2.9], [17, 15, 2.9]):
        away = rng.normal(size=(250, 3))
        points.append(1.5 * away / np.linalg.norm(away, axis=1, keepdims=True) + middle)
    cloud = np.concatenate(points)
    model = ComputedMap(components="each").fit(cloud)
    mesh, own = model.mesh()
    assert len(mesh.vertices) == len(cloud)
    assert own.charts().max() == 2
    assert "500 of 1100 points are not on the surface that was found" in caplog.text
    assert "these make 2 further components: each is fitted" in caplog.text
