import math

import pytest

from reports.contents import contents
from reports.means import STATISTICS, common_cases, common_values, own_values, statistic

from .conftest import Writer, flat, sheet


@pytest.mark.parametrize(
    ("name", "better", "expected"),
    [
        ("mean", "lower", 4.0),
        ("median", "lower", 2.5),
        ("worst", "lower", 10.0),
        ("worst", "higher", 1.0),
        ("mean", "higher", 4.0),
    ],
)
def test_statistics_by_hand(name, better, expected):
    assert statistic(name, [1.0, 3.0, 2.0, 10.0], better) == expected
    assert statistic(name, [], better) is None


def test_there_are_three():
    assert list(STATISTICS) == ["mean", "median", "worst"]


@pytest.fixture
def suite(tmp_path):
    """LSCM gives a map of a, b and c, ARAP of a and b, Tutte of none."""
    writer = Writer(tmp_path)
    with writer.store.writing():
        for case in "abc":
            writer.cell(case, sheet(), "lscm", {}, result=flat(sheet()))
            given = {"status": "failed", "reason": "no"} if case == "c" else {}
            writer.cell(case, sheet(), "arap", {}, result=None if given else flat(sheet()), **given)
            writer.cell(case, sheet(), "tutte", {}, status="failed", reason="no")
    return contents(tmp_path)[0]


def test_common_models_are_those_of_all_who_ever_end_well(suite):
    assert common_cases(suite, suite.cases) == ["a", "b"]
    assert common_cases(suite, ["c"]) == ["c"]  # there LSCM alone gives a map
    assert common_cases(suite, []) == []


def test_a_model_without_the_metric_is_no_common_model_of_it(suite):
    suite.means.loc[suite.means["case"] == "a", "stretch_l2"] = math.nan
    assert common_cases(suite, suite.cases, "stretch_l2") == ["b"]
    assert common_cases(suite, suite.cases, "seconds") == ["a", "b"]


def test_values_over_some_of_the_models_are_no_common_values(suite):
    lscm, arap = (label for label in suite.methods if label.method != "tutte")
    suite.means.loc[suite.means["label"] == "LSCM", "seconds"] = [1.0, math.nan, 3.0]
    assert own_values(suite, lscm, "seconds") == [1.0, 3.0]
    assert own_values(suite, lscm, "seconds", ["a", "b"]) == [1.0]
    assert common_values(suite, lscm, "seconds", ["a", "b"]) == []
    assert common_values(suite, lscm, "seconds", ["a", "c"]) == [1.0, 3.0]
    assert common_values(suite, arap, "seconds", ["a", "b"]) == [0.25, 0.25]
