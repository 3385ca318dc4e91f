"""The greedy shortest cut: known cycles, holes joined by a shortest tree, what the seam changes."""

import numpy as np
import pytest

from baselines.erickson_har_peled import EricksonHarPeled, opened, shortest_cycle
from parapoint.planar.crossing import crossing_vertices
from parapoint.surfaces.cutting import cut_along, cut_to_disk, edge_lengths
from parapoint.surfaces.surface import Mesh
from parapoint.testing import irregular_disk, sphere

WAIST = 17
"""Where around it a pinched torus is thinnest."""


def torus(around=24, across=10, radius=3.0, pinch=0.0):
    """A torus whose shortest loop is one around the tube, of `across` edges."""
    a, b = (
        of.ravel()
        for of in np.meshgrid(
            np.arange(around) * 2 * np.pi / around,
            np.arange(across) * 2 * np.pi / across,
            indexing="ij",
        )
    )
    tube = 1 - pinch * (np.abs(a - WAIST * 2 * np.pi / around) < 1e-9)
    ring = radius + tube * np.cos(b)
    points = np.stack([ring * np.cos(a), ring * np.sin(a), tube * np.sin(b)], axis=1)
    at = np.arange(around * across).reshape(around, across)
    p, q = at, np.roll(at, -1, axis=0)
    quads = [of.ravel() for of in (p, q, np.roll(q, -1, axis=1), np.roll(p, -1, axis=1))]
    faces = [np.stack([quads[k] for k in side], axis=1) for side in ([0, 1, 2], [0, 2, 3])]
    return Mesh(points, np.concatenate(faces))


def without(mesh, *faces):
    return Mesh(mesh.vertices, np.delete(mesh.faces, faces, axis=0))


def two_tori():
    """A surface with two handles: two tori joined where each has lost a face."""
    one = torus()
    far = np.flatnonzero(one.vertices[:, 0] > 3.9)[0]
    face = int(np.flatnonzero((one.faces == far).any(axis=1))[0])
    corners = one.faces[face]
    size = len(one.vertices)
    mirrored = one.vertices * [-1, 1, 1] + [2 * one.vertices[corners, 0].max() + 1, 0, 0]
    a, b, c = corners
    x, y, z = corners + size
    tube = [[a, b, y], [a, y, x], [b, c, z], [b, z, y], [c, a, x], [c, x, z]]
    rest = np.delete(one.faces, face, axis=0)
    return Mesh(
        np.concatenate([one.vertices, mirrored]),
        np.concatenate([rest, rest[:, ::-1] + size, np.array(tube)]),
    )


def added(mesh, cut):
    """Length by which the seam grew."""
    rims = [edge_lengths(of)[of.edge_face_count == 1].sum() for of in (mesh, cut)]
    return (rims[1] - rims[0]) / 2


def test_the_two_shortest_loops_of_a_torus():
    mesh = torus()
    ring = 10 * 2 * np.sin(np.pi / 10)
    inner = 24 * 2 * (3 - 1) * np.sin(np.pi / 24)
    cycle, length = shortest_cycle(mesh)
    assert length == pytest.approx(ring)
    assert len(cycle) == 10
    assert cut_along(mesh, cycle).genus == 0
    cut, cycles = opened(mesh)
    assert cut.topology == "disk"
    assert cycles == [pytest.approx(ring)]
    assert added(mesh, cut) == pytest.approx(ring + inner, rel=1e-6)


def test_a_surface_with_two_handles_loses_one_by_each_cycle():
    mesh = two_tori()
    assert (mesh.genus, mesh.boundary_loops) == (2, [])
    cut, cycles = opened(mesh)
    ring = 10 * 2 * np.sin(np.pi / 10)
    assert cycles == [pytest.approx(ring), pytest.approx(ring)]
    assert cut.topology == "disk"


def test_the_cut_of_one_handle_is_no_longer_than_the_automatic_one():
    for mesh in (torus(), torus(9, 14, 1.8), torus(pinch=0.5), without(torus(), 3, 100, 250)):
        cut, _ = opened(mesh)
        assert cut.topology == "disk"
        assert added(mesh, cut) <= added(mesh, cut_to_disk(mesh)) + 1e-9


def test_the_first_cycle_is_the_waist():
    mesh = torus(pinch=0.5)
    cycle, length = shortest_cycle(mesh)
    assert (np.unique(cycle) // 10 == WAIST).all()
    assert length == pytest.approx(10 * np.sin(np.pi / 10))


def test_shortest_paths_join_the_holes():
    mesh = without(sphere(), 0)
    far = int(
        ((mesh.vertices[mesh.faces].mean(1) - mesh.vertices[mesh.faces[5]].mean(0)) ** 2)
        .sum(1)
        .argmax()
    )
    holed = without(mesh, 5, far)
    cut, cycles = opened(holed)
    assert (cycles, cut.topology) == ([], "disk")
    assert added(holed, cut) <= added(holed, cut_to_disk(holed)) + 1e-9


def test_a_disk_stays_whole_and_a_sphere_is_cut_automatically():
    disk = irregular_disk()
    assert opened(disk)[0] is disk
    assert np.array_equal(opened(sphere())[0].faces, cut_to_disk(sphere()).faces)


def test_the_map_is_one_to_one_and_its_seam_is_the_cut():
    mesh = torus(pinch=0.5)
    result = EricksonHarPeled().parameterize(mesh, seed=0)
    cut = Mesh(np.pad(result.uv, ((0, 0), (0, 1))), result.corners)
    assert cut.topology == "disk"
    assert not len(crossing_vertices(cut, result.uv))
    ends = mesh.vertices[result.seams(mesh)]
    seam = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).sum()
    assert seam == pytest.approx(result.report["cut_length"])


def test_a_ring_is_cut_once_from_one_hole_to_the_other():
    """A cylinder without lids, of eight sides and three rows: three edges of length 1."""
    angle = np.arange(8) * np.pi / 4
    rings = [np.stack([np.cos(angle), np.sin(angle), np.full(8, z)], axis=1) for z in range(4)]
    at = np.arange(32).reshape(4, 8)
    p, q = at[:-1], np.roll(at[:-1], -1, axis=1)
    quads = [of.ravel() for of in (p, q, q + 8, p + 8)]
    faces = [np.stack([quads[k] for k in side], axis=1) for side in ([0, 1, 2], [0, 2, 3])]
    ring = Mesh(np.concatenate(rings), np.concatenate(faces))
    cut, cycles = opened(ring)
    assert (cycles, cut.topology) == ([], "disk")
    assert added(ring, cut) == pytest.approx(3)


def test_along_a_hole_a_cycle_costs_nothing():
    """A torus that is slit open along 20 of the 24 edges of its inner ring."""
    at = 10 * np.arange(20) + 5
    slit = without(torus(), *at, *(at + 240))
    assert slit.genus == 1
    _, length = shortest_cycle(slit)
    assert length == pytest.approx(4 * 2 * (3 - 1) * np.sin(np.pi / 24), rel=1e-6)
