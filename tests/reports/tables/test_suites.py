import math

import pytest

from parapoint.surfaces.parameterization import PointParameterization
from parapoint.surfaces.surface import PointCloud
from reports.contents import ANGLE, contents
from reports.tables import suites
from reports.tables.bakes import bakes
from reports.tables.formats import comma_separated
from reports.tables.notes import BUSY, environment_note, load_notes
from reports.tables.suites import comparison, conformality, everything, failures, supplement

from ..conftest import DEVIL, HAND, HOSTILE, NEFERTITI, Writer, flat, sheet


def test_conformality_keeps_published_figures_apart(results):
    made = conformality(contents(results)[0])
    by_case = {row["case"]: row for row in made.blocks[0]}
    assert by_case[HAND]["published SLIM"] == 0.609
    assert by_case[HAND]["published ParaPoint"] == 0.182
    assert by_case[DEVIL]["claim"] == "stand-in"
    assert by_case[NEFERTITI]["SLIM symmetric Dirichlet"] == "skipped"
    groups = {column.group for column in made.columns if column.key.startswith("published")}
    assert groups == {"Published, other files"}
    assert all(not c.better for c in made.columns if c.key.startswith("published"))
    assert by_case[HAND]["SLIM conformal"] < by_case[HAND]["SLIM symmetric Dirichlet"]


def test_the_supplement_names_energy_iterations_cut_and_verdict(results):
    made = supplement(contents(results)[0])
    rows = {(row["case"], row["method"]): row for block in made.blocks for row in block}
    hand = rows[f"{HAND} (likely)", "SLIM (symmetric Dirichlet, 20 iterations)"]
    assert hand["verdict"].startswith("better: lower by ")
    assert hand["done"] == "1/1"
    assert hand["chart_count"] == 1
    devil = rows[f"{DEVIL} (stand-in)", "SLIM (symmetric Dirichlet, 20 iterations)"]
    assert devil["verdict"] == "not comparable: our file is a stand-in"
    assert rows[f"{HAND} (likely)", "SLIM (conformal, 20 iterations)"]["verdict"] == ""
    learned = rows[f"{NEFERTITI} (likely)", "ParaPoint (paper) + automatic cut"]
    assert learned["spanning_fraction"] > 0
    skipped = rows[f"{NEFERTITI} (likely)", "SLIM (symmetric Dirichlet, 20 iterations)"]
    assert skipped["done"] == "skipped"
    assert any("0123456789ab" in note and "Seeds: 0, 3" in note for note in made.notes)


def test_comparison_counts_and_common_means(results):
    suite = contents(results)[0]
    made = comparison(suite, ["angle_difference_mean"])
    rows = {row["method"]: row for row in made.blocks[0]}
    slim, ours = rows["SLIM symmetric Dirichlet"], rows["ParaPoint"]
    assert slim["count"] == "2/2"
    assert slim["skipped"] == 1
    assert ours["count"] == "3/3"
    values = suite.means[suite.means["label"] == "ParaPoint"]["angle_difference_mean"]
    assert ours["mean"] == pytest.approx(values.mean())
    assert ours["worst"] == values.max()
    # All methods that ever succeed do so on the two sheets.
    assert ours["common"] == pytest.approx(values.iloc[:2].mean())
    assert rows[HOSTILE]["mean"] is None
    assert f"2: {HAND}, {DEVIL}" in made.caption
    heads = [column.head for column in made.columns[2:6]]
    assert heads == ["mean", "median", "worst", "common mean"]  # the arrow stands at the metric
    assert made.cells[0][0][0].text == "angle difference, mean [radians] ↓"


@pytest.mark.parametrize(
    ("name", "arrow", "worst", "marks"),
    [
        ("seconds", "↓", 9.0, ["best", "second"]),
        ("packing_efficiency", "↑", 1.0, ["second", "best"]),
    ],
)
def test_comparison_by_hand(tmp_path, name, arrow, worst, marks):
    writer = Writer(tmp_path)
    with writer.store.writing():
        for case in "abc":
            for method in ("lscm", "arap"):
                writer.cell(case, sheet(), method, {}, result=flat(sheet()))
    suite = contents(tmp_path)[0]
    for label, values in (("LSCM", [1.0, 2.0, 9.0]), ("ARAP", [5.0, 5.5, 6.0])):
        suite.means.loc[suite.means["label"] == label, name] = values
    made = comparison(suite, [name])
    (block,) = made.blocks
    rows = {row["label"]: row for row in block}
    assert made.cells[0][0][0].text.endswith(f" {arrow}")
    lscm, arap = rows["LSCM"], rows["ARAP"]
    assert (lscm["mean"], lscm["median"], lscm["worst"]) == (4, 2, worst)
    assert (arap["mean"], arap["median"], arap["common"]) == (5.5, 5.5, 5.5)
    at = [column.key for column in made.columns].index("mean")
    shown = {row["label"]: cells[at].mark for row, cells in zip(block, made.cells[0], strict=True)}
    assert [shown["LSCM"], shown["ARAP"]] == marks


