import math

import pytest

from benchmarks.metrics.grades import grade_of
from reports.ranking import (
    TIME_TIE,
    is_of_angles,
    marks,
    may_rank,
    means_may_rank,
    ranks,
    tolerance,
    worst,
)
from reports.tables.table import Column, Table


@pytest.mark.parametrize(
    ("values", "better", "expected"),
    [
        ([1.0, 2.0, 3.0], "lower", [1, 2, 3]),
        ([1.0, 2.0, 3.0], "higher", [3, 2, 1]),
        ([1.0, 1.0, 3.0], "lower", [1, 1, 3]),  # two firsts: nobody is second
        ([1.0, 2.0, 2.0, 4.0], "lower", [1, 2, 2, 4]),
        ([None, math.nan, math.inf, 5.0], "lower", [None, None, None, 1]),
        ([], "lower", []),
    ],
)
def test_ranks_are_those_of_a_competition(values, better, expected):
    assert ranks(values, [str(value) for value in values], better) == expected


def test_what_prints_alike_is_equal():
    assert ranks([0.101, 0.099, 0.5], ["0.10", "0.10", "0.50"], "lower") == [1, 1, 3]


def test_a_chain_of_ties_does_not_end_in_one_place():
    values = [1.0, 1.04, 1.08, 1.12]
    texts = [str(value) for value in values]
    # Each is within a twentieth of the one before; 1.08 is not of the first, 1.12 is of 1.08.
    assert ranks(values, texts, "lower", 0.05) == [1, 1, 3, 3]
    assert ranks([-value for value in values], texts, "higher", 0.05) == [1, 1, 3, 3]


def test_each_metric_has_its_own_tolerance():
    assert tolerance("seconds") == tolerance("cpu_seconds") == TIME_TIE
    assert tolerance("chart_count") == 0  # 100 charts are fewer than 100.04
    assert 0 < tolerance("angle_difference_mean") < TIME_TIE


def test_where_all_are_alike_nobody_is_best():
    assert marks([2.0, 2.0], ["2.0", "2.0"], "lower") == ["", ""]
    assert marks([2.0, None], ["2.0", "–"], "lower") == ["", ""]
    assert marks([2.0, 1.0, 1.0, 3.0], list("2113"), "higher") == ["second", "", "", "best"]
    assert marks([1.0, 1.0, 2.0], list("112"), "lower") == ["best", "best", ""]


@pytest.mark.parametrize(("bad", "fit"), [(0, True), (1, True), (2, False), (10, False)])
def test_means_over_too_many_broken_maps_are_not_ranked(bad, fit):
    grades = ["broken"] * bad + ["usable"] * (10 - bad)
    assert means_may_rank(grades, angles=False) == fit
    collapsed = ["collapsed"] * bad + ["usable"] * (10 - bad)
    assert means_may_rank(collapsed, angles=True)
    assert means_may_rank([], angles=True)


@pytest.mark.parametrize(
    ("grade", "angles", "other"),
    [
        ("broken", False, False),
        ("collapsed", True, False),
        ("flawed", True, True),
        ("usable", True, True),
        (None, True, True),
        ("", True, True),
    ],
)
def test_a_grade_says_by_what_a_map_is_ranked(grade, angles, other):
    assert may_rank(grade, angles=True) == angles
    assert may_rank(grade, angles=False) == other


def test_metrics_of_angles_are_known():
    assert is_of_angles("angle_difference_mean")
    assert is_of_angles("quasi_conformal_max_without_spanning")
    assert is_of_angles("local_quasi_conformal_mean")
    for name in ("symmetric_dirichlet", "area_discrepancy_total", "seconds", "seam_length"):
        assert not is_of_angles(name)


def test_the_worst_grade_of_several_seeds_counts():
    assert worst(["usable", "broken", "flawed"]) == "broken"
    assert worst(["usable", "flawed", ""]) == "flawed"
    assert worst([]) is None


def test_a_few_flips_are_forgiven_to_maps_of_points_alone():
    values = {
        "flipped_area_fraction_without_spanning": 0.004,
        "flipped_fraction_without_spanning": 0.004,
        "overlap_area_without_spanning": 0.0,
        "degenerate_uv_count": 0.0,
        "part_area_ratio_min_without_spanning": 1.0,
        "coverage": 1.0,
        "starved_area_fraction_without_spanning": 0.0,
        "symmetric_dirichlet_without_spanning": 4.2,
    }
    assert grade_of("computed", values) == "usable"
    assert grade_of("slim", values) == "flawed"
    assert grade_of("slim", values | {"degenerate_uv_count": math.nan}) is None


def test_a_folded_map_with_the_smallest_value_is_never_best():
    # A hand folded flat has perfect areas; a collapsed one has the best angles.
    rows = (
        {"name": "folded", "angle": 0.01, "area": 0.0, "grade": "broken"},
        {"name": "shrunk", "angle": 0.02, "area": 0.1, "grade": "collapsed"},
        {"name": "flips", "angle": 0.03, "area": 0.4, "grade": "flawed"},
        {"name": "sound", "angle": 0.04, "area": 0.5, "grade": "usable"},
    )
    columns = (
        Column("name", "Name", text=True),
        Column("angle", "angle", better="lower", angles=True),
        Column("area", "area", better="lower"),
    )
    made = Table("t", "T", "", columns, (rows,))
    given = [[cell.mark for cell in row] for row in made.cells[0]]
    assert given == [["", "", ""], ["", "best", ""], ["", "second", "best"], ["", "", "second"]]


def test_in_a_row_of_methods_each_cell_has_its_own_grade():
    row = {"case": "hand", "slim": 0.2, "lscm": 0.1, "fam": 0.0, "grade fam": "broken"}
    columns = (
        Column("case", "Model", text=True),
        *(Column(name, name, better="lower", angles=True) for name in ("slim", "lscm", "fam")),
    )
    made = Table("t", "T", "", columns, ((row,),), across=True)
    assert [cell.mark for cell in made.cells[0][0]] == ["", "second", "best", ""]


def test_a_collapsed_map_is_flagged_where_it_is_ranked_and_nowhere_else():
    rows = (
        {"name": "shrunk", "angle": 0.02, "area": 0.1, "grade": "collapsed"},
        {"name": "folded", "angle": 0.01, "area": 0.1, "grade": "broken"},
        {"name": "none", "angle": None, "area": None, "grade": "collapsed"},
    )
    columns = (
        Column("name", "Name", text=True),
        Column("angle", "angle", better="lower", angles=True, digits=2),
        Column("area", "area", better="lower", digits=1),
    )
    made = Table("t", "T", "", columns, (rows,))
    assert [[cell.text for cell in row[1:]] for row in made.cells[0]] == [
        ["0.02 †", "0.1"],
        ["0.01", "0.1"],
        ["–", "–"],
    ]
