"""Seamster: its terminals, what is seen, the tree that joins them, and what the seam changes."""

import numpy as np
import pytest

from baselines import seamster
from baselines.hybrid import AutomaticSLIM
from baselines.seamster import HIDDEN, Seamster, joining_tree, pointed
from baselines.visibility import visibility
from parapoint.errors import InputError
from parapoint.planar.crossing import crossing_vertices
from parapoint.surfaces.cutting import cut_along, edge_lengths
from parapoint.surfaces.preparation import prepared
from parapoint.surfaces.surface import Mesh
from parapoint.testing import irregular_disk, sphere


def cube(steps=6):
    """The surface of the cube from 0 to 1, each side of steps x steps quads."""
    t = np.linspace(0, 1, steps + 1)
    points, faces = [], []
    at = np.arange((steps + 1) ** 2).reshape(steps + 1, steps + 1)
    a, b, c, d = (of.ravel() for of in (at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]))
    side = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    u, v = (of.ravel() for of in np.meshgrid(t, t, indexing="ij"))
    for axis in range(3):
        for level in (0.0, 1.0):
            xyz = np.empty((len(u), 3))
            xyz[:, axis], xyz[:, (axis + 1) % 3], xyz[:, (axis + 2) % 3] = level, u, v
            faces.append((side if level else side[:, ::-1]) + len(u) * len(points))
            points.append(xyz)
    vertices, row = np.unique(np.round(np.concatenate(points), 9), axis=0, return_inverse=True)
    return Mesh(vertices, row.reshape(-1)[np.concatenate(faces)])


def torus(steps=16):
    turn = np.arange(steps) * 2 * np.pi / steps
    a, b = (of.ravel() for of in np.meshgrid(turn, turn, indexing="ij"))
    ring = 2 + np.cos(b)
    points = np.stack([ring * np.cos(a), ring * np.sin(a), np.sin(b)], axis=1)
    at = np.arange(steps**2).reshape(steps, steps)
    p, q = at, np.roll(at, -1, axis=0)
    quads = [of.ravel() for of in (p, q, np.roll(q, -1, axis=1), np.roll(p, -1, axis=1))]
    faces = [np.stack([quads[k] for k in side], axis=1) for side in ([0, 1, 2], [0, 2, 3])]
    return Mesh(points, np.concatenate(faces))


def test_the_terminals_of_a_cube_are_its_corners():
    mesh = cube()
    found = mesh.vertices[pointed(mesh, 1.5)]
    assert len(found) == 8
    assert np.isin(found, [0, 1]).all()
    assert not len(pointed(mesh, 1.6))


def test_a_round_or_flat_surface_has_no_terminals():
    assert not len(pointed(sphere(), 1.5))
    flat = irregular_disk()
    assert not len(pointed(Mesh(flat.vertices * [1, 1, 0], flat.faces), 1e-6))


def test_a_convex_surface_is_seen_from_half_of_all_sides_and_a_cavity_from_fewer():
    ball = sphere()
    assert np.abs(visibility(ball) - 0.5).max() < 0.1
    mesh = cube(10)
    dent = (mesh.vertices[:, 2] == 1) & (np.abs(mesh.vertices[:, :2] - 0.5).max(axis=1) < 0.25)
    vertices = mesh.vertices - 0.8 * np.outer(dent, [0, 0, 1])
    seen = visibility(Mesh(vertices, mesh.faces))
    assert seen[dent].mean() < 0.5 * visibility(mesh)[dent].mean()


@pytest.mark.parametrize("turn", [1, -1])
def test_a_triangle_is_seen_from_half_of_all_sides_whichever_way_it_faces(turn):
    triangle = Mesh([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2][::turn]])
    assert visibility(triangle).tolist() == [0.5] * 3


def test_the_tree_of_a_cube_has_seven_of_its_edges():
    mesh = cube()
    terminals = pointed(mesh, 1.5)
    edges = joining_tree(mesh, edge_lengths(mesh), terminals)
    lengths = np.linalg.norm(np.diff(mesh.vertices[edges], axis=1)[:, 0], axis=1)
    assert lengths.sum() == pytest.approx(7)
    assert cut_along(mesh, edges).topology == "disk"


