"""The computed map of a mesh by its own faces."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.cases import builtin
from parapoint.computed import faces
from parapoint.computed.faces import comparable, is_even, map_of_faces
from parapoint.computed.reconstruction import ReconstructionError
from parapoint.surfaces.surface import Mesh
from parapoint.testing import irregular_disk, sphere

CUBE = Mesh(
    [[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)],
    [
        *([0, 1, 3], [0, 3, 2], [4, 7, 5], [4, 6, 7], [0, 5, 1], [0, 4, 5]),
        *([2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]),
    ],
)


def test_a_flat_disk_keeps_its_shape() -> None:
    bent = irregular_disk()
    flat = Mesh(1e3 * bent.vertices * [1, 1, 0] + 1e6, bent.faces)
    uv, facts = map_of_faces(flat)
    assert (facts["genus"], facts["seam_edges"]) == (0, 0)
    ends = flat.edges
    lengths = np.linalg.norm(flat.vertices[ends[:, 0]] - flat.vertices[ends[:, 1]], axis=1)
    found = np.linalg.norm(uv[ends[:, 0]] - uv[ends[:, 1]], axis=1)
    np.testing.assert_allclose(found, lengths, rtol=1e-6)


def test_a_sphere_is_cut_open() -> None:
    ball = sphere()
    uv, facts = map_of_faces(ball)
    assert facts["seam_edges"] > 0
    assert uv.shape == (len(ball.vertices), 2)
    stretch = np.linalg.norm(np.diff(uv[ball.edges], axis=1)[:, 0], axis=1)
    stretch /= np.linalg.norm(np.diff(ball.vertices[ball.edges], axis=1)[:, 0], axis=1)
    assert 0.01 < (stretch > 3 * np.median(stretch)).mean() < 0.3  # the edges across the seam


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_slender_faces_make_a_mesh_uneven(unit) -> None:
    angle = np.linspace(0, np.pi, 33)
    ring = np.column_stack([np.cos(angle), np.sin(angle)])

    def pipe(length: float) -> Mesh:
        ends = [np.column_stack([ring, np.full(33, z)]) for z in (0.0, length)]
        return Mesh(unit * np.concatenate(ends), builtin.grid_faces(2, 33))

    assert is_even(Mesh(unit * CUBE.vertices, CUBE.faces))
    assert is_even(pipe(1.0))
    # The edges of 64 equal triangles on a pipe of length L are 0.34 sqrt(L) long.
    assert is_even(pipe(11.0))
    assert not is_even(pipe(12.0))


def test_a_coarse_mesh_is_refined_and_keeps_its_vertices_first() -> None:
    fine = comparable(CUBE)
    assert len(fine.faces) == 12 * 4**faces.MOST_SPLITS
    np.testing.assert_array_equal(fine.vertices[:8], CUBE.vertices)
    assert (fine.is_connected_surface, fine.genus, fine.boundary_loops) == (True, 0, [])
    assert fine.face_areas.sum() == pytest.approx(6)
    torus = builtin.torus(30)
    assert faces.LEAST_VERTICES / 4 < len(torus.vertices) < faces.LEAST_VERTICES
    assert len(comparable(torus).faces) == 4 * len(torus.faces)


def test_a_large_mesh_is_simplified_and_all_its_vertices_have_a_place(monkeypatch) -> None:
    steps = np.linspace(0, 1, 25)
    x, y = (of.ravel() for of in np.meshgrid(2 * steps, steps, indexing="ij"))
    half_pipe = np.stack([np.sin(x), y, np.cos(x)], axis=1)
    mesh = Mesh(half_pipe, builtin.grid_faces(25, 25))
    monkeypatch.setattr(faces, "MOST_FACES", len(mesh.faces) - 1)
    monkeypatch.setattr(faces, "SIMPLIFIED", len(mesh.faces) // 2)
    uv, facts = map_of_faces(mesh)
    assert facts["faces"] <= len(mesh.faces) // 2
    unrolled = np.stack([x, y], axis=1)
    for one in (0, 24, 300):  # distances from a corner, another, and the middle
        found, known = (np.linalg.norm(of - of[one], axis=1) for of in (uv, unrolled))
        np.testing.assert_allclose(found, known, atol=0.02)


def test_a_mesh_that_cannot_be_simplified_is_taken_as_it_is(monkeypatch) -> None:
    monkeypatch.setattr(faces, "MOST_FACES", 100)
    monkeypatch.setattr(faces, "simplified", lambda *_: None)
    assert comparable(sphere()).faces is not None
    assert len(comparable(sphere()).faces) == len(sphere().faces)


def test_a_mesh_without_a_flat_map_says_so(monkeypatch) -> None:
    def fails(*_: object) -> None:
        raise RuntimeError("a factor is singular")

    monkeypatch.setattr("parapoint.computed.flattening.bijective_map", fails)
    with pytest.raises(ReconstructionError, match="has no flat map"):
        map_of_faces(sphere())
