"""The static site and the page of Markdown, from results folders and an archive."""

from __future__ import annotations

import re
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import pytest

from benchmarks.cases.builtin import BUILTIN
from benchmarks.store import publishing
from parapoint import console
from parapoint.errors import InputError
from parapoint.surfaces.parameterization import Parameterization
from reports import __main__ as commands
from reports.site import building, markdown

from ..conftest import HOSTILE, Writer, draw_small, flat, sheet


def results(folder: Path, shear: float, *cases: str) -> Path:
    """A folder with two methods; the map of one depends on `shear`."""
    writer = Writer(folder)
    with writer.store.writing():
        writer.store.add_run({"commit": "0123456789abcdef", "cpu": "X", "cores": 2})
        for case in cases:
            writer.cell(
                case, sheet(), "slim", {"x": HOSTILE}, result=flat(sheet(), shear), load=0.5
            )
            writer.cell(case, sheet(), "lscm", {}, result=flat(sheet()), load=1.5)
    return folder


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    place = tmp_path_factory.mktemp("site")
    old = results(place / "old", 0.5, "a", "b")
    new = results(place / "new", 0.1, "b", HOSTILE)
    with pytest.MonkeyPatch.context() as patch:
        draw_small(patch)
        found = building.build([old, new], place / "out", jobs=1)
    return place, found


def test_a_method_page_lists_the_models_after_one_that_lacks_it(tmp_path, monkeypatch):
    writer = Writer(tmp_path / "run")
    with writer.store.writing():
        writer.cell("a", sheet(), "slim", {}, result=flat(sheet()))
        writer.cell("b", sheet(), "slim", {}, status="timeout")
        folded = np.abs(flat(sheet()).uv - [0.3, 0])
        writer.cell("b", sheet(), "lscm", {}, result=Parameterization(folded, sheet().faces))
    draw_small(monkeypatch)
    building.build([tmp_path / "run"], tmp_path / "out", jobs=1)
    (page,) = (tmp_path / "out" / "methods").glob("lscm*.html")
    models = {Path(one).stem for one in addresses(page) if "models/" in one}
    assert any(name.startswith("b") for name in models)
    assert '<td class="text bad">broken</td>' in page.read_text(encoding="utf-8")
    (page,) = (tmp_path / "out" / "methods").glob("slim*.html")
    text = page.read_text(encoding="utf-8")
    assert '<td class="text ">usable</td>' in text
    assert '<td class="text bad">timeout</td>' in text


def addresses(page: Path) -> set[str]:
    text = page.read_text(encoding="utf-8")
    found = re.findall(r'(?:href|src|srcset|data-map)="([^"#]+)', text)
    return {unquote(one) for one in found if "://" not in one}


def test_every_link_of_the_site_leads_to_a_file(built):
    place, found = built
    pages = [*(place / "out").rglob("*.html")]
    kinds = [page.relative_to(place / "out").parts[0] for page in pages]
    counts = {kind: kinds.count(kind) for kind in ("index.html", "models", "methods")}
    assert counts == {"index.html": 1, "models": 3, "methods": 2}
    for page in pages:
        for address in addresses(page):
            assert (page.parent / address).is_file(), (page, address)
        assert HOSTILE not in page.read_text(encoding="utf-8")
    assert found.index == place / "out" / "index.html"
    assert found.cells == 6
    files = [path for path in (place / "out").rglob("*") if path.is_file()]
    assert found.size == sum(path.stat().st_size for path in files)
    assert not [path for path in files if path.suffix == ".pdf" or ".angle." in path.name]


def test_the_newest_cell_is_shown_and_the_history_says_what_moved(built):
    place, _ = built
    text = (place / "out" / "history" / "index.html").read_text(encoding="utf-8")
    assert "Of 2 cells in both, 1 moved beyond noise" in text
    assert "old to new: What moved, metric by metric" in text
    assert "Before: old. After: new." in text
    table = (place / "out" / "history" / "1-metrics.csv").read_text()
    assert re.search(r'^"angle difference, mean",1.0,0.0,SLIM on b', table, re.MULTILINE)
    cells = (place / "out" / "tables" / "paper" / "cells.csv").read_text()
    assert len(cells.splitlines()) == 7


def test_each_folder_is_compared_with_the_last_one_that_shares_a_cell(tmp_path):
    folders = []
    for name, cases in (("old", "ab"), ("new", "bc"), ("third", "a"), ("last", "b")):
        writer = Writer(tmp_path / name)
        with writer.store.writing():
            for case in cases:
                writer.cell(case, None, "slim", {}, status="failed")
        folders.append(tmp_path / name)
    assert building._history(folders, folders, tmp_path) == ["history/index.html"]
    text = (tmp_path / "history" / "index.html").read_text(encoding="utf-8")
    pairs = dict.fromkeys(re.findall(r"(\w+ to \w+): ", text))
    assert list(pairs) == ["old to new", "old to third", "new to last"]


