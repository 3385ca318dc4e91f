import json
import shutil

import numpy as np
import pytest
from PIL import Image as Images

from benchmarks.metrics import validity
from benchmarks.rendering.scene import Scene
from benchmarks.rendering.viewpoints import two_cameras
from benchmarks.store.rows import ResultRow
from parapoint.errors import InputError
from parapoint.surfaces.parameterization import PointParameterization
from reports.contents import contents
from reports.pictures import drawing, figures
from reports.pictures.drawing import draw, known_keys
from reports.pictures.names import (
    ARTIST_PICTURES,
    CLOUD_PICTURES,
    CURVES,
    HEAT_PICTURES,
    TEXTURED_PICTURES,
    VIEWED,
    map_file,
    map_kinds,
    model_file,
    slug,
)
from reports.pictures.portraits import Portrait

from ..conftest import HAND, HOSTILE, NEFERTITI, Writer, flat, sheet


def test_slugs_are_safe_and_distinct():
    assert slug("beetle") == "beetle"
    assert slug("a/b") != slug("a_b")
    assert set(slug(HOSTILE)) <= set("abcdefghijklmnopqrstuvwxyz0123456789.-")
    assert not slug("../x").startswith(".")


def test_pictures_are_drawn_once_and_again_when_something_changed(results, tmp_path):
    suite = contents(results)[0]
    assert draw(suite, tmp_path, 1) == []
    files = sorted(path.name for path in tmp_path.glob("*.webp"))
    assert len(files) == 3 * 2 + 7 * 7 + 3 * 4
    before = {name: (tmp_path / name).read_bytes() for name in files}
    stamps = {name: (tmp_path / name).stat().st_mtime_ns for name in files}
    (tmp_path / files[0]).unlink()
    record = tmp_path / "keys.json"
    record.write_text(
        json.dumps(json.loads(record.read_text()) | dict.fromkeys(("gone.webp", "lost.webp"), "0"))
    )
    (tmp_path / "gone.webp").touch()  # of a cell that gave way
    draw(suite, tmp_path, 1)
    assert not (tmp_path / "gone.webp").exists()
    other = [name for name in files if name.split(".")[0] != files[0].split(".")[0]]
    assert {name: (tmp_path / name).read_bytes() for name in files} == before
    assert all((tmp_path / name).stat().st_mtime_ns == stamps[name] for name in other)


@pytest.mark.parametrize(
    ("method", "case", "with_heat", "kinds"),
    [
        ("lscm", HAND, True, (*TEXTURED_PICTURES, *HEAT_PICTURES, CURVES, VIEWED)),
        ("lscm", HAND, False, ("checker-1", "layout", VIEWED)),
        ("slim", HAND, False, (*TEXTURED_PICTURES, VIEWED)),
        ("parapoint", HAND, False, (*TEXTURED_PICTURES, *CLOUD_PICTURES, VIEWED)),
        ("parapoint", "no paper's", False, (*TEXTURED_PICTURES, VIEWED)),
        (
            "parapoint",
            "no paper's",
            True,
            (*TEXTURED_PICTURES, *HEAT_PICTURES, CURVES, *CLOUD_PICTURES, VIEWED),
        ),
    ],
)
def test_a_map_has_the_pictures_that_some_figure_or_page_shows(method, case, with_heat, kinds):
    row = ResultRow("i", "s", case, method, {}, 0, "", "", "ok")
    assert map_kinds(row, points=False, with_heat=with_heat) == kinds
    assert map_kinds(row, points=True, with_heat=with_heat) == CLOUD_PICTURES


def test_a_map_of_another_surface_is_not_drawn():
    portrait = Portrait(sheet(3), 16)
    for other in (flat(sheet(5)), PointParameterization(sheet(3).vertices[:, :2])):
        with pytest.raises(InputError, match="the map is not of this mesh"):
            portrait.map(other, ("layout",))


def test_the_largest_work_comes_first(results, tmp_path, monkeypatch):
    suite = contents(results)[0]
    made = []

    def note(*given):
        *_, rows, missing = given
        made.append(len(rows) * suite.store.surface_path(rows[0].surface_hash).stat().st_size)
        return missing, []

    monkeypatch.setattr(drawing, "draw_model", note)
    draw(suite, tmp_path, 1)
    assert len(made) == len(suite.cases)
    assert made == sorted(made, reverse=True)
    assert len(set(made)) > 1


