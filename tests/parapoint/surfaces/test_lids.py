"""The side of a surface that is opened like a lid."""

import numpy as np
import pytest
import shapely
import trimesh

from benchmarks.cases import builtin
from parapoint.surfaces.cutting import cut_along, edge_lengths
from parapoint.surfaces.lids import lid_cut
from parapoint.surfaces.surface import Mesh, edge_components
from parapoint.testing import similar, sphere


def plate(holes: int, height: float) -> Mesh:
    """A round plate with holes around its centre, closed."""
    outline = shapely.Point(0, 0).buffer(10, 8)
    for angle in 2 * np.pi * np.arange(holes) / max(holes, 1):
        outline = outline.difference(
            shapely.Point(5 * np.cos(angle), 5 * np.sin(angle)).buffer(1, 4)
        )
    made = trimesh.creation.extrude_polygon(outline, height)
    return Mesh(made.vertices, made.faces).welded


def drum(height: float) -> Mesh:
    made = trimesh.creation.cylinder(1, height, sections=40)
    return Mesh(made.vertices, made.faces)


@pytest.mark.parametrize("holes", [0, 1, 3])
def test_a_plate_opens_around_one_of_its_sides(holes: int) -> None:
    mesh = plate(holes, 0.5)
    assert mesh.genus == holes
    cut = lid_cut(mesh)
    opened = cut_along(mesh, mesh.edges[cut])
    assert opened.is_planar_domain
    assert len(opened.boundary_loops) == 1 + 2 * holes
    # All of the rim is cut but for one edge: 32 edges outside, 16 around each hole.
    ends = mesh.vertices[mesh.edges[cut]]
    assert len(ends) == 31 + 16 * holes
    assert np.ptp(ends[..., 2]) == 0


def test_each_part_around_a_lid_stays_joined_by_its_longest_edge() -> None:
    mesh = drum(0.9)  # its wall is the largest side, and two caps fall off
    cut = lid_cut(mesh)
    assert cut.sum() == 2 * 39
    opened = cut_along(mesh, mesh.edges[cut])
    assert edge_components(opened.faces).max() == 0
    box = trimesh.creation.box((4, 3, 1))
    boxed = Mesh(box.vertices, box.faces)
    cut = lid_cut(boxed)
    np.testing.assert_allclose(np.sort(edge_lengths(boxed)[cut]), [3, 3, 4])


@pytest.mark.parametrize(
    "mesh",
    [
        sphere(),
        builtin.sphere_cap(90),
        builtin.half_cylinder(),
        drum(20),  # the wall is nearly all of it
        builtin.torus(),
    ],
    ids=["ball", "cap", "half a pipe", "rod", "ring"],
)
def test_surfaces_without_a_large_side_between_creases_have_no_lid(mesh: Mesh) -> None:
    assert not lid_cut(mesh).any()


@pytest.mark.parametrize(("shift", "scale"), [(1e3, 1e-6), (-1e5, 1e6)])
def test_the_lid_is_the_same_wherever_the_surface_lies(shift: float, scale: float) -> None:
    for mesh in (plate(2, 0.5), drum(0.9)):
        moved = similar(mesh, shift, scale)
        assert isinstance(moved, Mesh)
        np.testing.assert_array_equal(lid_cut(moved), lid_cut(mesh))


@pytest.mark.parametrize("degrees", [1, 30, 77])
def test_which_of_two_equal_sides_opens_does_not_depend_on_how_the_surface_lies(degrees) -> None:
    turn = trimesh.transformations.rotation_matrix(np.radians(degrees), [1, 2, 3])[:3, :3]
    for mesh in (plate(2, 0.5), plate(0, 0.01)):
        turned = Mesh(mesh.vertices @ turn.T, mesh.faces)
        np.testing.assert_array_equal(lid_cut(turned), lid_cut(mesh))
