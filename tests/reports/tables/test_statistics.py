import math
from types import SimpleNamespace

import numpy as np
import pytest

from reports.contents import ANGLE, AREA, contents
from reports.labels import Label
from reports.tables.statistics import _pair, half_width, holm, pair, paired_tests, seed_variance
from reports.tables.variants import ablation

from ..conftest import seeded

LABELS = [Label(name, "{}", name, "", name) for name in "xy"]


def test_a_pair_by_hand():
    # Five differences of one sign: 2 of 2^5 sign patterns are as extreme.
    found = pair(np.array([1.0, 2, 3, 4, 5]), np.array([2.0, 4, 6, 8, 10]))
    assert found.models == 5
    assert found.difference == -3
    assert found.wins == 5
    assert found.p == pytest.approx(2 / 32)
    # A zero is left out; the ranks of 1, 1, 2 are 1.5, 1.5, 3: of 2^3 patterns 2 are as extreme.
    assert pair(np.array([1.0, 1, 2, 7]), np.array([0.0, 0, 0, 7])).p == pytest.approx(2 / 8)


def test_a_pair_without_a_difference_has_no_p():
    assert math.isnan(pair(np.ones(6), np.ones(6)).p)
    assert pair(np.ones(1), np.zeros(1)).p == 1  # either sign is as likely
    assert pair(np.array([1.0, 2]), np.array([2.0, 1])).p == 1  # and no p is above 1
    assert math.isnan(pair(np.ones(0), np.ones(0)).difference)


def test_a_long_pair_with_ties_is_quiet_and_symmetric():
    first, second = np.round(np.random.default_rng(0).random((2, 30)), 1)
    assert pair(first, second).p == pytest.approx(pair(second, first).p)


def test_holm_by_hand():
    corrected = holm(np.array([0.01, 0.04, 0.03, np.nan]))
    np.testing.assert_allclose(corrected, [0.03, 0.06, 0.06, np.nan])
    np.testing.assert_allclose(holm(np.array([0.9, 0.8])), [1, 1])


def test_the_confidence_interval_by_hand():
    # s = 1 over three values; t of two degrees of freedom at 97.5 % is 4.3027.
    assert half_width(np.array([1.0, 2, 3])) == pytest.approx(4.3027 / math.sqrt(3), rel=1e-4)
    assert math.isnan(half_width(np.array([1.0])))


def test_seed_variance_tells_the_deterministic_from_the_seeded(tmp_path):
    suite = seeded(tmp_path)
    fixed, ours = seed_variance(suite).blocks[0]
    assert (fixed["maps"], ours["maps"]) == (1, 3)
    assert fixed["angle_difference_mean half"] == 0
    own = suite.measured[suite.measured["label"] == "ParaPoint"]["angle_difference_mean"]
    assert ours["angle_difference_mean mean"] == pytest.approx(own.mean())
    assert ours["angle_difference_mean half"] == pytest.approx(half_width(own.to_numpy()))
    assert ours["done"] == "3/3"


def test_one_seed_or_few_models_give_no_statistics(results):
    suite = contents(results)[0]
    assert seed_variance(suite) is None
    assert paired_tests(suite) is None
    assert ablation(suite) is None


def test_paired_tests_over_five_models(tmp_path):
    made = paired_tests(seeded(tmp_path, cases=("a", "b", "c", "d", "e"), seeds=(0,)))
    (row,) = made.blocks[0]
    assert (row["first"], row["second"], row["models"]) == ("LSCM", "ParaPoint", 5)
    assert row["angle_difference_mean wins"] == "5/5"
    assert row["angle_difference_mean p"] == pytest.approx(2 / 32)
    assert "below 0.062" in made.notes[0]


@pytest.mark.parametrize(
    ("grade", "angles", "areas"), [("broken", 5, 5), ("collapsed", 6, 5), ("flawed", 6, 6)]
)
def test_paired_tests_leave_out_maps_that_may_not_be_ranked(grade, angles, areas):
    values = {"x": {ANGLE: 0.1, AREA: 0.1}, "y": {ANGLE: 0.2, AREA: 0.2}}
    records = {
        (case, name): {**values[name], "grade": "usable"} for case in "abcdef" for name in "xy"
    }
    records["a", "x"]["grade"] = grade
    found = [
        _pair(SimpleNamespace(cases=list("abcdef"), records=records), *LABELS, metric)
        for metric in (ANGLE, AREA)
    ]
    assert [(test.models, test.wins) for test in found] == [(angles, angles), (areas, areas)]


def test_four_models_are_too_few_for_paired_tests():
    values = {ANGLE: 0.1, AREA: 0.1, "grade": "usable"}
    records = {(case, name): values for case in "abcd" for name in "xy"}
    suite = SimpleNamespace(
        cases=list("abcd"), methods=LABELS, records=records, unranked=frozenset()
    )
    assert paired_tests(suite) is None
