"""Surfaces: what is refused, and topology with answers known by hand."""

import numpy as np
import pytest

from parapoint import InputError, Mesh, PointCloud
from parapoint.surfaces.surface import flat_faces, vertex_normals

TETRAHEDRON = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]
CORNERS = [[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
ANNULUS = [[i, (i + 1) % 4, 4 + i] for i in range(4)] + [
    [(i + 1) % 4, 4 + (i + 1) % 4, 4 + i] for i in range(4)
]
ANNULUS_VERTICES = [[x, y, 0.0] for r in (2, 1) for x, y in ((r, r), (-r, r), (-r, -r), (r, -r))]


def moebius_strip(quads: int = 5) -> list[list[int]]:
    def vertex(i: int, side: int) -> int:
        turns, place = divmod(i, quads)
        return 2 * place + (side + turns) % 2

    faces = []
    for i in range(quads):
        a, b, c, d = vertex(i, 0), vertex(i, 1), vertex(i + 1, 1), vertex(i + 1, 0)
        faces += [[a, b, c], [a, c, d]]
    return faces


@pytest.mark.parametrize(
    ("faces", "vertices", "topology", "euler", "loops"),
    [
        (TETRAHEDRON, CORNERS, "sphere", 2, []),
        (TETRAHEDRON[:3], CORNERS, "disk", 1, [3]),
        (ANNULUS, ANNULUS_VERTICES, "genus 0 with 2 boundary loops", 0, [4, 4]),
        ([[0, 1, 2], [1, 2, 3]], CORNERS, "manifold, faces not consistently oriented", 1, None),
        ([[0, 1, 2], [1, 0, 3], [0, 1, 4]], [*CORNERS, [1, 1, 1]], "not manifold", 1, None),
        ([[0, 1, 1]], CORNERS, "not manifold", None, None),
        (
            [[0, 1, 2], [4, 5, 6]],
            CORNERS + [[5 + x, y, z] for x, y, z in CORNERS],
            "2 components",
            2,
            [3, 3],
        ),
    ],
)
def test_topology_of_small_meshes(faces, vertices, topology, euler, loops):
    mesh = Mesh(vertices, faces)
    assert mesh.topology == topology
    if euler is not None:
        assert mesh.euler_characteristic == euler
    if loops is not None:
        assert [len(loop) for loop in mesh.boundary_loops] == loops


def test_two_triangles_at_one_vertex_are_not_manifold():
    vertices = [[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [-1, 0, 0], [-1, -1, 0]]
    mesh = Mesh(vertices, [[0, 1, 2], [0, 3, 4]])
    assert mesh.topology == "not manifold"
    assert mesh.component_count == 1


def test_a_moebius_strip_has_no_consistent_orientation():
    faces = moebius_strip()
    mesh = Mesh(np.random.default_rng(0).normal(size=(10, 3)), faces)
    assert mesh.is_manifold
    assert not mesh.is_oriented


def test_a_grid_torus_has_genus_one():
    n = 6
    i, j = np.divmod(np.arange(n * n), n)
    right, up = i * n + (j + 1) % n, ((i + 1) % n) * n + j
    corner = ((i + 1) % n) * n + (j + 1) % n
    here = i * n + j
    faces = np.concatenate([np.stack([here, right, corner], 1), np.stack([here, corner, up], 1)])
    mesh = Mesh(np.random.default_rng(1).normal(size=(n * n, 3)), faces)
    assert (mesh.euler_characteristic, mesh.genus) == (0, 1)
    assert mesh.topology == "genus 1 with no boundary"


def test_boundary_loops_are_longest_first():
    lengths = [
        np.linalg.norm(np.diff(ANNULUS_VERTICES, axis=0)[0]),
        np.linalg.norm(np.diff(ANNULUS_VERTICES[4:], axis=0)[0]),
    ]
    assert lengths == [4, 2]
    outer, inner = Mesh(ANNULUS_VERTICES, ANNULUS).boundary_loops
    assert sorted(outer) == [0, 1, 2, 3]
    assert sorted(inner) == [4, 5, 6, 7]
    # The same with the vertices of the inner loop first.
    inside_out = Mesh(np.roll(ANNULUS_VERTICES, 4, axis=0), (np.array(ANNULUS) + 4) % 8)
    outer, inner = inside_out.boundary_loops
    assert sorted(outer) == [4, 5, 6, 7]
    assert sorted(inner) == [0, 1, 2, 3]


def test_unreferenced_vertices_are_kept_and_do_not_count():
    mesh = Mesh([*CORNERS, [9.0, 9, 9]], TETRAHEDRON)
    assert len(mesh.vertices) == 5
    assert mesh.referenced.tolist() == [True] * 4 + [False]
    assert mesh.topology == "sphere"


def test_an_unreferenced_vertex_amid_the_others_does_not_break_the_manifold_check():
    mesh = Mesh([CORNERS[0], [9.0, 9, 9], *CORNERS[1:]], np.array([0, 2, 3, 4])[TETRAHEDRON])
    assert mesh.topology == "sphere"


def test_face_areas():
    mesh = Mesh(CORNERS, TETRAHEDRON)
    np.testing.assert_allclose(mesh.face_areas, [0.5, 0.5, np.sqrt(3) / 2, 0.5], rtol=1e-15)


def test_arrays_are_copied_and_read_only():
    vertices = np.array(CORNERS)
    mesh = Mesh(vertices, TETRAHEDRON)
    vertices[0] = 7
    assert mesh.vertices[0].tolist() == [0, 0, 0]
    with pytest.raises(ValueError, match="read-only"):
        mesh.vertices[0] = 7


@pytest.mark.parametrize(
    ("vertices", "faces", "message"),
    [
        ([[0, 0, np.nan], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], "vertices must be finite; row 0"),
        ([[0, 0, 0], [1, 0, np.inf], [0, 1, 0]], [[0, 1, 2]], "vertices must be finite; row 1"),
        (CORNERS, [[0, 1, 3], [0, 1, 4]], r"face 1 is \[0, 1, 4\], but vertices run from 0 to 3"),
        (CORNERS, [[0, 1, 3], [0, 1, -1], [4, 1, 2]], r"face 1 is .* vertices run from 0 to 3"),
        (CORNERS, np.zeros((0, 3)), "at least one face"),
        (CORNERS, [[0, 1]], r"faces must have shape \(n, 3\)"),
        (np.zeros((4, 2)), TETRAHEDRON, r"vertices must have shape \(n, 3\)"),
        ("nonsense", TETRAHEDRON, "vertices must be numbers"),
    ],
)
def test_bad_meshes_are_refused_in_one_line(vertices, faces, message):
    with pytest.raises(InputError, match=message) as caught:
        Mesh(vertices, faces)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("points", "normals", "message"),
    [
        (np.zeros((0, 3)), None, "at least one point"),
        ([[0, 0, np.nan]], None, "points must be finite"),
        (CORNERS, CORNERS[:2], "2 normals for 4 points"),
    ],
)
def test_bad_point_clouds_are_refused(points, normals, message):
    with pytest.raises(InputError, match=message):
        PointCloud(points, normals)


@pytest.mark.parametrize("shift", [0.0, 1e3])
@pytest.mark.parametrize("size", [1.0, 1e-9])
def test_flat_faces_are_told_by_their_own_edges(shift, size):
    """A small face is not flat beside a large one, nor a thin one that has an area."""
    large, small = np.array([[0, 0, 0], [1e6, 0, 0], [0, 1e6, 0]]), np.array(CORNERS[:3]) * 0.01
    thin, line = [[0, 0, 0], [1, 0, 0], [2, 1e-6, 0]], [[0, 0, 0], [1, 1, 1], [3, 3, 3]]
    vertices = (np.concatenate([large, small, thin, line, np.zeros((3, 3))]) + shift) * size
    faces = np.arange(15).reshape(-1, 3)
    assert flat_faces(vertices, faces).tolist() == [False, False, False, True, True]


def test_vertex_normals_are_means_by_area():
    """A floor of three times the area of a wall, which meet at two vertices."""
    points = [[0, 0, 0], [1, 0, 0], [0, 3, 0], [0, 0, 1]]
    mesh = Mesh(points, [[0, 1, 2], [1, 0, 3]])  # upwards, and towards y
    normals = vertex_normals(mesh)
    both = np.array([0, 1, 3]) / np.sqrt(10)
    assert normals == pytest.approx(np.array([both, both, [0, 0, 1], [0, 1, 0]]))


def test_halfedges_run_around_each_face_from_its_first_corner():
    mesh = Mesh(np.random.default_rng(0).normal(size=(4, 3)), [[0, 1, 2], [3, 2, 1]])
    wanted = [[0, 1], [1, 2], [2, 0], [3, 2], [2, 1], [1, 3]]
    np.testing.assert_array_equal(mesh.halfedges, wanted)
