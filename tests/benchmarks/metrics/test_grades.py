import igl
import numpy as np
import pytest

from benchmarks.metrics.evaluation import evaluate
from benchmarks.metrics.grades import grade
from parapoint import Mesh, Parameterization

PERFECT = {
    "flipped_area_fraction_without_spanning": 0.0,
    "flipped_fraction_without_spanning": 0.0,
    "overlap_area_without_spanning": 0.0,
    "degenerate_uv_count": 0.0,
    "part_area_ratio_min_without_spanning": 1.0,
    "starved_area_fraction_without_spanning": 0.0,
    "symmetric_dirichlet_without_spanning": 4.0,
    "coverage": 1.0,
}
POINTS = {
    "local_quasi_conformal_mean": 1.0,
    "uv_collision_fraction": 0.0,
    "point_part_area_ratio_min": 1.0,
    "starved_point_fraction": 0.0,
    "coverage": 1.0,
}
ALIAS = {
    "flipped_area": "flipped_area_fraction_without_spanning",
    "flipped": "flipped_fraction_without_spanning",
    "overlap": "overlap_area_without_spanning",
    "degenerate": "degenerate_uv_count",
    "part": "part_area_ratio_min_without_spanning",
    "starved": "starved_area_fraction_without_spanning",
    "energy": "symmetric_dirichlet_without_spanning",
    "coverage": "coverage",
}


@pytest.mark.parametrize(
    ("changed", "of_mesh", "of_cloud"),
    [
        ({}, "usable", "usable"),
        ({"flipped_area": 0.05, "flipped": 0.05}, "flawed", "flawed"),
        ({"flipped_area": 0.0501, "flipped": 0.0501}, "broken", "broken"),
        ({"overlap": 0.05}, "flawed", "flawed"),
        ({"overlap": 0.0501}, "broken", "broken"),
        ({"overlap": float("inf")}, "broken", "broken"),
        ({"energy": float("inf")}, "broken", "broken"),
        ({"part": 0.249}, "collapsed", "collapsed"),
        ({"part": 0.1, "overlap": 0.2}, "broken", "broken"),
        ({"part": 0.1, "flipped": 0.01, "flipped_area": 0.01}, "collapsed", "collapsed"),
        ({"flipped": 0.005, "flipped_area": 0.005}, "flawed", "usable"),
        ({"flipped": 0.0051}, "flawed", "flawed"),
        ({"overlap": 0.01}, "flawed", "usable"),
        ({"overlap": 0.0101}, "flawed", "flawed"),
        ({"degenerate": 1.0}, "flawed", "usable"),
        ({"starved": 0.02}, "usable", "usable"),
        ({"starved": 0.0201}, "flawed", "flawed"),
        ({"coverage": 0.95}, "usable", "usable"),
        ({"coverage": 0.9499}, "flawed", "flawed"),
        ({"coverage": 0.1, "part": 0.1}, "collapsed", "collapsed"),
    ],
)
def test_each_bound_parts_two_grades(changed, of_mesh, of_cloud):
    values = PERFECT | {ALIAS[name]: value for name, value in changed.items()}
    assert grade(values, of_cloud=False) == of_mesh
    assert grade(values, of_cloud=True) == of_cloud


@pytest.mark.parametrize(
    ("changed", "expected"),
    [
        ({}, "usable"),
        ({"local_quasi_conformal_mean": float("inf")}, "broken"),
        ({"uv_collision_fraction": 0.051}, "broken"),
        ({"uv_collision_fraction": 0.02}, "flawed"),
        ({"uv_collision_fraction": 0.01}, "usable"),
        ({"point_part_area_ratio_min": 0.2}, "collapsed"),
        ({"starved_point_fraction": 0.03}, "flawed"),
        ({"coverage": 0.95}, "usable"),  # some stray points have no uv
        ({"coverage": 0.9499}, "flawed"),
    ],
)
def test_a_cloud_without_faces_has_grades_too(changed, expected):
    assert grade(POINTS | changed, of_cloud=True) == expected


def test_a_map_is_broken_where_no_face_has_an_area_in_it():
    """One face of 392 that is folded to a line is a flaw."""
    uv, faces = igl.triangulated_grid(15, 15)
    mesh = Mesh(np.column_stack([uv, np.zeros(len(uv))]), faces)
    folded = uv[faces]
    folded[0, 2] = folded[0, :2].mean(axis=0)
    corners = np.arange(3 * len(faces)).reshape(-1, 3)
    values = evaluate(mesh, Parameterization(folded.reshape(-1, 2), corners))
    assert grade(values, of_cloud=False) == "flawed"
    values = evaluate(mesh, Parameterization(np.zeros_like(uv), faces))
    assert grade(values, of_cloud=False) == "broken"


def test_a_missing_metric_is_an_error():
    with pytest.raises(KeyError):
        grade({}, of_cloud=False)