def test_the_tree_goes_where_it_costs_least_and_ends_at_the_boundary():
    mesh = irregular_disk()
    middle = mesh.vertices[mesh.edges].mean(axis=1)
    cost = edge_lengths(mesh) * np.where(middle[:, 0] > 0, 100.0, 1.0)
    edges = joining_tree(mesh, cost, np.array([4 * 9 + 4]))
    assert (mesh.vertices[edges].mean(axis=1)[:, 0] <= 0.1).all()
    assert cut_along(mesh, edges).topology == "disk"
    rim = np.unique(mesh.edges[mesh.edge_face_count == 1])
    assert np.isin(edges, rim).sum() == 1


def test_along_the_boundary_no_seam_is_needed():
    """Between opposite sides the way through the middle is shorter, but to be cut."""
    mesh = irregular_disk()
    assert not len(joining_tree(mesh, np.ones(len(mesh.edges)), np.array([4, 76])))


def test_a_flat_disk_is_not_cut():
    flat = irregular_disk()
    flat = Mesh(flat.vertices * [1, 1, 0], flat.faces)
    report = Seamster().parameterize(flat, seed=0).report
    assert [report[of] for of in ("terminals", "tree_length", "seen")] == [0, 0, 0]


def test_a_tip_amid_the_boundary_is_a_terminal():
    rim = [[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]]
    faces = [[4, 0, 1], [4, 1, 2], [4, 2, 3], [4, 3, 0]]
    assert pointed(Mesh([*rim, [0, 0, 2]], faces), 1.5).tolist() == [4]


def test_a_seam_to_the_corners_makes_a_better_map_of_a_cube_than_the_automatic_one():
    mesh = cube()
    result = Seamster().parameterize(mesh, seed=0)
    assert result.report["terminals"] == 8
    assert result.report["tree_length"] == pytest.approx(7)
    assert 0.4 < result.report["seen"] < 0.5  # its edges are in sight from half of all sides
    assert result.report["end_energy"] < 4 + 1e-3  # a cube unfolds
    automatic = AutomaticSLIM(price=None)
    (disk,) = prepared(mesh, automatic.requires).parts
    assert automatic.parameterize(disk, seed=0).report["end_energy"] > 4.2


@pytest.mark.parametrize("make", [torus, sphere])
def test_what_the_tree_leaves_uncut_is_cut_to_a_disk(make):
    result = Seamster().parameterize(make(), seed=0)
    cut = Mesh(np.pad(result.uv, ((0, 0), (0, 1))), result.corners)
    assert cut.topology == "disk"
    assert not len(crossing_vertices(cut, result.uv))


def test_seams_in_sight_cost_more():
    assert 0 < HIDDEN < 1
    mesh = cube(10)
    lid = mesh.vertices[:, 2] == 1
    cost = edge_lengths(mesh) * (HIDDEN + lid[mesh.edges].mean(axis=1))
    corners = np.flatnonzero(np.isin(mesh.vertices, [0, 1]).all(axis=1) & lid)[:2]
    edges = joining_tree(mesh, cost, corners)
    assert not lid[edges].all(axis=1).any()


def test_the_seam_of_a_cube_of_which_the_lid_alone_is_seen_stays_off_the_lid(monkeypatch):
    mesh = cube(4)
    lid = mesh.vertices[:, 2] == 1
    monkeypatch.setattr(seamster, "visibility", lambda _: lid.astype(float))
    seams = Seamster().parameterize(mesh, seed=0).seams(mesh)
    assert len(seams) == 7 * 4
    assert not lid[seams].all(axis=1).any()


def test_a_curvature_of_nothing_is_refused():
    with pytest.raises(InputError, match="curvature must be a number above 0"):
        Seamster(curvature=0.0)


def test_only_the_most_curved_terminals_are_taken_where_there_are_many(monkeypatch):
    mesh = cube()
    near = np.linalg.norm(mesh.vertices - 1, axis=1)
    pulled = mesh.vertices + np.exp(-((near / 0.25) ** 2))[:, None]
    for count in (1, 3):
        monkeypatch.setattr(seamster, "MOST_TERMINALS", count)
        found = pointed(Mesh(pulled, mesh.faces), 1.5)
        assert len(found) == count
        assert mesh.vertices[found[0]].tolist() == [1, 1, 1]