@pytest.mark.parametrize(("count", "shown"), [(0, "(0)"), (12, "m10, m11)"), (13, "(13)")])
def test_few_common_models_are_named(results, monkeypatch, count, shown):
    names = [f"m{number}" for number in range(count)]
    monkeypatch.setattr(suites, "common_cases", lambda *_: names)
    assert shown in comparison(contents(results)[0], [ANGLE]).caption


def test_in_the_table_of_all_cells_only_names_are_words(results):
    made = everything(contents(results)[0])
    assert [column.key for column in made.columns if column.text] == ["case", "method", "status"]


def test_failures_are_told_with_status_and_reason(results):
    made = failures(contents(results)[0])
    told = {row["status"]: row["reason"] for row in made.blocks[0]}
    assert told == {"skipped": f"needs a disk {HOSTILE}", "timeout": "over 10 s"}


def test_a_common_mean_needs_every_common_model_and_a_cloud_has_no_angles(tmp_path):
    writer = Writer(tmp_path)
    with writer.store.writing():
        for case in "abc":
            for method in ("lscm", "arap"):
                writer.cell(case, sheet(), method, {}, result=flat(sheet()))
    suite = contents(tmp_path)[0]
    means = suite.means
    means.loc[means["case"] == "c", "stretch_l2"] = math.nan  # defined on a and b alone
    means.loc[means["case"] != "c", "stretch_l2"] = [1.0, 2.0, 3.0, 5.0]
    made = comparison(suite, ["stretch_l2"])
    assert [row["common"] for row in made.blocks[0]] == [2.0, 3.5]
    assert "Not defined on all models: L2 stretch on 2." in made.notes
    again = contents(tmp_path)[0]
    means = again.means
    means["stretch_l2"] = [1.0, 2.0, 3.0, 4.0, 5.0, math.nan]  # ARAP has none on c
    rows = {row["label"]: row for row in comparison(again, ["stretch_l2"]).blocks[0]}
    assert rows["LSCM"]["common"] == 3
    assert rows["ARAP"]["common"] is None
    assert rows["ARAP"]["mean"] == 3


def test_fractions_are_per_cent_in_the_comparison_and_so_in_its_csv(tmp_path):
    writer = Writer(tmp_path)
    with writer.store.writing():
        for method in ("lscm", "arap"):
            writer.cell("a", sheet(), method, {}, result=flat(sheet()))
    suite = contents(tmp_path)[0]
    suite.means["flipped_fraction"] = [0.0125, 0.5]
    made = comparison(suite, ["flipped_fraction"])
    assert made.cells[0][0][0].text == "flipped faces % ↓"
    assert made.cells[0][0][2].text == "1.25"
    assert comma_separated(made).splitlines()[1].split(",")[2] == "1.25"


def test_only_the_runs_of_a_suite_are_told_and_what_is_not_known_of_them(tmp_path):
    writer = Writer(tmp_path)
    with writer.store.writing():
        writer.store.add_run({"commit": "another", "cpu": "B"})
        writer.store.add_run({"commit": "0123456789abcdef", "cpu": "A"})
        writer.cell("a", None, "lscm", {}, status="failed", run=1)
    assert environment_note(contents(tmp_path)[0]) == (
        "Run on: commit 0123456789ab, A, ? cores, Python ?. Seeds: 0."
    )


def test_bakes_are_told_of_the_methods_that_bake(tmp_path):
    cloud = PointCloud(sheet(4).vertices)
    writer = Writer(tmp_path)
    with writer.store.writing():
        writer.cell("wavy", cloud, "lscm", {}, status="skipped")
        for seed, psnr in enumerate((30.0, 33.0)):
            report = {"bake_psnr": psnr, "bake_cpu_seconds": 1.0 + seed, "charts": 4}
            result = PointParameterization(cloud.points[:, :2])
            writer.cell("wavy", cloud, "textured", {}, seed=seed, result=result, report=report)
    (row,) = bakes(contents(tmp_path)[0]).blocks[0]
    assert (row["label"], row["bake_psnr"], row["bake_cpu_seconds"]) == ("Textured", 31.5, 1.5)


def test_a_busy_machine_is_told_beside_the_times(tmp_path):
    writer = Writer(tmp_path)
    with writer.store.writing():
        for case, load in (("a", 0.9), ("b", 3.24), ("c", None), ("d", BUSY)):
            writer.cell(case, sheet(), "lscm", {}, result=flat(sheet()), load=load, cpu_seconds=0.2)
    suite = contents(tmp_path)[0]
    (note,) = load_notes(suite)
    assert note.startswith("The machine was busy during 1 of 4 cells (up to 3.2 processes")
    assert all(note in made.notes for made in (supplement(suite), comparison(suite)))
    times = {
        row["name"]: row["mean"] for row in comparison(suite, ["seconds", "cpu_seconds"]).blocks[1]
    }
    assert times == pytest.approx({"cpu_seconds": 0.2})


def test_a_machine_with_nothing_else_to_do_needs_no_note(results):
    assert load_notes(contents(results)[0]) == []
