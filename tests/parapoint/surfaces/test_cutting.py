import numpy as np
import pytest
from numpy.testing import assert_array_equal

from parapoint.errors import InputError
from parapoint.surfaces.cutting import (
    cut_along,
    cut_to_disk,
    disk_cut,
    edge_graph,
    path_edges,
    path_to,
    ways_to,
)
from parapoint.surfaces.surface import Mesh
from parapoint.testing import irregular_disk, sphere

TETRAHEDRON = Mesh(
    np.vstack([np.eye(3), [[0, 0, 0]]]), [[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]]
)


def torus(columns=24, rows=12, tube=0.3):
    """A torus about the z axis of radius 1; vertex `rows * i + j`."""
    i, j = np.divmod(np.arange(columns * rows), rows)
    a, b = 2 * np.pi * i / columns, 2 * np.pi * j / rows
    radius = 1 + tube * np.cos(b)
    points = np.stack([radius * np.cos(a), radius * np.sin(a), tube * np.sin(b)], axis=1)
    at = lambda i, j: rows * (i % columns) + j % rows  # noqa: E731 (an index, inline)
    p, q, r, s = at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)
    return Mesh(points, np.concatenate([np.stack([p, q, r], 1), np.stack([p, r, s], 1)]))


def double_torus():
    """Two tori, glued where a face of each was removed."""
    one = torus()
    other = Mesh(one.vertices + np.array([2.7, 0.0, 0.0]), one.faces)
    glued = np.concatenate([one.faces, other.faces[:, ::-1] + len(one.vertices)])
    hole = one.faces[0]
    for vertex in hole:
        glued[glued == vertex + len(one.vertices)] = vertex
    kept = np.array([set(face) != set(hole) for face in glued.tolist()])
    return Mesh(np.concatenate([one.vertices, other.vertices]), glued[kept])


def without_faces(mesh, faces):
    return Mesh(mesh.vertices, np.delete(mesh.faces, faces, axis=0))


def cut_length(mesh, disk):
    """3D length of the cut: half of the boundary that came with it."""

    def boundary(m):
        ends = m.vertices[m.edges[m.edge_face_count == 1]]
        return np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).sum()

    return (boundary(disk) - boundary(mesh)) / 2


@pytest.mark.parametrize(
    ("mesh", "topology"),
    [
        (TETRAHEDRON, "sphere"),
        (sphere(), "sphere"),
        (torus(), "genus 1 with no boundary"),
        (double_torus(), "genus 2 with no boundary"),
        (without_faces(torus(), [5, 100]), "genus 1 with 2 boundary loops"),
        (without_faces(double_torus(), [300]), "genus 2 with 1 boundary loop"),
        (
            without_faces(
                sphere(), [*sphere().vertices[sphere().faces].sum(axis=1).argmax(axis=0)]
            ),
            "genus 0 with 3 boundary loops",
        ),
    ],
    ids=["tetrahedron", "sphere", "torus", "double torus", "torus - 2", "double - 1", "sphere - 3"],
)
def test_cut_makes_a_disk_of_the_same_triangles(mesh, topology):
    assert mesh.topology == topology
    disk = cut_to_disk(mesh)
    assert disk.topology == "disk"
    assert disk.euler_characteristic == 1
    assert len(disk.boundary_loops) == 1
    assert_array_equal(disk.vertices[disk.faces], mesh.vertices[mesh.faces])
    assert_array_equal(disk.vertices[: len(mesh.vertices)], mesh.vertices)
    old = disk.faces < len(mesh.vertices)
    assert_array_equal(disk.faces[old], mesh.faces[old])  # copies come after the originals


def test_disk_comes_back_as_it_is():
    disk = irregular_disk()
    assert cut_to_disk(disk) is disk


def test_torus_is_cut_along_its_shortest_loops():
    # The shortest loop around the tube, and then the inner equator: both are polygons of known
    # length, and no cut graph of this mesh is shorter than the loop plus the way round.
    mesh = torus(tube=0.3)
    meridian = 12 * 2 * 0.3 * np.sin(np.pi / 12)
    equator = 24 * 2 * 0.7 * np.sin(np.pi / 24)
    assert cut_length(mesh, cut_to_disk(mesh)) <= meridian + equator + 1e-9


def test_sphere_cut_reaches_from_pole_to_pole():
    mesh = sphere()
    length = cut_length(mesh, cut_to_disk(mesh))
    assert 2.0 < length < 1.3 * np.pi  # an edge path between far points: about half a great circle


def test_cut_does_not_depend_on_scale_or_unreferenced_vertices():
    mesh = torus()
    faces = cut_to_disk(mesh).faces
    assert_array_equal(cut_to_disk(Mesh(2.0**-20 * mesh.vertices, mesh.faces)).faces, faces)
    more = Mesh(np.vstack([mesh.vertices, [[50.0, 0, 0]]]), mesh.faces)
    moved = cut_to_disk(more).faces
    assert_array_equal(np.where(moved > len(mesh.vertices), moved - 1, moved), faces)


def test_mesh_without_any_length_is_cut_too():
    collapsed = Mesh(np.zeros_like(torus().vertices), torus().faces)
    assert cut_to_disk(collapsed).topology == "disk"


@pytest.mark.parametrize(
    ("faces", "fault"),
    [
        ([[0, 1, 2], [3, 4, 5]], "2 components"),
        ([[0, 1, 2], [0, 1, 3], [0, 1, 4]], "not manifold"),
        ([[0, 1, 2], [0, 1, 3]], "not consistently oriented"),
    ],
)
def test_what_has_no_disk_cut_is_refused(faces, fault):
    points = np.random.default_rng(0).normal(size=(6, 3))
    with pytest.raises(InputError, match=fault):
        cut_to_disk(Mesh(points, faces))