def test_a_method_s_page_has_its_maps_with_lazy_pictures(built):
    place, _ = built
    (page,) = (place / "out" / "methods").glob("slim*.html")
    text = page.read_text(encoding="utf-8")
    assert text.count('loading="lazy"') == 3
    assert "<h1>SLIM</h1>" in text
    assert "Needs: " in text
    assert 'href="../models/paper/b.html"' in text


def test_building_again_changes_no_byte(built, monkeypatch):
    place, _ = built
    before = {path: path.read_bytes() for path in (place / "out").rglob("*") if path.is_file()}
    monkeypatch.setattr(building.pictures, "done_by_several", lambda _, work, __: iter(work * 0))
    building.build([place / "old", place / "new"], place / "out", jobs=1)
    assert before == {
        path: path.read_bytes() for path in (place / "out").rglob("*") if path.is_file()
    }


def test_an_archive_is_a_source_and_one_folder_has_no_history(tmp_path):
    """The models of an archive are loaded by name, and its own are the built-in ones."""
    mesh = BUILTIN["saddle"]()
    writer = Writer(tmp_path / "one")
    with writer.store.writing():
        for method in ("slim", "lscm"):
            writer.cell("saddle", mesh, method, {}, result=flat(mesh))
    publishing.publish(tmp_path / "one", tmp_path / "one.zip")
    found = building.build([tmp_path / "one.zip"], tmp_path / "out", jobs=1)
    assert found.cells == 2
    assert not (tmp_path / "out" / "history").exists()


def test_a_site_of_nothing_or_in_the_way_or_too_large_is_refused(built, tmp_path):
    place, found = built
    with pytest.raises(InputError, match="no such archive"):
        building.build([tmp_path / "none"], tmp_path / "out", jobs=1)
    assert not (tmp_path / "out").exists()
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "file").touch()
    with pytest.raises(InputError, match="in the way"):
        building.build([place / "old"], tmp_path / "mine", jobs=1)
    building.check_size(found)
    building.check_size(building.Built(found.index, 100_000_000, 1))
    large = building.Built(found.index, 100_000_001, 1)
    with pytest.raises(InputError, match="has 100 MB, more than 100"):
        building.check_size(large)


@pytest.mark.parametrize(("few", "told"), [(1, False), (2, True), (5, True)])
def test_many_methods_leave_out_the_tables_with_a_value_for_each_map(
    built, few, told, tmp_path, monkeypatch
):
    monkeypatch.setattr(markdown, "FEW", few)
    place, _ = built
    text = markdown.write([place / "old"], tmp_path / "RESULTS.md").read_text(encoding="utf-8")
    assert "### Methods side by side" in text
    assert ("### Conformality" in text) == told


def test_the_page_of_markdown_keeps_the_sections_of_other_suites(built, tmp_path):
    place, _ = built
    page = markdown.write([place / "old"], tmp_path / "RESULTS.md")
    alone = page.read_text(encoding="utf-8")
    (head,) = markdown.SECTION.findall(alone)
    before, others = (
        "## First (`first`)\n\n1.\n",
        "## Last, at (2) (`last`)\n\n### 2\n\n## no suite\n",
    )
    beginning, own = alone[: alone.index("## ")], alone[alone.index("## ") :]
    page.write_text(
        f"{beginning}{before}\n## Stale (`{head}`)\n\nold\n\n{others}", encoding="utf-8"
    )
    markdown.write([place / "old"], page)
    assert page.read_text(encoding="utf-8") == f"{beginning}{before}\n{own}\n{others}"


def test_the_page_of_markdown_names_command_commit_machine_and_load(built, tmp_path):
    place, _ = built
    page = markdown.write([place / "old"], tmp_path / "RESULTS.md")
    text = page.read_text(encoding="utf-8")
    assert "python -m reports markdown DIR" in text
    assert "2 methods on 2 models: 4 cells, 4 maps. Load while cells ran: 0.5 to 1.5." in text
    assert "commit 0123456789ab, X, 2 cores" in text
    assert "### Overall: share of pairs won" in text
    assert "The machine was busy during 2 of 4 cells" in text
    assert markdown.write([place / "old"], page).read_text(encoding="utf-8") == text
    page.write_text("mine")
    with pytest.raises(InputError, match="not ours"):
        markdown.write([place / "old"], page)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--help"], ["site", "markdown", "report"]),
        (["site", "--help"], ["--out", "oldest first"]),
        (["none"], ["none: no such folder"]),
        (["site"], ["Missing argument"]),
    ],
)
def test_a_folder_needs_no_command_and_the_others_are_listed(arguments, words, capsys):
    with pytest.raises(SystemExit):
        console.run(commands.main, arguments)
    shown = capsys.readouterr()
    for word in words:
        assert word in shown.out + shown.err
