import math

import numpy as np
import pytest

from parapoint.surfaces.parameterization import Parameterization
from reports.contents import contents
from reports.tables.studies import (
    ablation,
    cuts,
    half_width,
    holm,
    means_by_kind,
    pair,
    paired_tests,
    seed_variance,
    success,
)

from ..conftest import DEVIL, HAND, NEFERTITI, Writer, ball, flat, lonlat, sheet


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


def test_cuts_say_who_cut_and_whether_the_map_is_one(results):
    made = cuts(contents(results)[0])
    rows = {(row["case"], row["label"]): row for block in made.blocks for row in block}
    whole = rows[HAND, "SLIM conformal"]
    assert (whole["cut"], whole["bijective"], whole["seam_length"]) == ("none", "yes", 0)
    torn = rows[NEFERTITI, "ParaPoint"]
    assert (torn["cut"], torn["seam_length"]) == ("learned", None)  # no length, and not 0
    assert torn["spanning_fraction"] > 0
    assert torn["bijective"] == "no"  # spanning faces lie over the others
    assert rows[NEFERTITI, "SLIM symmetric Dirichlet"]["done"] == "skipped"


def seeded(folder, cases=(HAND,), seeds=(0, 1, 2)):
    """LSCM, the same for all seeds, and ParaPoint, whose map is worse by seed and by model."""
    writer = Writer(folder)
    mesh = sheet()
    with writer.store.writing():
        for number, case in enumerate(cases):
            for seed in seeds:
                bend = 0.1 + 0.1 * seed + 0.05 * number
                writer.cell(case, mesh, "lscm", {}, seed=seed, result=flat(mesh))
                writer.cell(case, mesh, "parapoint", {}, seed=seed, result=flat(mesh, bend))
    return contents(folder)[0]


def test_seed_variance_tells_the_deterministic_from_the_seeded(tmp_path):
    suite = seeded(tmp_path)
    fixed, ours = seed_variance(suite).blocks[0]
    assert (fixed["maps"], ours["maps"]) == (1, 3)
    assert fixed["angle_difference_mean half"] == 0
    own = suite.measured[suite.measured["label"] == "ParaPoint"]["angle_difference_mean"]
    assert ours["angle_difference_mean mean"] == pytest.approx(own.mean())
    assert ours["angle_difference_mean half"] == pytest.approx(half_width(own.to_numpy()))
    assert ours["done"] == "3/3"


def test_a_value_that_is_missing_on_a_common_model_leaves_no_mean(tmp_path):
    suite = seeded(tmp_path, cases=("a", "b"), seeds=(0,))
    records = suite.records
    records["b", "LSCM"]["seconds"] = math.nan
    rows = {row["label"]: row for row in means_by_kind(suite).blocks[0]}
    assert "seconds" not in rows["LSCM"]  # the mean over one model would stand beside one over two
    assert rows["ParaPoint"]["seconds"] == 0.25


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


def test_an_ablation_has_variants_of_one_method(tmp_path):
    writer = Writer(tmp_path)
    mesh = sheet()
    with writer.store.writing():
        for distortion in ("conformal", "isometric"):
            params = {"preset": "paper", "distortion": distortion, "points": 64}
            bend = 0.1 if distortion == "conformal" else 0.5
            writer.cell(HAND, mesh, "parapoint", params, result=flat(mesh, bend))
    made = ablation(contents(tmp_path)[0])
    one, two = made.blocks[0]
    assert one["angle_difference_mean"] < two["angle_difference_mean"]
    assert [cell.mark for cell in made.cells[0][0]][2] == "best"
    assert "ParaPoint isometric: paper, 64 points, isometric" in made.notes[0]


def test_an_automatic_cut_is_said_and_measured(tmp_path):
    """A ball cut along the date line, its corners there apart."""
    mesh = ball()
    uv = lonlat(mesh).uv[mesh.faces]
    low = uv[..., 0] < 0
    across = np.ptp(uv[..., 0], axis=1) > np.pi
    uv[across[:, None] & low] += [2 * np.pi, 0]
    rows, corners = np.unique(uv.reshape(-1, 2), axis=0, return_inverse=True)
    result = Parameterization(rows, corners.reshape(-1, 3))
    writer = Writer(tmp_path)
    with writer.store.writing():
        writer.cell(
            NEFERTITI, mesh, "lscm", {}, result=result, preprocessing="automatic cut to a disk"
        )
    (row,) = cuts(contents(tmp_path)[0]).blocks[0]
    assert row["cut"] == "automatic"
    # From pole to pole at least, over the root of the sphere's area.
    assert row["seam_length"] > np.pi / np.sqrt(4 * np.pi) * 0.9
