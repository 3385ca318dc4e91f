import dataclasses
import math

import numpy as np
import pytest

from parapoint.errors import InputError
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import Mesh
from reports.contents import contents, suite_title
from reports.labels import _told, labels
from reports.tables.notes import version_notes

from .conftest import HAND, Writer, flat, sheet


def rows(tmp_path, *methods):
    writer = Writer(tmp_path)
    with writer.store.writing():
        for method, params, given in methods:
            writer.cell(HAND, sheet(), method, params, result=flat(sheet()), **given)
    return writer.store.rows()


def test_labels_name_energy_iterations_and_only_what_differs(tmp_path):
    one = {"energy": "symmetric_dirichlet", "iterations": 1}
    found = labels(
        rows(
            tmp_path,
            ("parapoint", {"preset": "paper", "points": None, "lr": 0.1}, {}),
            ("parapoint", {"preset": "paper", "points": None, "lr": 0.2}, {}),
            ("slim", {**one, "iterations": 20}, {}),
            ("slim", one, {}),
            ("slim", {"energy": "conformal", "iterations": 20}, {}),
            ("mine", {}, {}),
            ("lscm", {}, {}),
        )
    )
    assert [label.short for label in found.values()] == [
        "LSCM",
        "SLIM symmetric Dirichlet 20 iterations",
        "SLIM symmetric Dirichlet 1 iteration",
        "SLIM conformal",
        "mine",
        "ParaPoint lr 0.1",
        "ParaPoint lr 0.2",
    ]
    assert [label.text for label in found.values()][1] == (
        "SLIM (symmetric Dirichlet, 20 iterations)"
    )
    assert [label.text for label in found.values()][-1] == "ParaPoint (paper, lr 0.2)"


def test_variants_are_told_by_their_change_and_the_default_by_its_report(tmp_path):
    report = {"distortion": "conformal", "branches": "both"}
    base = {"preset": "paper", "distortion": None, "branches": None}
    found = labels(
        rows(
            tmp_path,
            ("parapoint", base, {"report": report}),
            ("parapoint", base | {"distortion": "isometric"}, {}),
            ("parapoint", base | {"branches": "2d"}, {"report": report | {"branches": "2d"}}),
        )
    )
    assert [label.short for label in found.values()] == [
        "ParaPoint",
        "ParaPoint isometric",
        "ParaPoint 2D→3D→2D alone",
    ]
    assert [label.detail for label in found.values()] == [
        "paper, conformal, both branches",
        "paper, isometric",
        "paper, conformal, 2D→3D→2D alone",
    ]


def test_a_variant_with_a_name_of_its_own_leaves_the_bare_name_to_the_default(tmp_path):
    found = labels(
        rows(
            tmp_path,
            ("unwrap", {"price": 1.0}, {}),
            ("unwrap", {"price": None}, {}),
            ("parapoint", {"preset": "paper"}, {}),
            ("parapoint", {"preset": "learned"}, {}),
        )
    )
    assert [label.short for label in found.values()] == [
        "Unwrap",
        "Unwrap along the computed seam",
        "ParaPoint",
        "ParaPoint, our training",
    ]


def test_names_that_are_taken_are_numbered(tmp_path):
    found = labels(
        rows(
            tmp_path,
            ("lscm", {}, {}),
            ("submitted", {"name": "LSCM"}, {}),
            ("submitted", {"name": "LSCM", "options": None}, {}),
        )
    )
    assert [label.short for label in found.values()] == ["LSCM", "LSCM #2", "LSCM #3"]


def test_the_grade_of_a_mean_is_the_worst_of_its_seeds(tmp_path):
    mesh = sheet()
    writer = Writer(tmp_path)
    with writer.store.writing():
        for seed, scale in enumerate(([1, 1], [-1, 1], [1, 0])):
            uv = flat(mesh).uv * scale
            writer.cell(HAND, mesh, "slim", {}, result=Parameterization(uv, mesh.faces), seed=seed)
        writer.cell(HAND, mesh, "lscm", {}, result=flat(mesh))
        writer.cell(HAND, mesh, "arap", {}, status="timeout")
    grades = contents(tmp_path)[0].means.set_index("label")["grade"]
    assert (grades["SLIM"], grades["LSCM"], grades["ARAP"]) == ("broken", "usable", "")


