"""The overall order by hand-made rows, one test for each rule."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from reports.contents import ANGLE, AREA, POINT_ANGLE, POINT_AREA, contents
from reports.labels import Label
from reports.tables import overall
from reports.tables.overall import LOST, SHARED, WON, outcome, place, shares

from ..conftest import Writer, flat, sheet


def record(grade="usable", angle=0.1, area=0.5, ok=1, **given):
    return {"grade": grade, "ok": ok, ANGLE: angle, AREA: area, "cpu_seconds": 1.0} | given


def suite(**methods):
    """Records of methods, one a model, as a report reads them."""
    count = len(next(iter(methods.values())))
    return SimpleNamespace(
        cases=[str(n) for n in range(count)],
        methods=[Label(name, "{}", name, "", name) for name in methods],
        records={
            (str(n), name): one
            for name, records in methods.items()
            for n, one in enumerate(records)
            if one is not None
        },
        clouds=frozenset(),
        unranked=frozenset(),
    )


ORDER = ("usable", "flawed", "collapsed", "broken")


@pytest.mark.parametrize("at", range(3))
def test_the_better_grade_wins_whatever_the_values(at):
    better, worse = record(ORDER[at], angle=9, area=9), record(ORDER[at + 1], angle=0, area=0)
    assert outcome(better, worse, ANGLE) == WON
    assert outcome(worse, better, AREA) == LOST


def test_a_broken_map_wins_over_none_and_none_is_none():
    none = record("", ok=0, angle=math.nan)
    assert outcome(record("broken"), none, ANGLE) == WON
    assert outcome(None, record("broken"), ANGLE) == LOST
    assert outcome(None, none, ANGLE) == SHARED


def test_of_one_grade_the_better_value_wins_by_the_metric_s_direction():
    good, bad = record(angle=0.1, packing_efficiency=0.9), record(angle=0.2, packing_efficiency=0.1)
    assert outcome(good, bad, ANGLE) == WON
    assert outcome(bad, good, ANGLE) == LOST
    assert outcome(good, bad, "packing_efficiency") == WON


def test_within_the_tolerance_a_pair_is_shared():
    assert outcome(record(angle=0.1), record(angle=0.10005), ANGLE) == SHARED
    assert outcome(record(angle=0.1), record(angle=0.1002), ANGLE) == WON
    assert outcome(record(angle=0.0), record(angle=0.0), ANGLE) == SHARED


def test_two_broken_maps_share_and_collapsed_ones_are_compared_by_angles_alone():
    one, two = record("broken", 0.1, 0.1), record("broken", 0.2, 0.2)
    assert outcome(one, two, ANGLE) == SHARED
    one, two = record("collapsed", 0.1, 0.1), record("collapsed", 0.2, 0.2)
    assert outcome(one, two, ANGLE) == WON
    assert outcome(one, two, AREA) == SHARED


def test_a_value_that_is_missing_shares():
    assert outcome(record(angle=math.nan), record(), ANGLE) == SHARED


def test_shares_are_means_over_models_and_rivals_half_angles_half_areas():
    found = shares(
        suite(
            a=[record(angle=0.1, area=0.1), record(angle=0.1, area=0.3)],
            b=[record(angle=0.2, area=0.2), record(angle=0.2, area=0.2)],
            c=[record(angle=0.3, area=0.3), None],
        )
    )
    assert [one.method for one in found] == ["a", "b", "c"]
    # a: all of two pairs; then half of that with b (angles), all of that with c.
    assert [one.share for one in found] == pytest.approx([(1 + 0.75) / 2, (0.5 + 0.75) / 2, 0])
    # Two models: t of one degree of freedom, 12.706, times |x - y| / 2, but no more than 1.
    assert found[0].half == 1
    assert found[2].half == 0


def test_every_share_is_won_from_somebody():
    generator = np.random.default_rng(0)
    methods = {
        name: [
            record(ORDER[generator.integers(4)], *generator.random(2))
            if generator.random() < 0.8
            else None
            for _ in range(7)
        ]
        for name in "abcde"
    }
    found = shares(suite(**methods))
    assert sum(one.share for one in found) == pytest.approx(5 / 2)
    assert all(0 <= one.share <= 1 for one in found)


def test_one_extreme_mean_wins_no_more_than_its_model():
    """A tiny angle on one model, however tiny, wins the pairs of that model and no other."""
    plain = [record(angle=0.2) for _ in range(5)]
    extreme = [record(angle=1e-9), *(record(angle=0.3) for _ in range(4))]
    found = {one.method: one.share for one in shares(suite(plain=plain, extreme=extreme))}
    assert found["extreme"] < found["plain"]


def test_a_place_needs_an_interval_wholly_above():
    others = [(0.9, 0.05), (0.8, 0.1), (0.3, math.nan)]
    assert [place(share, half, others) for share, half in others] == [1, 1, 3]
    assert place(0.84, 0.005, others) == 2


def test_methods_with_many_charts_take_no_part():
    made = suite(a=[record()], b=[record(angle=0.2)], many=[record(angle=0, area=0)])
    made.unranked = frozenset({"many"})
    assert [one.method for one in shares(made)] == ["a", "b"]
    made.unranked = frozenset({"many", "b"})
    assert shares(made) == []


def test_a_cloud_is_judged_by_the_metrics_of_points():
    one = record(angle=math.nan, area=math.nan, **{POINT_ANGLE: 1.1, POINT_AREA: 0.2})
    two = record(angle=math.nan, area=math.nan, **{POINT_ANGLE: 1.2, POINT_AREA: 0.1})
    made = suite(a=[one], b=[two])
    made.clouds = frozenset({"0"})
    assert overall.halves(made, "angles")[0].tolist() == [[1, 2], [0, 1]]
    assert overall.halves(made, "areas")[0].tolist() == [[1, 0], [2, 1]]


def test_the_table_has_places_shares_and_grades(tmp_path):
    writer = Writer(tmp_path)
    with writer.store.writing():
        for case in ("a", "b"):
            writer.cell(case, sheet(), "slim", {}, result=flat(sheet()))
            writer.cell(case, sheet(), "lscm", {}, result=flat(sheet(), 0.5))
            writer.cell(case, sheet(), "tutte", {}, status="failed", reason="no")
    (made,) = contents(tmp_path)
    table = overall.overall(made)
    (rows,) = table.blocks
    assert [(row["method"], row["place"], row["usable"]) for row in rows] == [
        ("SLIM", 1, 2),
        ("LSCM", 2, 2),
        ("Tutte", 3, 0),
    ]
    assert "grade wins" in table.caption
