"""What is done to a surface before a method sees it."""

import numpy as np
import pytest

from parapoint import Mesh
from parapoint.method import UnsupportedError
from parapoint.preparation import prepared

TETRAHEDRON = Mesh(
    [[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]
)
DISK = Mesh(TETRAHEDRON.vertices, TETRAHEDRON.faces[:3])


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