def test_a_label_says_what_the_reports_say(tmp_path):
    params = {"preset": "paper", "iterations": None}
    found = labels(
        rows(
            tmp_path,
            ("parapoint", params, {"report": {"iterations": 400}}),
            ("parapoint", params, {"report": {"iterations": 1200}, "seed": 1}),
        )
    )
    assert [label.detail for label in found.values()] == ["paper, 400 to 1,200 iterations"]


def test_means_are_over_the_seeds_that_ended_well(tmp_path):
    rows(
        tmp_path,
        ("slim", {}, {"seed": 0, "seconds": 1.0}),
        ("slim", {}, {"seed": 1, "seconds": 3.0}),
        ("slim", {}, {"seed": 2, "seconds": 9.0, "status": "failed", "reason": "it broke"}),
    )
    record = contents(tmp_path)[0].means.iloc[0]
    assert (record["ok"], record["tried"], record["skipped"]) == (2, 3, 0)
    assert record["seconds"] == 2.0
    assert record["reason"] == "it broke"


def test_of_several_ends_without_a_map_the_first_is_told(tmp_path):
    writer = Writer(tmp_path)
    with writer.store.writing():
        for seed, status in enumerate(("timeout", "failed", "out_of_memory")):
            writer.cell(HAND, None, "slim", {}, seed=seed, status=status, reason=f"no {seed}")
    record = contents(tmp_path)[0].means.iloc[0]
    assert (record["ok"], record["status"], record["reason"]) == (0, "timeout", "no 0")


def test_atlases_are_known_by_their_charts(tmp_path):
    mesh = sheet()
    apart = flat(mesh)
    pieces = type(apart)(apart.uv[apart.corners].reshape(-1, 2), range_corners(len(mesh.faces)))
    writer = Writer(tmp_path)
    with writer.store.writing():
        writer.cell(HAND, mesh, "lscm", {}, result=flat(mesh))
        writer.cell(HAND, mesh, "xatlas", {}, result=pieces)
    assert contents(tmp_path)[0].atlases == {"xatlas"}


@pytest.mark.parametrize(
    ("many", "of", "atlases"), [(1, 3, set()), (1, 2, set()), (2, 3, {"xatlas"})]
)
def test_an_atlas_cuts_most_models_and_not_just_one(tmp_path, many, of, atlases):
    mesh = sheet()
    whole = flat(mesh)
    pieces = type(whole)(whole.uv[whole.corners].reshape(-1, 2), range_corners(len(mesh.faces)))
    writer = Writer(tmp_path)
    with writer.store.writing():
        for number, case in enumerate("abc"[:of]):
            writer.cell(case, mesh, "lscm", {}, result=whole)
            writer.cell(case, mesh, "xatlas", {}, result=pieces if number < many else whole)
    assert contents(tmp_path)[0].atlases == atlases


def range_corners(count):
    return [[3 * k, 3 * k + 1, 3 * k + 2] for k in range(count)]


def test_missing_and_empty_folders_are_said_in_one_line(tmp_path):
    with pytest.raises(InputError, match=r"no such folder; `python -m benchmarks run` makes one"):
        contents(tmp_path / "nowhere")
    with pytest.raises(InputError, match="holds no results"):
        contents(tmp_path)


@pytest.mark.parametrize(
    ("name", "values", "text"),
    [
        ("iterations", [20], "20 iterations"),
        ("iterations", [1], "1 iteration"),
        ("points", [2517, 10_000], "2,517 to 10,000 points"),
        ("time_budget", [150.0], "150.0 s budget"),
        ("unwrap_weight", [0.0], "unwrap weight 0"),
        ("distortion_weight", [1e-4], "distortion weight 0.0001"),
        ("price", [0.5, 1.0], "price 0.5 to 1"),
        ("subset", [1024], "subset 1,024"),
    ],
)
def test_a_number_in_a_label_says_what_it_is_of(tmp_path, name, values, text):
    cells = [("parapoint", {"preset": "paper"} | {name: value}, {}) for value in values]
    made = rows(tmp_path, *cells)
    assert _told(made, name) == text


