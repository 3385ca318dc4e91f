"""The start from a computed map: what it says of the map, and on which side a point lies."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from parapoint.computed.flattening import Flattened, flat_map
from parapoint.computed.reconstruction import ReconstructionError
from parapoint.learned.start import REACH, _paths, computed_start, gate, seams
from parapoint.surfaces.cutting import cut_along
from parapoint.surfaces.surface import Mesh


def sphere(count: int) -> np.ndarray:
    points = np.random.default_rng(0).normal(size=(count, 3))
    return points / np.linalg.norm(points, axis=1, keepdims=True)


def sheet(side: int) -> Mesh:
    """A unit square of side² vertices in the plane z = 0, its rows along x."""
    rows = np.arange(side * side).reshape(side, side)
    a, b, c, d = rows[:-1, :-1], rows[:-1, 1:], rows[1:, :-1], rows[1:, 1:]
    faces = np.concatenate([np.stack(of, axis=-1).reshape(-1, 3) for of in ((a, b, c), (b, d, c))])
    y, x = np.divmod(np.arange(side * side), side)
    return Mesh(np.stack([x, y, 0 * x], axis=1) / (side - 1), faces)


def slit(side: int = 41) -> Flattened:
    """The sheet cut along y = 1/2 from its left edge to its centre, and laid out as it lies."""
    mesh = sheet(side)
    path = side * (side // 2) + np.arange(side // 2 + 1)
    disk = cut_along(mesh, np.stack([path[:-1], path[1:]], axis=1))
    origin = np.empty(len(disk.vertices), dtype=np.int64)
    origin[disk.faces] = mesh.faces
    return Flattened(
        np.arange(side * side), np.arange(0), 0, mesh, disk, origin, disk.vertices[:, :2], False
    )


def test_a_slit_has_two_sides_that_meet_at_its_tip() -> None:
    flat = slit()
    (seam,) = seams(flat)
    both = [flat.disk.vertices[side] for side in seam]
    for side in both:
        assert_allclose(np.sort(side[:, 0]), np.arange(20) / 40)
        assert_allclose(side[:, 1], 0.5)
    sides = []
    for side in seam:
        faces = flat.disk.faces[np.isin(flat.disk.faces, side).any(axis=1)]
        sides.append(flat.disk.vertices[faces][:, :, 1].mean() - 0.5)
    assert sides[0] * sides[1] < 0


def test_a_gate_jumps_across_the_slit_and_nowhere_else() -> None:
    flat = slit()
    (seam,) = seams(flat)
    values = gate(flat.disk, seam)
    assert_allclose(values[seam.left[0]], 1)
    assert_allclose(values[seam.right[0]], -1)
    # Along every edge of the cut surface it moves by no more than the way allows.
    i, j = flat.disk.edges.T
    steps = np.linalg.norm(flat.disk.vertices[i] - flat.disk.vertices[j], axis=1)
    assert (np.abs(values[i] - values[j]) <= 3.01 * steps / REACH).all()
    # Beside the slit, k edges from its tip, the way to the other side is k edges back and one on.
    for side, sign in zip(seam, (1, -1), strict=True):
        steps_to_tip = 20 - 40 * flat.disk.vertices[side, 0]
        assert_allclose(values[side], sign * np.minimum((steps_to_tip + 1) / 40 / REACH, 1))
    x, y = flat.disk.vertices[:, :2].T
    # Straight above the slit's left end the gate is 1 up to REACH, and falls to 0 at twice that.
    above = (x == 0) & (y > 0.5)
    far = (y[above] - 0.5) / REACH
    assert_allclose(np.abs(values[above]), np.clip(2 - far, 0, 1), atol=1e-9)
    assert_allclose(values[(x >= 0.5) & (y == 0.5)], 0, atol=1e-9)
    assert_allclose(values[np.abs(y - 0.5) > 2 * REACH], 0)


def test_a_surface_without_a_cut_has_no_seam() -> None:
    mesh = sheet(5)
    rows = np.arange(25)
    assert seams(Flattened(rows, rows[:0], 0, mesh, mesh, rows, mesh.vertices[:, :2], False)) == []


@pytest.mark.parametrize(
    ("edges", "ends", "paths"),
    [
        ([(0, 1), (1, 2)], [], [[0, 1, 2]]),
        ([(0, 1), (1, 2)], [1], [[0, 1], [1, 2]]),
        ([(0, 1), (1, 2), (2, 3)], [2], [[0, 1, 2], [2, 3]]),
        ([(0, 1), (1, 2), (1, 3)], [], [[0, 1], [1, 2], [1, 3]]),
        ([(0, 1), (1, 2), (2, 0)], [], [[0, 1, 2, 0]]),
        ([], [], []),
    ],
)
def test_edges_make_paths(edges: list, ends: list, paths: list) -> None:
    made = _paths(np.array(edges, dtype=np.int64).reshape(-1, 2), np.array(ends, dtype=int), 4)
    assert sorted(min(path, path[::-1]) for path in made) == paths


def test_the_start_is_the_computed_map() -> None:
    points = sphere(400)
    start, flat = computed_start(points, 6), flat_map(points)
    assert_allclose(start.points, points[flat.anchors])
    u = np.einsum("cni,ni->nc", start.gradients, start.points) + start.offsets
    assert_allclose(u, flat.uv)
    one, other = start.frames
    assert_allclose((one * other).sum(axis=1), 0, atol=1e-12)
    images = np.einsum("cni,tni->ntc", start.gradients, start.frames)
    assert (np.linalg.det(images) > 0).all()  # no fold, and all normals agree
    assert start.gates.shape == (len(start.points), 6)
    assert np.abs(start.gates).max() == 1
    assert (np.abs(start.gates) <= 1).all()


def test_a_cloud_of_many_pieces_has_no_computed_start() -> None:
    apart = np.concatenate([sphere(150) + 3.0 * k for k in range(3)])
    with pytest.raises(ReconstructionError, match="holds 150 of 450 points"):
        computed_start(apart, 3)