def test_overlaps_of_a_map_are_found_once_for_a_report(results, tmp_path, monkeypatch):
    found = []
    real = validity.overlaps
    monkeypatch.setattr(validity, "overlaps", lambda *given: found.append(given) or real(*given))
    suite = contents(results)[0]
    found.clear()  # of the metrics
    draw(suite, tmp_path / "pictures", 1)
    spanning = sum(row.case == NEFERTITI and row.status == "ok" for row in suite.rows)
    assert len(found) == spanning > 0
    figures.draw(suite, tmp_path / "pictures", tmp_path, 1)
    assert len(found) == spanning


def test_seams_are_marked(reported):
    suite = contents(reported)[0]
    folder = reported / "report" / "figures" / "paper" / "pictures"
    ours = next(label for label in suite.methods if label.method == "parapoint")

    def greens(case, kind):
        file = folder / map_file(suite.shown(case, ours), kind)
        red, green, blue, _ = np.moveaxis(np.asarray(Images.open(file)).astype(int), 2, 0)
        return ((green > red + 60) & (green > blue + 60)).sum()

    assert greens(NEFERTITI, "checker-1") + greens(NEFERTITI, "checker-2") > 0
    assert greens(HAND, "checker-1") == 0


def test_a_damaged_map_is_told_and_the_rest_drawn(results, tmp_path):
    folder = tmp_path / "results"
    shutil.copytree(results, folder)
    suite = contents(folder)[0]
    row = next(row for row in suite.rows if row.uv_file)
    (folder / row.uv_file).write_bytes(b"torn")
    faults = draw(suite, tmp_path / "pictures", 1)
    assert len(faults) == 1
    assert "damaged" in faults[0]
    assert len(list((tmp_path / "pictures").glob("*.webp"))) == 3 * 2 + 6 * 7 + 3 * 4


def test_the_viewer_first_looks_from_where_the_first_picture_was_taken():
    mesh = sheet(3)
    first, second = two_cameras(Scene(mesh))
    facts, _ = Portrait(mesh, 16).model()[VIEWED]
    assert facts["axes"] == first.axes.tolist() != second.axes.tolist()


def test_a_model_that_could_not_be_had_does_not_keep_the_next_from_being_drawn(tmp_path):
    writer = Writer(tmp_path)
    with writer.store.writing():
        writer.cell("gone", None, "lscm", {}, status="skipped")
        writer.cell("here", sheet(3), "lscm", {}, status="failed")
    assert draw(contents(tmp_path)[0], tmp_path / "pictures", 1) == []
    names = {path.name for path in (tmp_path / "pictures").glob("*.webp")}
    assert names == {"here.mesh-1.webp", "here.mesh-2.webp"}


def test_the_artist_s_map_is_drawn_where_a_model_came_with_one(tmp_path):
    mesh = sheet()
    writer = Writer(tmp_path)
    with writer.store.writing():
        row = writer.cell(HAND, mesh, "lscm", {}, result=flat(mesh))
        writer.store.add_reference(row.surface_hash, flat(mesh, 0.5))
    suite = contents(tmp_path)[0]
    folder = tmp_path / "pictures"
    assert draw(suite, folder, 1) == []
    made = [folder / model_file(HAND, kind) for kind in ARTIST_PICTURES]
    assert all(path.exists() for path in made)
    assert suite.has_artist(HAND)
    made[0].unlink()
    draw(suite, folder, 1)
    assert made[0].exists()
    writer.store.reference_path(row.surface_hash).write_bytes(b"torn")
    made[0].unlink()
    assert "no picture of the artist's map" in draw(suite, folder, 1)[0]


def test_names_in_a_record_from_elsewhere_reach_no_file_outside(tmp_path):
    record = tmp_path / "keys.json"
    names = ["../outside.txt", "/etc/passwd", "a/b.webp", ".hidden", "..", "", "hand.view.webp"]
    record.write_text(json.dumps(dict.fromkeys(names, "key")))
    assert known_keys(record) == {"hand.view.webp": "key"}