def test_titles_of_suites():
    assert suite_title("paper").startswith("The supplement's comparison")
    assert suite_title("my own") == "my own"


def test_a_submission_is_called_as_its_author_calls_it(tmp_path):
    writer = Writer(tmp_path)
    with writer.store.writing():
        for name in ("My tool", "My tool 2", "<b>"):
            writer.cell("a", sheet(), "submitted", {"name": name}, result=flat(sheet()))
    (suite,) = contents(tmp_path)
    assert [(one.name, one.detail, one.short) for one in suite.methods] == [
        (name, "submitted maps", name) for name in ("My tool", "My tool 2", "<b>")
    ]


def test_mixed_versions_of_a_suite_are_said(tmp_path):
    writer = Writer(tmp_path)
    with writer.store.writing():
        for number, case in enumerate(("a", "b")):
            writer.store.add_run({"suite_version": number, "suite_hash": f"hash{number}"})
            writer.cell(case, sheet(), "slim", {}, result=flat(sheet()), run=number)
    (suite,) = contents(tmp_path)
    (note,) = version_notes(suite)
    assert "1 of version 0 (hash0), 1 of version 1 (hash1)" in note
    assert not version_notes(dataclasses.replace(suite, rows=suite.rows[:1]))


@pytest.mark.parametrize(("left_out", "partial"), [(0.03, set()), (0.5, {"DA-Wand"})])
def test_maps_of_a_part_are_no_rivals_of_maps_of_the_whole(tmp_path, left_out, partial):
    mesh = sheet()
    whole = flat(mesh)
    uv, corners = whole.uv[whole.corners].reshape(-1, 2), range_corners(len(mesh.faces))
    uv[: 3 * math.ceil(left_out * len(mesh.faces))] = math.nan
    writer = Writer(tmp_path)
    with writer.store.writing():
        writer.cell(HAND, mesh, "lscm", {}, result=whole)
        writer.cell(HAND, mesh, "da_wand", {}, result=type(whole)(uv, corners))
    suite = contents(tmp_path)[0]
    assert suite.partial == partial
    assert suite.unranked >= partial


@pytest.mark.parametrize(
    ("covered", "partial"), [([0.5, 1.0], set()), ([0.5, 0.5, 1.0], {"DA-Wand"})]
)
def test_a_method_of_parts_leaves_out_some_of_most_models(tmp_path, covered, partial):
    writer = Writer(tmp_path)
    with writer.store.writing():
        for number in range(len(covered)):
            writer.cell(f"model {number}", sheet(3), "da_wand", {}, result=flat(sheet(3)))
    suite = contents(tmp_path)[0]
    suite.means["coverage"] = covered
    assert suite.partial == partial


def test_names_do_not_repeat_what_tells_them_apart_already(tmp_path):
    few = {"points": 4096, "subset": 256, "charts": 1}
    found = labels(
        rows(
            tmp_path,
            ("parapoint", {"preset": "paper", "time_budget": 60}, {}),
            ("parapoint", {"preset": "learned", "time_budget": 60}, {}),
            ("nuvo", few, {}),
            ("nuvo", {"points": None, "subset": None, "charts": 4}, {}),
        )
    )
    assert {label.short for label in found.values()} == {
        "ParaPoint",
        "ParaPoint, our training",
        "Nuvo 1 chart",
        "Nuvo 4 charts",
    }


@pytest.mark.parametrize(("charts", "atlases"), [(5.0, set()), (15.0, set()), (16.0, {"LSCM"})])
def test_a_chart_for_each_component_is_not_many(charts, atlases, tmp_path):
    one = sheet()
    count = len(one.vertices)
    apart = np.concatenate([one.vertices + np.array([9.0 * n, 0, 0]) for n in range(5)])
    mesh = Mesh(apart, np.concatenate([one.faces + count * n for n in range(5)]))
    writer = Writer(tmp_path)
    with writer.store.writing():
        for method in "lscm", "parapoint":
            writer.cell(HAND, mesh, method, {}, result=flat(mesh))
    suite = contents(tmp_path)[0]
    suite.means["chart_count"] = [charts, 1.0]  # a map of points may join what is apart
    assert suite.atlases == atlases
