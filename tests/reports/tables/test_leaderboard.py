import json

import pytest

from reports.contents import (
    POINT_ANGLE,
    POINT_AREA,
    POINT_COLLISIONS,
    POINT_TEARS,
    contents,
)
from reports.tables.leaderboard import SHOWN, data, definition, glances, winner

from ..conftest import DEVIL, HAND, HOSTILE, NEFERTITI, Writer, flat, sheet


@pytest.fixture
def suite(results):
    return contents(results)[0]


def test_the_winner_is_the_best_by_the_metric_s_direction(suite):
    # The sheet: dropping z without shear keeps angles best; all are one to one.
    assert winner(suite, HAND, "angle_difference_mean").names == ("SLIM conformal",)
    assert len(winner(suite, HAND, "bijective").names) == 3
    assert len(winner(suite, HAND, "seconds").names) == 3  # equals win together
    assert winner(suite, NEFERTITI, "angle_difference_mean").names == ("ParaPoint",)
    assert winner(suite, NEFERTITI, "bijective") is None  # no map is


@pytest.mark.parametrize(
    ("second", "names"),
    [(1.0, ("LSCM", "ARAP")), (1.004, ("LSCM", "ARAP")), (1.02, ("LSCM",)), (0.98, ("ARAP",))],
)
def test_equal_to_three_digits_is_equal(tmp_path, second, names):
    writer = Writer(tmp_path)
    with writer.store.writing():
        for method, seconds in (("lscm", 1.0), ("arap", second)):
            writer.cell(HAND, sheet(), method, {}, result=flat(sheet()), seconds=seconds)
    assert set(winner(contents(tmp_path)[0], HAND, "seconds").names) == set(names)


def test_at_a_glance(suite):
    angles = glances(suite)[0]
    assert (angles.title, angles.names, angles.count, angles.of) == (
        "Angles",
        ("SLIM conformal",),
        2,
        3,
    )
    assert angles.next == ("ParaPoint on 1",)


def test_the_cells_are_json_with_every_metric(suite):
    given = json.loads(json.dumps(data([suite]), allow_nan=False))
    names = [metric["name"] for metric in given["metrics"]]
    assert given["shown"] == [name for name in SHOWN if name in names]
    assert set(SHOWN).difference(names) == {POINT_ANGLE, POINT_AREA, POINT_COLLISIONS, POINT_TEARS}
    assert names[-1] == "seconds"
    (only,) = given["suites"]
    assert [model["name"] for model in only["models"]] == [HAND, DEVIL, NEFERTITI]
    assert len(only["cells"]) == len(suite.rows)
    assert all(len(cell["values"]) == len(names) for cell in only["cells"])
    hostile = next(cell for cell in only["cells"] if cell["status"] == "timeout")
    assert only["methods"][hostile["method"]]["name"] == HOSTILE
    assert hostile["values"][0] is None
    measured = suite.measured.set_index("id").loc[suite.rows[0].id, "angle_difference_mean"]
    at = names.index("angle_difference_mean")
    assert only["cells"][0]["values"][at] == pytest.approx(measured, rel=1e-4)


def test_a_definition_names_unit_weighting_and_source():
    told = definition("angle_difference_mean")
    for part in ("radians", "lower is better", "corners, unweighted", "ParaPoint, supplement"):
        assert part in told
    assert definition("nothing") == ""
