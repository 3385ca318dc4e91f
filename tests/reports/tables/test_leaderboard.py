import json
from types import SimpleNamespace

import pytest

from reports.contents import (
    ANGLE,
    AREA,
    POINT_ANGLE,
    POINT_AREA,
    POINT_COLLISIONS,
    POINT_TEARS,
    contents,
)
from reports.labels import Label
from reports.page.board import data
from reports.tables import leaderboard
from reports.tables.leaderboard import SHOWN, Winner, definition, glances, winner
from reports.tables.suites import comparison

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
    [(1.0, ("LSCM", "ARAP")), (1.04, ("LSCM", "ARAP")), (1.07, ("LSCM",)), (0.93, ("ARAP",))],
)
def test_times_within_a_twentieth_are_equal(tmp_path, second, names):
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


def test_a_glance_tells_the_second_and_the_best_of_ours_where_it_is_neither(monkeypatch):
    won = {"a": "LATy", "b": "LAT", "c": "LA", "d": "L", "e": ""}  # the best of each model
    methods = [("lscm", "L"), ("arap", "A"), ("tutte", "T"), ("parapoint", "x"), ("parapoint", "y")]
    labels = [Label(method, "{}", method, "", short) for method, short in methods]
    suite = SimpleNamespace(cases=list(won), methods=labels)
    monkeypatch.setattr(
        leaderboard,
        "winner",
        lambda _, case, __: Winner(tuple(won[case]), "") if won[case] else None,
    )
    first = glances(suite)[0]
    assert (first.names, first.count, first.of, first.next) == (("L",), 4, 4, ("A on 3", "y on 1"))


def test_the_cells_are_json_with_every_metric(suite):
    given = json.loads(json.dumps(data([suite]), allow_nan=False))
    names = [metric["name"] for metric in given["metrics"]]
    assert given["shown"] == [name for name in SHOWN if name in names]
    assert set(SHOWN).difference(names) == {POINT_ANGLE, POINT_AREA, POINT_COLLISIONS, POINT_TEARS}
    assert names[-2:] == ["seconds", "cpu_seconds"]
    groups = {metric["name"]: metric["group"] for metric in given["metrics"]}
    assert [groups[name] for name in (ANGLE, AREA, "seconds")] == ["angles", "areas", "cost"]
    (only,) = given["suites"]
    assert [model["name"] for model in only["models"]] == [HAND, DEVIL, NEFERTITI]
    assert len(only["cells"]) == len(suite.rows)
    assert all(len(cell["entries"]) == len(names) for cell in only["cells"])
    hostile = next(cell for cell in only["cells"] if cell["status"] == "timeout")
    assert only["methods"][hostile["method"]]["name"] == HOSTILE
    assert hostile["entries"][0] == ["–", None, ""]
    for method in only["methods"]:
        done, asked = map(int, method["ok"].split("/"))
        assert method["share"] == done / asked
    measured = suite.measured.set_index("id").loc[suite.rows[0].id, "angle_difference_mean"]
    at = names.index("angle_difference_mean")
    assert only["cells"][0]["entries"][at][1] == pytest.approx(measured, rel=1e-4)


