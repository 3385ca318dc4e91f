"""A camera: upright, right-handed, and with all of the surface in its picture."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from benchmarks.rendering.camera import camera
from parapoint.surfaces.surface import Mesh

BOX = Mesh(
    [[0, 0, 0], [4, 0, 0], [4, 2, 0], [0, 2, 0], [0, 0, 1], [99, 99, 99]],
    [[0, 1, 2], [0, 2, 3], [0, 1, 4]],
)


@pytest.mark.parametrize("length", [1.0, 7.0])
def test_a_camera_from_above_has_x_to_the_right_and_y_upwards(length):
    made = camera(BOX, length * np.array([0.0, 0, 1]), length * np.array([0.0, 3, 0]), margin=1.1)
    assert_allclose(made.axes, np.eye(3), atol=1e-12)
    assert_allclose(made.centre, [2, 1, 0.5])
    assert_allclose(made.half, [2.2, 1.1])
    assert_allclose(made.screen(np.array([[4.0, 2, 1]])), [[2, 1, 0.5]])


def test_a_slanted_camera_is_orthonormal_and_sees_all_that_has_faces():
    made = camera(BOX, np.array([1.0, -2, 3]), np.array([0.0, 0, 1]))
    assert_allclose(made.axes @ made.axes.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(made.axes) == pytest.approx(1)
    assert made.axes[0, 2] == pytest.approx(0)  # right is level
    assert made.axes[1, 2] > 0  # up is upwards
    assert_allclose(made.axes[2], np.array([1, -2, 3]) / np.sqrt(14))
    seen = np.abs(made.screen(BOX.vertices[:5])[:, :2]).max(axis=0)
    assert_allclose(made.half, 1.04 * seen)


def test_a_thin_picture_is_widened_to_a_quarter_of_its_depth():
    line = Mesh([[0, 0, 0], [0, 0, 8], [0.1, 0, 4]], [[0, 1, 2]])
    made = camera(line, np.array([0.0, 0, 1]), np.array([0.0, 1, 0]), margin=1.0)
    assert_allclose(made.half, [1, 1])
