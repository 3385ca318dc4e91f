"""What surfaces a method may refuse, and what is done to those it can take after a cut."""

import numpy as np
import pytest

from parapoint import Mesh, PointCloud
from parapoint.method import REQUIREMENTS, UnsupportedError, prepared

TETRAHEDRON = Mesh(
    [[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]
)
DISK = Mesh(TETRAHEDRON.vertices, TETRAHEDRON.faces[:3])
TWO = Mesh(
    np.concatenate([DISK.vertices, DISK.vertices + 5]), np.concatenate([DISK.faces, DISK.faces + 4])
)
CLOUD = PointCloud(TETRAHEDRON.vertices)


@pytest.mark.parametrize(
    ("word", "surface", "reason"),
    [
        ("faces", CLOUD, "needs faces; the surface is a point cloud"),
        ("disk", CLOUD, "needs faces; the surface is a point cloud"),
        ("disk", TETRAHEDRON, "needs a disk; the surface is sphere"),
        ("connected", TWO, "needs a connected mesh; the surface is 2 components"),
        ("disk_after_cut", TWO, "no disk cut"),
        ("faces", TETRAHEDRON, None),
        ("disk", DISK, None),
    ],
)
def test_requirements_name_their_reason(word, surface, reason):
    found = REQUIREMENTS[word](surface)
    assert found == reason or (found and reason and reason in found)


def test_a_disk_is_handed_on_as_it_is():
    assert prepared(DISK, frozenset({"faces", "disk_after_cut"})) == (DISK, "")


def test_a_closed_surface_is_cut_and_the_step_is_named():
    surface, step = prepared(TETRAHEDRON, frozenset({"faces", "disk_after_cut"}))
    assert isinstance(surface, Mesh)
    assert surface.topology == "disk"
    assert step == "automatic cut to a disk"
    np.testing.assert_array_equal(
        surface.vertices[surface.faces], TETRAHEDRON.vertices[TETRAHEDRON.faces]
    )


def test_a_strict_disk_method_is_refused_a_sphere():
    with pytest.raises(UnsupportedError, match="needs a disk; the surface is sphere"):
        prepared(TETRAHEDRON, frozenset({"disk"}))


def test_an_unknown_word_is_a_bug_of_the_method():
    with pytest.raises(KeyError, match="flat"):
        prepared(DISK, frozenset({"flat"}))
