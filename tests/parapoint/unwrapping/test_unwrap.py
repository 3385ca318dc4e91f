"""The starts of a mesh's map, and which of their maps stays."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
import trimesh

from benchmarks.cases import builtin
from benchmarks.metrics.evaluation import evaluate
from parapoint import clock
from parapoint.computed.reconstruction import ReconstructionError
from parapoint.errors import InputError
from parapoint.planar import coarse, descent
from parapoint.planar.descent import sound
from parapoint.planar.domains import FlatteningError
from parapoint.surfaces.cutting import cut_along, cut_to_disk, disk_cut
from parapoint.surfaces.surface import Mesh
from parapoint.testing import irregular_disk, sphere
from parapoint.unwrapping import unwrap
from parapoint.unwrapping.unwrap import Unwrap

CAP = builtin.sphere_cap(150, rings=5)


@pytest.fixture
def runs(monkeypatch):
    """The maps grown from each start, as they come."""
    tried, found = Unwrap._tried, []

    def kept(self, mesh, start, deadline):
        begun = tried(self, mesh, start, deadline)
        found.append(begun.run)
        return begun

    monkeypatch.setattr(Unwrap, "_tried", kept)
    return found


@pytest.fixture
def settled(monkeypatch):
    """The faces of each whole mesh that was brought down; those above 100 faces are led by 60."""
    monkeypatch.setattr(unwrap, "LARGE", 100)
    monkeypatch.setattr(coarse, "COARSE", 60)
    real, found = unwrap._settled, []

    def kept(domain, tips, deadline):
        found.append(len(domain.faces))
        return real(domain, tips, deadline)

    monkeypatch.setattr(unwrap, "_settled", kept)
    return found


def seam_of(run, mesh: Mesh) -> float:
    """Length of the seam in roots of the area: both of its sides are in the rim."""
    before = mesh.vertices[mesh.edges[mesh.edge_face_count == 1]]
    rim = np.linalg.norm(before[:, 0] - before[:, 1], axis=1).sum()
    return (run.rim - rim) / 2 / math.sqrt(mesh.face_areas.sum())


@pytest.mark.parametrize(
    ("mesh", "price"), [(CAP, 0.2), (CAP, 1.0), (sphere(), 1.0), (builtin.torus(8), 1.0)]
)
def test_of_two_starts_the_map_of_less_energy_and_seam_stays(runs, mesh, price) -> None:
    made = Unwrap(price=price).parameterize(mesh, seed=0)
    assert len(runs) >= 2
    costs = [run.energy + price * seam_of(run, mesh) for run in runs]
    best = runs[int(np.argmin(costs))]
    np.testing.assert_array_equal(made.corners, best.mesh.faces)


def test_a_surface_with_two_rims_is_opened_from_one_to_the_other(runs) -> None:
    """A band around a ball: seams that grow from its rims were longer and opened it less."""
    ball = builtin.sphere_cap(160, rings=7)
    band = sound(Mesh(ball.vertices, ball.faces[(ball.faces > 0).all(axis=1)]))
    assert len(band.boundary_loops) == 2
    made = Unwrap().parameterize(band, seed=0)
    assert len(runs) == 3
    shortest = _map_along(band, disk_cut(band))
    assert made.report["end_energy"] <= shortest.energy
    costs = [run.energy + seam_of(run, band) for run in runs]
    assert costs[1] <= shortest.energy + seam_of(shortest, band)
    assert made.report["end_energy"] == runs[int(np.argmin(costs))].energy


def _map_along(mesh: Mesh, seam) -> descent.Run:
    """The settled map of a mesh cut along some edges."""
    run = descent.Run(cut_along(mesh, mesh.edges[seam]))
    run.begin()
    run.improve()
    return run


def test_under_a_bound_the_shortest_of_three_seams_stays(monkeypatch, runs) -> None:
    monkeypatch.setattr(unwrap, "ENOUGH_POINTS", 400)
    made = Unwrap(max_distortion=4.6).parameterize(CAP, seed=0)
    assert len(runs) == 3
    met = [run for run in runs if run.energy <= 4.6]
    assert made.report["end_energy"] == min(met, key=lambda run: run.rim).energy
    runs.clear()
    without = Unwrap(price=None, max_distortion=4.6).parameterize(CAP, seed=0)
    assert without.report == made.report


def test_slender_faces_are_opened_along_a_map_of_points(monkeypatch) -> None:
    for name in ("map_of_faces", "_map_of_points"):

        def fails(*_, name=name):
            raise ReconstructionError(name)

        monkeypatch.setattr(unwrap, name, fails)
    slender = Mesh(CAP.vertices * [1, 1, 500], CAP.faces)
    for mesh, name in ((CAP, "map_of_faces"), (slender, "_map_of_points")):
        result = Unwrap(price=None).parameterize(mesh, seed=0)
        assert result.report["computed"] == {"failed": name}


def test_a_map_without_a_seam_is_the_last(runs) -> None:
    bent = irregular_disk()
    for method in (Unwrap(), Unwrap(max_distortion=4.1)):
        runs.clear()
        method.parameterize(Mesh(bent.vertices * [1, 1, 0], bent.faces), seed=0)
        assert len(runs) == 1


@pytest.mark.parametrize("failing", [1, 2])
def test_one_start_that_fails_is_none(monkeypatch, failing) -> None:
    """As on a tube so thin that Tutte's embedding of its end collapses."""
    begin, calls = descent.Run.begin, []

    def one_fails(run):
        calls.append(len(run.mesh.vertices))
        if len(calls) == failing:
            raise FlatteningError("collapsed")
        begin(run)

    monkeypatch.setattr(descent.Run, "begin", one_fails)
    result = Unwrap().parameterize(CAP, seed=0)
    assert len(calls) >= 2
    assert ("not_asked" in result.report["computed"]) == (failing == 2)
    assert evaluate(CAP, result)["bijective"] == 1


