"""What a page says of the maps of a model, by rows made by hand."""

from __future__ import annotations

import pytest

from parapoint.surfaces.parameterization import Parameterization
from reports.contents import contents
from reports.page.sections import Section

from ..conftest import HAND, Writer, flat, sheet


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


def test_an_example_tells_its_grade_and_its_flips(section):
    found = {label.method: section._example(HAND, label) for label in section.contents.methods}
    good, bad, none = (found[method] for method in ("slim", "lscm", "arap"))
    assert (good.said, good.mark) == ("usable", "")
    assert bad.said.startswith("broken, ")
    assert bad.said.endswith(" % flipped")
    assert (bad.mark, none.said, none.mark) == ("bad", "timeout", "bad")
