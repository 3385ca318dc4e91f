import html.parser
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from matplotlib import colormaps
from matplotlib.colors import to_hex

from benchmarks.rendering.maps import ANGLE_SCALE, AREA_SCALE
from benchmarks.running.scratch import MARK
from parapoint import console
from parapoint.errors import InputError
from parapoint.surfaces.parameterization import Parameterization, PointParameterization
from parapoint.surfaces.surface import PointCloud
from reports.__main__ import main
from reports.contents import contents
from reports.page.sections import Section
from reports.report import claim, write

from .conftest import HAND, SLIM, Writer, flat, sheet

VOID = {"meta", "img", "br", "link", "input", "hr", "source"}


class Page(html.parser.HTMLParser):
    """Tags that match, addresses, and the text of a page."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.addresses: list[str] = []
        self.ids: list[str] = []
        self.text = ""

    def handle_starttag(self, tag, attrs):
        if tag not in VOID:
            self.open.append(tag)
        for name, value in attrs:
            if name in {"src", "href", "srcset"}:
                self.addresses.append(value)
            if name == "id":
                self.ids.append(value)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data


def parsed(path: Path) -> Page:
    page = Page()
    page.feed(path.read_text(encoding="utf-8"))
    assert page.open == []
    return page


def is_whole(path: Path) -> Page:
    """The page `path`, which must point to nothing that is not there, and escape."""
    page = parsed(path)
    assert "<script>alert" not in path.read_text(encoding="utf-8")
    assert "<script>alert" in page.text
    for address in page.addresses:
        assert not re.match(r"(https?:)?//", address)
        file, _, part = address.partition("#")
        target = path.parent / file if file else path
        assert target.is_file(), address
        assert not part or part in parsed(target).ids
    assert len(page.ids) == len(set(page.ids))
    return page


def test_the_page_is_whole_opens_from_disk_and_escapes(reported):
    index = reported / "report" / "index.html"
    page = is_whole(index)
    source = index.read_text(encoding="utf-8")
    assert "over 10 s" in page.text
    assert "better: lower by" in page.text
    assert "python -m benchmarks run paper" in page.text
    # The tables come before any figure.
    assert source.index("<table") < source.index("<figure")


def test_a_model_s_page_has_every_method_on_it(reported):
    report = reported / "report"
    names = [path.name for path in (report / "models" / "paper").iterdir()]
    assert len(names) == 3
    page = is_whole(next((report / "models" / "paper").glob("nefertiti*")))
    assert "needs a disk" in page.text
    assert "automatic cut to a disk" in page.text
    assert "over 10 s" in page.text
    assert "162 vertices, 320 faces" in page.text


def test_an_unchanged_report_is_the_same_to_the_byte(reported):
    files = [path for path in (reported / "report").rglob("*") if path.is_file()]
    before = {path: path.read_bytes() for path in files}
    write(reported, jobs=1)
    assert {path: path.read_bytes() for path in files} == before


def test_every_table_is_there_in_four_formats(reported):
    folder = reported / "report" / "tables" / "paper"
    names = {"conformality", "supplement", "comparison", "published", "failures", "cells"}
    names |= {"methods", "success", "kinds", "cuts", "overall"}
    assert {path.stem for path in folder.iterdir()} == names
    kinds = (".tex", ".md", ".csv", ".html")
    assert all((folder / f"{name}{kind}").exists() for name in names for kind in kinds)


def test_a_report_takes_no_place_that_is_not_its_own(tmp_path):
    """What is not there, an empty folder and one of ours are taken; all else stays as it is."""
    (tmp_path / "empty").mkdir()
    for free in ("deep/er", "empty", "deep/er"):
        claim(tmp_path / free)
        assert [path.name for path in (tmp_path / free).iterdir()] == [MARK]
    (tmp_path / "file").write_text("mine")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "file").touch()
    (tmp_path / "link").symlink_to(tmp_path / "empty")
    (tmp_path / "nowhere").symlink_to(tmp_path / "gone")
    for taken in ("file", "full", "link", "nowhere"):
        with pytest.raises(InputError, match="is in the way and not known to be ours"):
            claim(tmp_path / taken)
    assert (tmp_path / "file").read_text() == "mine"
    assert not (tmp_path / "gone").exists()


def test_the_colours_of_a_scale_run_over_the_whole_map(reported):
    (page,) = (reported / "report" / "models").rglob("mannequin*.html")
    facts = json.loads(re.search(r'id="facts">(.*?)</script>', page.read_text("utf-8"))[1])
    for name, scale in (("angle", ANGLE_SCALE), ("area", AREA_SCALE)):
        colours, low, high = scale
        expected = [to_hex(colormaps[colours](place)) for place in (0.0, 0.25, 0.5, 1.0)]
        assert [facts["scales"][name][at] for at in (0, 8, 16, -1)] == expected
        assert facts["limits"][name] == [low, high]


def test_failed_cells_only_give_a_report_that_says_so(tmp_path):
    writer = Writer(tmp_path)
    with writer.store.writing():
        writer.cell(HAND, sheet(), "lscm", {}, status="failed", reason="it broke", output="Boom")
        writer.cell("gone", None, "lscm", {}, status="skipped", reason="not at hand")
    index = write(tmp_path, jobs=1)
    page = parsed(index)
    assert "No cell of The supplement's comparison" in page.text
    assert "it broke" in page.text
    assert "not at hand" in page.text
    broken = parsed(index.parent / next(a for a in page.addresses if "hand" in a))
    assert "it broke" in broken.text
    assert "Boom" in broken.text
    assert "no map of this model can be drawn" in broken.text
    assert "not at hand" in parsed(index.parent / "models/paper/gone.html").text


def test_a_half_written_folder_is_reported_without_what_is_lost(results, tmp_path):
    folder = tmp_path / "half"
    shutil.copytree(results, folder)
    runs = folder / "runs.jsonl"
    content = runs.read_bytes()
    runs.write_bytes(content[: len(content) - 40])
    (folder / "environment.json").unlink()
    shutil.rmtree(folder / "uv")
    shutil.rmtree(folder / "surfaces")
    assert len(contents(folder)[0].rows) == content.count(b"\n") - 1
    page = parsed(write(folder, jobs=1))
    assert "environment not recorded" in page.text
    assert "no pictures" in page.text


def test_maps_that_do_not_fit_or_have_no_area_are_told_and_the_rest_is_reported(tmp_path):
    writer = Writer(tmp_path)
    with writer.store.writing():
        one = writer.cell("one", sheet(), "slim", SLIM, result=flat(sheet(), 0.3))
        two = writer.cell("two", sheet(5), "slim", SLIM, result=flat(sheet(5)))
        nothing = Parameterization(np.zeros((81, 2)), sheet().faces)
        writer.cell("three", sheet(), "slim", SLIM, result=nothing)
    paths = [writer.store.uv_path(row.id) for row in (one, two)]
    contents_of = [path.read_bytes() for path in paths]
    for path, content in zip(paths, contents_of[::-1], strict=True):
        path.write_bytes(content)
    text = parsed(write(tmp_path, jobs=1)).text
    assert text.count("is not the map that was written") == 2
    assert text.count("the map has no area") == 1


def test_a_cloud_has_pictures_and_metrics_of_points(tmp_path):
    points = sheet().vertices
    cloud, result = PointCloud(points), PointParameterization(points[:, :2])
    writer = Writer(tmp_path)
    with writer.store.writing():
        writer.cell("scan", cloud, "meshed", {"flattening": "lscm"}, result=result)
        writer.cell("scan", cloud, "parapoint", {}, result=result)
    index = write(tmp_path, jobs=1)
    text = parsed(index).text
    assert "Angles at points" in text
    assert "Conformality" not in text  # it has no triangles
    page = parsed(index.parent / "models/paper/scan.html")
    assert all((index.parent / "models/paper" / a.split("#")[0]).exists() for a in page.addresses)
    assert "a cloud has pictures alone" in page.text
    tears = page.text.count("where the map tears") - page.text.count("points where the map tears")
    assert tears == 2  # a picture of each map, beside the metric
    assert "local σ1/σ2" in page.text
    drawn = index.parent / "figures" / "paper"
    assert {"clouds.png", "maps-scan.pdf"} <= {path.name for path in drawn.iterdir()}
    assert "disks.png" not in {path.name for path in drawn.iterdir()}


def test_a_user_s_file_and_two_suites(tmp_path):
    writer = Writer(tmp_path)
    with writer.store.writing():
        row = writer.cell("/home/me/scan_1.obj", sheet(), "mine", {}, status="failed", reason="no")
        lines = (tmp_path / "runs.jsonl").read_text()
        other = json.loads(lines) | {"suite": "other", "id": row.id[::-1]}
    with (tmp_path / "runs.jsonl").open("a") as stream:
        stream.write(json.dumps(other) + "\n")
    page = parsed(write(tmp_path, jobs=1))
    assert {"paper", "other"} <= set(page.ids)


@pytest.mark.parametrize("kind", ["missing", "empty", "file", "newer", "damaged"])
def test_the_command_says_what_is_wrong_in_one_line(tmp_path, capsys, kind):
    folder = tmp_path / "results"
    if kind == "file":
        folder.write_text("x")
    elif kind != "missing":
        folder.mkdir()
    if kind == "newer":
        (folder / "environment.json").write_text('{"format": 99, "runs": []}')
    if kind == "damaged":
        (folder / "runs.jsonl").write_text('{"id": 1}\nnot json\n')
        (folder / "environment.json").write_text("[")
    with pytest.raises(SystemExit) as stop:
        console.run(main, [str(folder)])
    said = capsys.readouterr().err
    assert stop.value.code == 2
    assert said.startswith("error: ")
    assert said.count("\n") == 1
    assert str(folder) in said
    assert not (folder / "report").exists()


def test_reports_leave_torch_alone():
    code = (
        "import sys, reports.report, reports.__main__; "
        "bad = [m for m in sys.modules if m == 'torch' or m.startswith('baselines.')]; "
        "print([m for m in bad if m not in ('baselines.registry', 'baselines.credits')])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_the_index_shows_every_model_under_every_method_with_grade_and_flips(tmp_path):
    mesh = sheet()
    folded = flat(mesh).uv * [1, 1]
    folded[:, 0] = np.abs(folded[:, 0] - 0.3)  # laid over itself along a line
    writer = Writer(tmp_path)
    with writer.store.writing():
        for case in ("one", "two"):
            writer.cell(case, mesh, "lscm", {}, result=flat(mesh))
            bad = Parameterization(folded, mesh.faces)
            writer.cell(case, mesh, "parapoint", {"preset": "paper"}, result=bad)
        writer.cell("two", mesh, "arap", {}, status="timeout", reason="over 10 s")
    write(tmp_path, jobs=1)
    section = Section(tmp_path / "report", contents(tmp_path)[0], (), (), (), tmp_path)
    assert list(section.examples) == ["one", "two"]
    order = [label.short for label in section.contents.methods]
    shown = {case: dict(zip(order, maps, strict=True)) for case, maps in section.examples.items()}
    assert shown["one"]["LSCM"].said == "usable"
    assert len(shown["one"]["LSCM"].pictures) == 1
    bad = shown["one"]["ParaPoint"]
    assert bad.mark == "bad"
    assert re.fullmatch(r"broken, \d+\.\d\d % flipped", bad.said)
    assert len(bad.pictures) == 2  # the flips may lie on the other side
    assert (shown["two"]["ARAP"].said, shown["two"]["ARAP"].pictures) == ("timeout", ())
    assert shown["one"]["ARAP"].said == ""  # not run
    text = parsed(tmp_path / "report" / "index.html").text
    assert "Every model under every method" in text
    assert "paper" in text  # the preset is named


def test_what_to_cite_is_one_file_with_each_entry_once(reported):
    text = (reported / "report" / "methods.bib").read_text(encoding="utf-8")
    assert text.count("@article{rabinovich2017,") == 1
    assert text.count("@misc{zhang2024parapoint,") == 1
    assert "tutte1963" not in text
    index = (reported / "report" / "index.html").read_text(encoding="utf-8")
    assert 'href="methods.bib"' in index
    assert "Licence: MIT, on libigl (MPL-2.0)" in index


def test_a_report_shows_maps_that_leave_faces_out(tmp_path):
    mesh = sheet()
    region = np.where(mesh.vertices[:, :1] > 0.5, np.nan, flat(mesh).uv)
    writer = Writer(tmp_path)
    with writer.store.writing():
        writer.cell(HAND, mesh, "lscm", {}, result=flat(mesh))
        writer.cell(HAND, mesh, "da_wand", {}, result=Parameterization(region, mesh.faces))
        writer.cell("other", mesh, "lscm", {}, result=flat(mesh))
    index = write(tmp_path, jobs=1)
    (page,) = (index.parent / "models").rglob("hand*.html")
    assert "left out by the map" in parsed(page).text
    assert len(list(index.parent.rglob("*.da-wand*.webp"))) == 7
    (other,) = (index.parent / "models").rglob("other.html")
    assert "left out by the map" not in parsed(other).text
    (captions,) = index.parent.rglob("captions.md")
    assert "Grey: faces that a map leaves out." in captions.read_text()