def test_where_all_starts_fail_the_last_fault_is_told(monkeypatch) -> None:
    def fails(_):
        raise FlatteningError("collapsed")

    monkeypatch.setattr(descent.Run, "begin", fails)
    with pytest.raises(FlatteningError, match="collapsed"):
        Unwrap().parameterize(CAP, seed=0)


@pytest.mark.parametrize(("budget", "starts"), [(50, 1), (200, 1), (250, 2), (None, 2)])
def test_a_start_begins_where_as_much_time_is_left_as_another_took(
    monkeypatch, runs, budget, starts
) -> None:
    now = [0.0]
    monkeypatch.setattr(clock, "worked", lambda: now[0])
    tried = Unwrap._tried

    def slow(self, mesh, start, deadline):
        made = tried(self, mesh, start, deadline)
        now[0] += 100
        return made

    monkeypatch.setattr(Unwrap, "_tried", slow)
    Unwrap(time_budget=budget).parameterize(CAP, seed=0)
    assert len(runs) == starts


@pytest.mark.parametrize("error", [ReconstructionError, InputError])
def test_where_no_map_tells_a_seam_the_automatic_cut_opens_the_mesh(error, monkeypatch):
    def fails(*_):
        raise error("no flat map")

    monkeypatch.setattr(unwrap, "map_of_faces", fails)
    result = Unwrap(price=None).parameterize(sphere(), seed=0)
    assert result.report["computed"] == {"failed": "no flat map"}
    automatic = cut_to_disk(sphere())
    assert len(result.uv) == len(automatic.vertices)


@pytest.mark.parametrize("stretch", [1e-2, 1e4])
def test_a_surface_whose_points_lie_along_a_curve_or_a_plane_is_mapped(
    stretch, monkeypatch
) -> None:
    monkeypatch.setattr(unwrap, "ENOUGH_POINTS", 400)
    mesh = Mesh(sphere().vertices * [1, 1, stretch], sphere().faces)
    made = Unwrap().parameterize(mesh, seed=0)
    assert made.report["bijective"]


def test_a_large_mesh_is_brought_down_from_the_better_start_alone(runs, settled) -> None:
    mesh = sphere()
    made = Unwrap().parameterize(mesh, seed=0)
    assert [len(run.mesh.faces) for run in runs] == [60, 60]
    assert settled == [len(mesh.faces)]
    costs = [run.energy + seam_of(run, mesh) for run in runs]
    is_least_cut = "not_asked" in made.report["computed"]
    assert is_least_cut == (costs[0] < costs[1])
    assert made.report["branches_added"] == runs[int(np.argmin(costs))].branches
    assert evaluate(mesh, made)["bijective"] == 1


def test_a_better_start_that_fails_leaves_a_large_mesh_to_the_other(
    monkeypatch, runs, settled
) -> None:
    begin, calls = descent.Run.begin, []

    def fails_once(run):
        if len(run.mesh.faces) > 100:
            calls.append(run)
            if len(calls) == 1:
                raise FlatteningError("collapsed")
        begin(run)

    monkeypatch.setattr(descent.Run, "begin", fails_once)
    mesh = sphere()
    made = Unwrap().parameterize(mesh, seed=0)
    costs = [run.energy + seam_of(run, mesh) for run in runs]
    assert ("not_asked" in made.report["computed"]) == (costs[0] > costs[1])
    assert settled == [len(mesh.faces)] * 2


