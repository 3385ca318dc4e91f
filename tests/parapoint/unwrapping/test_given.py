"""Maps along seams that are given."""

import numpy as np
import pytest

from benchmarks.metrics.evaluation import evaluate
from parapoint import InputError, Mesh
from parapoint.testing import irregular_disk, sphere
from parapoint.unwrapping.given import unwrapped_along

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
    faces = disk.faces.copy()
    faces[0] = faces[0, ::-1]
    with pytest.raises(InputError, match="seams can be given for a manifold"):
        unwrapped_along(Mesh(disk.vertices, faces), NONE)