def test_the_page_shows_what_was_ranked_here(tmp_path):
    """Three methods with known values: the page has the marks and statistics of the tables."""
    writer = Writer(tmp_path)
    with writer.store.writing():
        for case in "abc":
            for method in ("lscm", "arap", "tutte"):
                writer.cell(case, sheet(), method, {}, result=flat(sheet()))
    made = contents(tmp_path)[0]
    means = made.means
    known = {"LSCM": [0.1, 0.2, 0.9], "ARAP": [0.2, 0.3, 0.4], "Tutte": [0.01, 0.01, 0.01]}
    for short, values in known.items():
        means.loc[means["label"] == short, AREA] = values
    means.loc[means["label"] == "Tutte", "grade"] = "broken"
    given = data([made])
    at = [metric["name"] for metric in given["metrics"]].index(AREA)
    (only,) = given["suites"]
    order = [method["name"] for method in only["methods"]]

    def shown(entries):
        return {name: own[at] for name, own in zip(order, entries, strict=True)}

    for over in ("common", "own"):
        assert shown(only["summaries"]["mean"][over]) == {
            "Tutte": ("0.010", 0.01, ""),  # broken: shown, and never best
            "LSCM": ("0.400", 0.4, "second"),
            "ARAP": ("0.300", 0.3, "best"),
        }
        medians = shown(only["summaries"]["median"][over])
        assert (medians["LSCM"][1:], medians["ARAP"][1:]) == ((0.2, "best"), (0.3, "second"))
        worst = shown(only["summaries"]["worst"][over])
        assert (worst["LSCM"][1:], worst["ARAP"][1:]) == ((0.9, "second"), (0.4, "best"))
    # A digit for each pair, method by method: LSCM is behind ARAP on the last model alone.
    assert only["won"]["areas"] == ["100212201", "100212201", "100210221"]
    # Student's t at 97.5 % of one and of two degrees of freedom.
    assert given["quantiles"] == [
        None,
        None,
        pytest.approx(12.7062),
        pytest.approx(4.3027, abs=1e-4),
    ]
    first = shown([one["entries"] for one in only["models"][0]["maps"]])
    assert [first[name][2] for name in ("Tutte", "LSCM", "ARAP")] == ["", "best", "second"]
    assert winner(made, "a", AREA).names == ("LSCM",)
    angle = [metric["name"] for metric in given["metrics"]].index(ANGLE)
    again = contents(tmp_path)[0]
    again.means.loc[again.means["label"] == "LSCM", "grade"] = "collapsed"
    maps = data([again])["suites"][0]["models"][0]["maps"]
    lscm = maps[order.index("LSCM")]["entries"]
    assert lscm[angle][0].endswith(" †")
    assert (lscm[at][0].endswith(" †"), lscm[at][2]) == (False, "")
    rows = comparison(made, [AREA])
    marks = {cells[1].text: [cell.mark for cell in cells[2:6]] for cells in rows.cells[0]}
    assert marks["Tutte"] == [""] * 4
    assert marks["LSCM"] == ["second", "best", "second", "second"]


def test_a_definition_names_unit_weighting_and_source():
    told = definition("angle_difference_mean")
    for part in ("radians", "lower is better", "corners, unweighted", "ParaPoint, supplement"):
        assert part in told
    assert definition("nothing") == ""


def test_the_page_tells_common_from_own_models_and_ranks_no_atlas(tmp_path):
    writer = Writer(tmp_path)
    with writer.store.writing():
        for case in "abc":
            for method in ("lscm", "arap", "xatlas"):
                lost = (case, method) == ("c", "arap")
                given = {"status": "failed", "reason": "no"} if lost else {}
                result = None if lost else flat(sheet())
                writer.cell(case, sheet(), method, {}, result=result, **given)
    made = contents(tmp_path)[0]
    means = made.means
    means.loc[means["label"] == "xatlas", ["chart_count", AREA]] = 40.0, 0.0
    means.loc[means["label"] == "LSCM", AREA] = [0.1, 0.2, 0.9]
    means.loc[(means["label"] == "ARAP") & (means["case"] != "c"), AREA] = 0.3
    assert made.atlases == {"xatlas"}
    given = data([made])
    at = [metric["name"] for metric in given["metrics"]].index(AREA)
    (only,) = given["suites"]
    order = [method["name"] for method in only["methods"]]
    assert only["common"] == 2
    found = {
        over: {name: own[at][1:] for name, own in zip(order, entries, strict=True)}
        for over, entries in only["summaries"]["mean"].items()
    }
    assert found["common"] == {"LSCM": (0.15, "best"), "ARAP": (0.3, "second"), "xatlas": (0, "")}
    assert found["own"] == {"LSCM": (0.4, "second"), "ARAP": (0.3, "best"), "xatlas": (0, "")}
    maps = [model["maps"] for model in only["models"]]
    marks = {name: one["entries"][at][2] for name, one in zip(order, maps[0], strict=True)}
    assert marks == {"LSCM": "best", "ARAP": "second", "xatlas": ""}
    assert maps[2][order.index("ARAP")]["status"] == "failed"
    assert winner(made, "a", AREA).names == ("LSCM",)
    assert only["methods"][order.index("xatlas")]["detail"] == "many charts, not ranked"
    assert only["methods"][order.index("ARAP")]["bad"] == "1 failed"
    assert only["methods"][order.index("ARAP")]["reasons"] == "c: failed, no"
