"""Maps along seams that are given."""

import numpy as np
import pytest

from benchmarks.metrics.evaluation import evaluate
from parapoint import InputError, Mesh
from parapoint.testing import irregular_disk, sphere
from parapoint.unwrapping.given import mended_along, unwrapped_along

NONE = np.zeros((0, 2), dtype=np.int64)


def test_a_closed_chart_is_cut_to_a_disk_and_counted() -> None:
    ball, disk = sphere(), irregular_disk()
    both = Mesh(
        np.concatenate([ball.vertices, disk.vertices + 5]),
        np.concatenate([ball.faces, disk.faces + len(ball.vertices)]),
    )
    found = unwrapped_along(both, NONE)
    assert found.report["charts_cut_to_disks"] == 1
    assert len(found.report["parts"]) == 2
    values = evaluate(both, found)
    assert (values["bijective"], values["chart_count"]) == (1, 2)


def test_a_chart_is_cut_where_it_is_said() -> None:
    """Along an inner edge path the disk is cut, and nowhere else."""
    disk = irregular_disk()
    inner = np.flatnonzero(disk.edge_face_count == 2)
    ends = disk.edges[inner]
    rim = np.unique(disk.edges[disk.edge_face_count == 1])
    from_rim = ends[np.isin(ends, rim).sum(axis=1) == 1][:1]
    found = unwrapped_along(disk, from_rim)
    assert np.array_equal(found.seams(disk), from_rim)
    assert found.report["charts_cut_to_disks"] == 0


def test_faces_that_do_not_turn_alike_are_refused() -> None:
    disk = irregular_disk()
    with pytest.raises(InputError, match="seams can be given for a manifold"):
        unwrapped_along(Mesh(disk.vertices, one_turned(disk.faces)), NONE)


def one_turned(faces: np.ndarray) -> np.ndarray:
    """The faces, the first of them turned round."""
    return np.concatenate([faces[:1, ::-1], faces[1:]])


def soup(mesh: Mesh) -> Mesh:
    """The mesh with vertices of its own for each face."""
    return Mesh(mesh.vertices[mesh.faces].reshape(-1, 3), np.arange(mesh.faces.size).reshape(-1, 3))


def sheet() -> Mesh:
    """Four by four bent squares, whose rows of five vertices follow one another."""
    x, y = (of.reshape(-1) for of in np.mgrid[:5, :5].astype(float))
    at = np.arange(25).reshape(5, 5)
    a, b, c, d = (of.reshape(-1) for of in (at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return Mesh(np.stack([x, y, 0.1 * x**2], axis=1), faces)


MIDDLE = [(10, 11), (11, 12), (12, 13), (13, 14)]
"""The edges that part the sheet in two, from rim to rim."""


def with_t_junction(mesh: Mesh) -> Mesh:
    """The mesh with a vertex, 25, in the middle of the edge from 11 to 12 on one side alone."""
    ends = mesh.vertices[[11, 12]]
    (face,) = (f for f in mesh.faces.tolist() if {11, 12} <= set(f) and max(f) > 14)
    first = face.index(({*face} - {11, 12}).pop())
    apex, before, after = np.roll(face, -first).tolist()
    rest = [f for f in mesh.faces.tolist() if f != face]
    split = [[apex, before, 25], [apex, 25, after], [before, after, 25]]
    return Mesh(
        np.concatenate([mesh.vertices, ends.mean(axis=0, keepdims=True)]), np.array(rest + split)
    )


def with_copies(mesh: Mesh) -> Mesh:
    """The mesh with its first face again, and one without area, as exports have them."""
    faces = [*mesh.faces.tolist(), mesh.faces[0].tolist(), [0, 1, 1]]
    return Mesh(mesh.vertices, np.array(faces))


@pytest.mark.parametrize(
    ("made", "seams"),
    [
        (sheet(), MIDDLE),
        (soup(sheet()), MIDDLE),
        (Mesh(sheet().vertices, one_turned(sheet().faces)), MIDDLE),
        (with_copies(sheet()), MIDDLE),
        (with_t_junction(sheet()), MIDDLE),
        (with_t_junction(sheet()), [(10, 11), (11, 25), (25, 12), (12, 13), (13, 14)]),
        (soup(with_t_junction(sheet())), MIDDLE),
    ],
)
def test_a_mesh_that_must_be_mended_is_cut_where_it_is_said_and_nowhere_else(
    made: Mesh, seams: list[tuple[int, int]]
) -> None:
    """Any way the sheet is written, it falls into the halves on either side of its middle."""
    at = with_t_junction(sheet()).vertices[np.array(seams)]
    there = (made.vertices[:, None] == at.reshape(-1, 3)).all(axis=2).argmax(axis=0)
    found = mended_along(made, there.reshape(-1, 2))
    is_solid = made.face_areas > 0
    is_left = made.vertices[made.faces][is_solid, :, 0].mean(axis=1) < 2
    charts = found.charts()[is_solid]
    assert np.array_equal(charts == charts[is_left.argmax()], is_left)
    assert len(np.unique(charts)) == 2
    assert found.report["charts_cut_to_disks"] == 0