def test_a_large_mesh_that_cannot_be_simplified_is_brought_down_from_both_starts(
    monkeypatch, runs, settled
) -> None:
    monkeypatch.setattr(coarse, "simplified", lambda *_: None)
    mesh = sphere()
    made = Unwrap().parameterize(mesh, seed=0)
    assert settled == [len(mesh.faces)] * 2
    best = min(runs, key=lambda run: run.energy + seam_of(run, mesh))
    np.testing.assert_array_equal(made.corners, best.mesh.faces)


@pytest.mark.parametrize("apart", [0, 1e-16])
@pytest.mark.parametrize("split", ["meridian", "soup"])
def test_seams_of_an_older_map_are_not_left_in_the_mesh(split, apart) -> None:
    """Vertices doubled along an old seam, or at all corners, are unwrapped as the closed ball."""
    ball = sphere()
    if split == "soup":
        vertices, faces = ball.vertices[ball.faces.reshape(-1)], np.arange(ball.faces.size)
    else:
        opened = cut_to_disk(ball)
        vertices, faces = opened.vertices, opened.faces
    doubled = Mesh(vertices + apart * (np.arange(len(vertices)) % 2)[:, None], faces.reshape(-1, 3))
    closed = Unwrap().unwrapped(ball)
    found = Unwrap().unwrapped(doubled)
    now, before = (evaluate(mesh, of) for mesh, of in ((doubled, found), (ball, closed)))
    for name in ("seam_length", "symmetric_dirichlet", "chart_count", "bijective"):
        assert now[name] == pytest.approx(before[name], rel=1e-3), name


def _band(axis: np.ndarray, across: np.ndarray, widths: np.ndarray, *, closed: bool) -> Mesh:
    """A ribbon along an axis (n, 3), on either side of it; the last line of points is the first."""
    lines = axis[:, None] + widths[:, None] * across[:, None]
    mesh = Mesh(lines.reshape(-1, 3), builtin.grid_faces(len(axis), len(widths)))
    return mesh.welded if closed else mesh


def _twisted() -> Mesh:
    x = np.linspace(0, 150, 201)
    across = np.stack([0 * x, np.cos(0.2 * x), np.sin(0.2 * x)], 1)
    return _band(np.stack([x, 0 * x, 0 * x], 1), across, np.linspace(-1, 1, 4), closed=False)


def _one_sided() -> Mesh:
    """A long strip of Moebius."""
    angle = np.linspace(0, 2 * np.pi, 301)
    out = np.stack([np.cos(angle), np.sin(angle), 0 * angle], 1)
    across = np.cos(angle / 2)[:, None] * out + np.sin(angle / 2)[:, None] * [0, 0, 1]
    axis, across = 30 * out, np.where(abs(across) < 1e-15, 0, across)
    axis[-1], across[-1] = axis[0], -across[0]
    return _band(axis, across, np.array([-1.0, 0, 1]), closed=True)


def _coil() -> Mesh:
    """A wire of six sides, wound like a spring, open at both ends."""
    angle = np.linspace(0, 2 * np.pi * 4, 161)
    out = np.stack([np.cos(angle), np.sin(angle), 0 * angle], 1)
    axis = 10 * out + np.stack([0 * angle, 0 * angle, 0.6 * angle], 1)
    side = np.linspace(0, 2 * np.pi, 7)[:-1]
    ring = np.cos(side)[:, None] * out[:, None] + np.sin(side)[:, None] * [0, 0, 1]
    rows = np.arange(len(axis) * 6).reshape(-1, 6)[:, [*range(6), 0]]
    faces = rows.reshape(-1)[builtin.grid_faces(len(axis), 7)]
    return Mesh((axis[:, None] + ring).reshape(-1, 3), faces)


@pytest.mark.parametrize("shape", [_twisted, _one_sided, _coil])
def test_long_and_thin_surfaces_are_hardly_distorted_anywhere(shape) -> None:
    mesh = shape()
    found = evaluate(mesh, Unwrap().unwrapped(mesh))
    assert found["flipped_fraction"] == found["overlap_area"] == 0
    assert found["symmetric_dirichlet"] == pytest.approx(4, abs=0.03)
    assert found["angle_difference_max"] < 0.2


def test_a_thin_plate_with_holes_is_opened_around_one_side_at_first(runs) -> None:
    outline = shapely.Point(0, 0).buffer(10, 4)
    for x in (-5, 5):
        outline = outline.difference(shapely.Point(x, 0).buffer(1, 2))
    plate = trimesh.creation.extrude_polygon(outline, 0.01)
    mesh = Mesh(plate.vertices, plate.faces)
    found = evaluate(mesh, Unwrap().unwrapped(mesh))
    assert found["flipped_fraction"] == found["overlap_area"] == found["starved_area_fraction"] == 0
    assert found["symmetric_dirichlet"] < 4.1  # 4.36 along the least cut
    assert runs[0].energy < 4.1  # so that little time is enough
