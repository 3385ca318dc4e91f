"""What surfaces a method may refuse."""

import numpy as np
import pytest

from parapoint import Mesh, PointCloud
from parapoint.method import REQUIREMENTS

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
        ("connected", TWO, None),
        ("disk_after_cut", CLOUD, "needs faces; the surface is a point cloud"),
        ("faces", TETRAHEDRON, None),
        ("disk", DISK, None),
        ("seams", TETRAHEDRON, "needs a mesh that came with a UV map, for its seams"),
        ("seams", Mesh(TETRAHEDRON.vertices, TETRAHEDRON.faces, [[0, 1]]), None),
        ("seams", CLOUD, "needs a mesh that came with a UV map, for its seams"),
        ("points", CLOUD, None),
        ("points", DISK, "takes a point cloud; the surface is a mesh"),
    ],
)
def test_requirements_name_their_reason(word, surface, reason):
    found = REQUIREMENTS[word](surface)
    assert found == reason or (found and reason and reason in found)
