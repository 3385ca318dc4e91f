import pytest

from parapoint.surfaces.parameterization import PointParameterization
from parapoint.surfaces.surface import PointCloud
from reports.contents import ANGLE, ISOMETRIC, POINT_ANGLE, WORST_PART, contents
from reports.tables.methods import methods

from ..conftest import Writer, seeded, sheet


def rows(suite):
    return {row["label"]: row for row in methods(suite).blocks[0]}


def test_a_method_stands_beside_what_it_reads_and_how_often_it_worked(results):
    found = rows(contents(results)[0])
    assert found["ParaPoint"]["input"] == "points"
    assert found["SLIM symmetric Dirichlet"]["input"] == "mesh"
    assert found["ParaPoint"]["ok"] == "3/3"
    assert found["SLIM symmetric Dirichlet"]["ok"] == "2/3"  # it skips the closed one
    assert found["ParaPoint"]["one to one"] == "2/3"


def test_the_worst_part_is_that_of_the_worst_map_and_means_are_of_common_models(tmp_path):
    suite = seeded(tmp_path, cases=("a", "b"), seeds=(0,))
    suite.records["a", "LSCM"] |= {WORST_PART: 0.1, ANGLE: 0.2, "coverage": 0.5, "grade": "flawed"}
    suite.records["b", "LSCM"] |= {WORST_PART: 0.7, ANGLE: 0.4, "coverage": 1.0, "grade": "usable"}
    row = rows(suite)["LSCM"]
    assert row[WORST_PART] == 0.1
    assert row["coverage"] == 0.75
    assert row["usable"] == "1/2"
    assert row[ANGLE] == pytest.approx(0.3)
    suite.records["b", "ParaPoint"]["ok"] = 0  # nobody gains by failing: b counts for none
    assert rows(suite)["LSCM"][ANGLE] == pytest.approx(0.2)


def test_means_over_broken_or_collapsed_maps_are_not_ranked(tmp_path):
    suite = seeded(tmp_path, cases=("a", "b"), seeds=(0,))
    for record in suite.records.values():
        record["grade"] = "usable"
    for grade, unranked in (("collapsed", [ISOMETRIC]), ("broken", [ANGLE, ISOMETRIC])):
        suite.records["a", "LSCM"]["grade"] = grade
        row = rows(suite)["LSCM"]
        assert [name for name in (ANGLE, ISOMETRIC) if row[f"grade {name}"]] == unranked


def test_clouds_have_neither_angles_of_faces_nor_a_count_of_one_to_one(tmp_path):
    writer = Writer(tmp_path)
    points = PointCloud(sheet().vertices)
    with writer.store.writing():
        result = PointParameterization(points.points[:, :2])
        writer.cell("a", points, "computed", {}, result=result)
    keys = [column.key for column in methods(contents(tmp_path)[0]).columns]
    assert "one to one" not in keys
    assert POINT_ANGLE in keys
    assert ANGLE not in keys
