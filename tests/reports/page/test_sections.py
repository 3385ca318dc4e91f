"""What a page says of the maps of a model, by rows made by hand."""

from __future__ import annotations

from pathlib import Path

import pytest

from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import PointCloud
from reports.contents import contents
from reports.page import sections
from reports.page.sections import Section

from ..conftest import DEVIL, HAND, Writer, flat, sheet


@pytest.fixture
def section(tmp_path):
    """A sound map, and a worse one with a fold: a corner inside lies beyond its neighbours."""
    mesh = sheet()
    folded = flat(mesh, 0.5).uv.copy()
    folded[mesh.faces[len(mesh.faces) // 2, 0]] += 0.3
    writer = Writer(tmp_path)
    with writer.store.writing():
        writer.cell(HAND, mesh, "slim", {}, result=flat(mesh))
        writer.cell(HAND, mesh, "lscm", {}, result=Parameterization(folded, mesh.faces))
        writer.cell(HAND, mesh, "arap", {}, status="timeout")
        writer.cell(HAND, mesh, "arap", {}, status="failed", seed=1)
    return Section(tmp_path / "report", contents(tmp_path)[0], (), (), (), tmp_path)


def test_a_card_marks_what_is_best_and_what_should_be_none(section):
    cards = {card.label.method: card for card in section.cards(HAND)}
    good, bad, none = (
        {one.title: one for one in cards[method].numbers} for method in ("slim", "lscm", "arap")
    )
    assert list(none) == ["time [s]"]
    flips = next(title for title in good if "flip" in title.lower())
    assert (good[flips].text, good[flips].mark) == ("0.00 %", "")
    assert bad[flips].mark == "bad"
    assert bad[flips].text.endswith(" %")
    assert float(bad[flips].text.removesuffix(" %")) > 1
    angle = next(title for title in good if "angle" in title.lower())
    assert (good[angle].mark, bad[angle].mark) == ("best", "")
    assert not good[angle].text.endswith("%")
    assert [cards[method].grade for method in ("slim", "lscm", "arap")] == ["usable", "broken", ""]
    assert cards["arap"].row.status == "timeout"  # of the first seed
    assert cards["arap"].detail.endswith(", seed 0 of 2")
    assert "seed" not in cards["slim"].detail


def test_an_example_tells_its_grade_and_its_flips(section):
    found = {label.method: section._example(HAND, label) for label in section.contents.methods}
    good, bad, none = (found[method] for method in ("slim", "lscm", "arap"))
    assert (good.said, good.mark) == ("usable", "")
    assert bad.said.startswith("broken, ")
    assert bad.said.endswith(" % flipped")
    assert (bad.mark, none.said, none.mark) == ("bad", "timeout", "bad")
    assert section.examples == {}  # no picture was drawn here


def of(folder: Path) -> Section:
    """What a page says of the one suite in a folder."""
    return Section(folder / "report", contents(folder)[0], (), (), (), folder)


@pytest.mark.parametrize(
    ("most", "cases"), [(1, [HAND]), (2, ["apart", HAND]), (3, ["alike", "apart", HAND])]
)
def test_of_many_models_the_most_telling_are_examples(tmp_path, monkeypatch, most, cases):
    """Those that most methods map, of these the paper's, of these those that differ in areas."""
    mesh = sheet(3)
    uneven = Parameterization(flat(mesh).uv ** 2, mesh.faces)
    writer = Writer(tmp_path)
    with writer.store.writing():
        for case in (DEVIL, "alike", "apart", HAND):
            writer.cell(case, mesh, "lscm", {}, result=uneven if case == "alike" else flat(mesh))
            if case == DEVIL:
                writer.cell(case, mesh, "slim", {}, status="failed")
            else:
                result = flat(mesh) if case == HAND else uneven
                writer.cell(case, mesh, "slim", {}, result=result)
    monkeypatch.setattr(sections, "SHEETS", most)
    monkeypatch.setattr(Section, "picture", lambda _, name: name)
    assert list(of(tmp_path).examples) == cases


def test_the_methods_that_fail_most_are_named(tmp_path):
    writer = Writer(tmp_path)
    with writer.store.writing():
        for number, method in enumerate(("slim", "arap", "tutte", "lscm"), start=1):
            for case in "abcd"[:number]:
                writer.cell(case, None, method, {}, status="failed")
        for case in "ab":
            writer.cell(case, None, "bff", {}, status="skipped")
    assert of(tmp_path).worst_methods == [
        "LSCM: 4 failed",
        "Tutte: 3 failed",
        "ARAP: 2 failed",
        "2 skipped beforehand",
    ]


def test_a_page_says_what_a_model_is(tmp_path):
    writer = Writer(tmp_path)
    with writer.store.writing():
        for case, surface in (
            ("mesh", sheet()),
            ("cloud", PointCloud(sheet(40).vertices)),
            ("lost", None),
            ("damaged", sheet(4)),
        ):
            row = writer.cell(case, surface, "slim", {}, status="failed")
    writer.store.surface_path(row.surface_hash).write_bytes(b"torn")
    section = of(tmp_path)
    assert [section.about(case) for case in section.contents.cases] == [
        "81 vertices, 128 faces; disk.",
        "A cloud of 1,600 points.",
        "The model could not be had.",
        "The model could not be had.",
    ]


def test_only_the_runs_of_a_suite_are_told(tmp_path):
    writer = Writer(tmp_path)
    with writer.store.writing():
        writer.store.add_run({"commit": "another"})
        writer.store.add_run({"commit": "ours", "gpu": [], "packages": {"numpy": "2", "igl": "3"}})
        writer.cell(HAND, None, "slim", {}, status="failed", run=1)
    assert of(tmp_path).runs == [{"commit": "ours", "gpu": "none", "packages": "numpy 2, igl 3"}]