def test_cut_along_a_slit_and_across():
    mesh = irregular_disk()  # 9 x 9 vertices
    slit = cut_along(mesh, [[36, 37], [38, 37]])  # from the boundary two edges inwards
    assert len(slit.vertices) == len(mesh.vertices) + 2
    assert slit.topology == "disk"
    hole = cut_along(mesh, [[37, 38], [38, 39]])  # inside: only the middle vertex is split
    assert len(hole.vertices) == len(mesh.vertices) + 1
    assert hole.topology == "genus 0 with 2 boundary loops"
    across = cut_along(mesh, np.stack([np.arange(36, 44), np.arange(37, 45)], axis=1))
    assert across.component_count == 2
    assert_array_equal(across.vertices[across.faces], mesh.vertices[mesh.faces])


def test_cut_along_nothing_or_the_boundary_changes_nothing():
    mesh = irregular_disk()
    assert_array_equal(cut_along(mesh, np.zeros((0, 2))).faces, mesh.faces)
    assert_array_equal(cut_along(mesh, [[0, 1], [1, 2]]).faces, mesh.faces)
    assert_array_equal(cut_along(mesh, [[40, 41]]).faces, mesh.faces)  # a lone inner edge


def test_cut_along_keeps_nonmanifold_edges_joined():
    fan = Mesh(np.random.default_rng(1).normal(size=(5, 3)), [[0, 1, 2], [1, 0, 3], [0, 1, 4]])
    assert_array_equal(cut_along(fan, np.zeros((0, 2))).faces, fan.faces)
    assert cut_along(fan, [[0, 1]]).component_count == 3


@pytest.mark.parametrize("edges", [[[0, 40]], [[0, 83]], [[-1, 1]], [0, 1], [[0, 1, 2]]])
def test_cut_along_refuses_what_is_no_edge(edges):
    with pytest.raises(InputError, match=r"no edge of the mesh|shape \(n, 2\)"):
        cut_along(irregular_disk(), edges)


@pytest.mark.parametrize(("waves", "sign"), [(1, -1), (2, 1)])
def test_a_torus_is_cut_where_it_is_narrowest(waves, sign):
    # Its tube has a radius from 1/4 to 1/2. With one wave it is narrow at the first vertex. The
    # vertex farthest from that one is the first root, and the farthest from the root the second:
    # the first one, where the shortest loop goes around the tube. With two waves it is wide there
    # and across, and narrow between these, where the further roots are. The rest of the cut is the
    # polygon inside the torus.
    i, j = np.divmod(np.arange(24 * 12), 12)
    a, b = 2 * np.pi * i / 24, 2 * np.pi * j / 12
    tube = 0.375 + sign * 0.125 * np.cos(waves * a)
    radius = 1 + tube * np.cos(b)
    points = np.stack([radius * np.cos(a), radius * np.sin(a), tube * np.sin(b)], axis=1)
    mesh = Mesh(points, torus().faces)
    inside = points[j == 6]
    meridian = 12 * 2 * 0.25 * np.sin(np.pi / 12)
    equator = np.linalg.norm(inside - np.roll(inside, 1, axis=0), axis=1).sum()
    assert cut_length(mesh, cut_to_disk(mesh)) <= meridian + equator + 1e-9


def test_a_later_arc_starts_from_an_earlier_one():
    # A square of unit costs, where only (8, 0) to (8, 1) leads from the rim, all other ways there
    # and all diagonals cost 100. Five steps lead from the rim to the hole at (8, 5), four from that
    # path to the hole at (12, 2); without the path it would be six, to the rim or the other hole.
    x, y = (of.ravel() for of in np.meshgrid(np.arange(17), np.arange(17)))
    corner = (17 * np.arange(16)[:, None] + np.arange(16)).ravel()
    faces = np.concatenate([corner[:, None] + [0, 1, 18], corner[:, None] + [0, 18, 17]])
    points = np.stack([x, y, 0 * x], axis=1)
    mesh = without_faces(Mesh(points, faces), [5 * 16 + 8, 2 * 16 + 12])
    on_rim = ((points[:, :2] == 0) | (points[:, :2] == 16)).any(axis=1)
    ends = mesh.edges
    is_dear = (np.diff(points[ends], axis=1) != 0).sum(axis=(1, 2)) > 1
    is_dear |= (on_rim[ends].sum(axis=1) == 1) & (ends != [8, 25]).any(axis=1)
    cut = disk_cut(mesh, np.where(is_dear, 100.0, 1.0))
    straight = [[8 + 17 * k, 25 + 17 * k] for k in range(5)]
    aside = [[8 + k + 34, 9 + k + 34] for k in range(4)]
    assert_array_equal(ends[cut], sorted(straight + aside))


def test_the_way_from_a_vertex_leads_to_the_nearest_root():
    #  0 - 1 - 2 - 3 and 4, 5 apart; the edge from 1 to 2 is long
    mesh = Mesh(np.eye(6, 3), [[0, 1, 1], [1, 2, 2], [2, 3, 3], [4, 5, 5]])
    lengths = np.array([{(0, 1): 1.0, (1, 2): 5.0}.get(tuple(edge), 2.0) for edge in mesh.edges])
    distance, previous = ways_to(edge_graph(mesh, lengths), np.array([0, 3]))
    assert_array_equal(distance, [0, 1, 2, 0, np.inf, np.inf])
    assert [path_to(previous, vertex) for vertex in range(5)] == [[0], [1, 0], [2, 3], [3], [4]]
    distance, previous = ways_to(edge_graph(mesh, lengths), np.array([0]))
    assert_array_equal(path_edges(path_to(previous, 3)), [[3, 2], [2, 1], [1, 0]])
    assert path_edges(path_to(previous, 0)).shape == (0, 2)
