import math

import pytest

from reports.contents import ANGLE, AREA, contents
from reports.tables.kinds import means_by_kind, success

from ..conftest import DEVIL, HAND, NEFERTITI, Writer, flat, seeded, sheet


def test_success_counts_skips_and_compares_on_common_models(results):
    suite = contents(results)[0]
    made = success(suite)
    rows = {row["label"]: row for row in made.blocks[0]}
    assert rows["SLIM symmetric Dirichlet"]["disk ok"] == "2/2"
    assert rows["SLIM symmetric Dirichlet"]["closed, genus 0 ok"] == "0/1"
    assert rows["ParaPoint"]["closed, genus 0 ok"] == "1/1"
    assert rows["ParaPoint"]["all ok"] == "3/3"
    assert rows["ParaPoint"]["disk bijective"] == "2/2"
    assert rows["ParaPoint"]["closed, genus 0 bijective"] == "0/1"  # it spans its seam
    values = suite.means.set_index(["label", "case"])["angle_difference_mean"]["ParaPoint"]
    disks, closed = ({row["label"]: row for row in block} for block in means_by_kind(suite).blocks)
    common = disks["ParaPoint"]["angle_difference_mean"]
    assert common == pytest.approx(values[[HAND, DEVIL]].mean())
    assert disks["ParaPoint"]["kind"] == "disk: means over 2 of 2"
    assert closed["ParaPoint"]["angle_difference_mean"] == pytest.approx(values[NEFERTITI])
    assert closed["SLIM symmetric Dirichlet"].get("angle_difference_mean") is None


def test_a_value_that_is_missing_on_a_common_model_leaves_no_mean(tmp_path):
    suite = seeded(tmp_path, cases=("a", "b"), seeds=(0,))
    records = suite.records
    records["b", "LSCM"]["seconds"] = math.nan
    rows = {row["label"]: row for row in means_by_kind(suite).blocks[0]}
    assert (
        rows["LSCM"]["seconds"] is None
    )  # the mean over one model would stand beside one over two
    assert rows["ParaPoint"]["seconds"] == 0.25


def test_success_counts_usable_maps_alone_and_one_to_one_needs_every_seed(tmp_path):
    writer = Writer(tmp_path)
    with writer.store.writing():
        for case in "abcd":
            for seed in (0, 1):
                writer.cell(case, sheet(), "lscm", {}, seed=seed, result=flat(sheet()))
    suite = contents(tmp_path)[0]
    means = suite.means
    means["grade"] = ["usable", "flawed", "collapsed", "broken"]
    means["bijective"] = [1.0, 0.5, 1.0, 0.0]  # of the second, one seed of two is one to one
    (row,) = success(suite).blocks[0]
    (name,) = {key.removesuffix(" usable") for key in row if key.endswith(" usable")}
    assert row[f"{name} usable"] == "1/4"
    assert row[f"{name} bijective"] == "2/4"
    assert row[f"{name} ok"] == "4/4"


def test_means_over_broken_maps_are_never_best(tmp_path):
    suite = seeded(tmp_path, cases=("a", "b"), seeds=(0,))
    for grade, area_marks, angle_marks in (
        ("usable", True, True),
        ("collapsed", False, True),
        ("broken", False, False),
    ):
        for record in suite.records.values():
            record["grade"] = "usable"
            record[ANGLE], record[AREA] = 2.0, 1.0
        for case in ("a", "b"):
            suite.records[case, "LSCM"] |= {"grade": grade, ANGLE: 0.1, AREA: 0.1}
        table = means_by_kind(suite)
        (block,) = table.cells
        keys = [column.key for column in table.columns]
        row = next(row for row in block if row[keys.index("method")].text == "LSCM")
        assert (row[keys.index(AREA)].mark == "best") == area_marks
        assert (row[keys.index(ANGLE)].mark == "best") == angle_marks
