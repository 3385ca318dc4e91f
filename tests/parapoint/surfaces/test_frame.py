import numpy as np

from parapoint.surfaces.frame import Frame


def test_a_frame_has_the_middle_of_the_box_at_its_origin_and_the_farthest_point_at_one() -> None:
    # The box is 4 by 2, so its middle is (2, 1, 0), and its corners are √5 from there. Three of
    # four points lie on the left: their mean is not in the middle.
    points = np.array([[0.0, 0, 0], [0, 1, 0], [0, 2, 0], [4, 0, 0]])
    frame = Frame.of(points)
    np.testing.assert_allclose(frame.centre, [2, 1, 0])
    np.testing.assert_allclose(frame.scale, np.sqrt(5))
    np.testing.assert_allclose(frame.inside(points)[1], [-2 / np.sqrt(5), 0, 0], atol=1e-12)
    np.testing.assert_allclose(frame.outside(frame.inside(points)), points, atol=1e-12)
