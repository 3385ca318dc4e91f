"""Tangents of a map, and normals seen in tangent space, with known answers."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from parapoint import Mesh, Parameterization
from parapoint.surfaces.parameterization import Charted
from parapoint.textures.tangents import corner_tangents, in_tangent_space
from parapoint.textures.texels import texels

UP = np.array([0.0, 0, 1])


@pytest.mark.parametrize("heights", [[0.0, 0, 0, 0], [0.3, -2, 1, 5]])
def test_tangents_are_averaged_by_angle_in_the_plane_of_the_normal(heights) -> None:
    """Two faces: u grows along x in the first, along (1, −1) in the second, as seen from above."""
    points = np.array([[0.0, 0, 0], [0, 1, 0], [1, 0, 0], [-1, 1, 0]])
    points[:, 2] = heights
    faces = np.array([[0, 2, 1], [0, 1, 3]])
    uv = np.array([[0.0, 0], [0, 1], [1, 0], [-1, 0]])
    charted = Charted(Mesh(points, faces), Parameterization(uv, faces))
    tangents, hand = corner_tangents(charted, np.tile(UP, (4, 1)))
    assert hand.tolist() == [1, 1]
    along, askew = np.array([1.0, 0, 0]), np.array([1.0, -1, 0]) / np.sqrt(2)
    assert_allclose(tangents[0, 1], along, atol=1e-12)
    assert_allclose(tangents[1, 2], askew, atol=1e-12)
    # At the first shared corner the faces have 90 and 45 degrees, at the other one 45 and 90.
    for corner, (one, other) in {0: (90, 45), 1: (45, 90)}.items():
        mean = one * along + other * askew
        for face in range(2):
            at = int(np.flatnonzero(faces[face] == corner)[0])
            assert_allclose(tangents[face, at], mean / np.linalg.norm(mean), atol=1e-12)


def test_faces_that_touch_in_a_vertex_alone_have_tangents_of_their_own() -> None:
    points = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [-1, 0, 0], [-1, -1, 0]])
    faces = np.array([[0, 1, 2], [0, 3, 4]])
    uv = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1], [-1, 1]])  # the second is turned by −90°
    charted = Charted(Mesh(points, faces), Parameterization(uv, faces))
    tangents, _ = corner_tangents(charted, np.tile(UP, (5, 1)))
    assert_allclose(tangents[0], np.tile([1.0, 0, 0], (3, 1)), atol=1e-12)
    assert_allclose(tangents[1], np.tile([0.0, 1, 0], (3, 1)), atol=1e-12)


def test_a_mirrored_map_keeps_the_direction_in_which_v_grows() -> None:
    """The axes of tangent space are the directions of u and of v, whichever way the map turns."""
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    rows = np.tile([[0.6, 0.0, 0.8], [0.0, 0.6, 0.8], [0.0, 0.0, 1.0]], (200, 1))
    for mirror in (1, -1):
        uv = 0.5 + (corners[:, :2] - 0.5) * [mirror, 1]
        charted = Charted(Mesh(corners, faces), Parameterization(uv, faces))
        shown = texels(charted, 16)
        seen = in_tangent_space(shown)(rows[: len(shown.places)], slice(None))
        wanted = rows[: len(shown.places)] * [mirror, 1, 1]
        assert_allclose(seen, wanted, atol=1e-12)
        assert corner_tangents(charted, np.tile(UP, (4, 1)))[1].tolist() == [mirror, mirror]
