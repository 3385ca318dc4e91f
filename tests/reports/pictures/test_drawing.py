import json
import shutil

import numpy as np
import pytest
from PIL import Image as Images

from benchmarks.rendering.colours import linear
from benchmarks.rendering.maps import ANGLE_SCALE, Map, heat
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import Mesh
from reports.contents import contents
from reports.pictures.drawing import draw, known_keys
from reports.pictures.names import ARTIST_PICTURES, map_file, model_file, slug

from ..conftest import HAND, HOSTILE, NEFERTITI, Writer, ball, flat, lonlat, sheet


def test_slugs_are_safe_and_distinct():
    assert slug("beetle") == "beetle"
    assert slug("a/b") != slug("a_b")
    assert set(slug(HOSTILE)) <= set("abcdefghijklmnopqrstuvwxyz0123456789.-")
    assert not slug("../x").startswith(".")


def test_uv_is_scaled_to_the_area_upright_and_unmirrored():
    mesh = sheet()
    uv = flat(mesh).uv * [-8, 2]
    found = Map(mesh, Parameterization(uv, mesh.faces)).uv
    a, b = found[:, 1] - found[:, 0], found[:, 2] - found[:, 0]
    areas = (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / 2
    assert areas.min() > 0
    assert areas.sum() == pytest.approx(mesh.face_areas.sum())
    width, height = np.ptp(found, axis=(0, 1))
    assert height > 3 * width


def test_spanning_faces_neither_scale_nor_colour_the_map():
    mesh = ball()
    found = Map(mesh, lonlat(mesh))
    assert 0 < found.spanning.mean() < 0.3
    assert not (found.flipped & found.spanning).any()
    np.testing.assert_array_equal(np.isnan(found.angle), found.spanning)
    np.testing.assert_array_equal(np.isnan(found.area), found.spanning)


def test_heat_of_a_stretch_known_by_hand():
    mesh = Mesh(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), [[0, 1, 2]])
    found = Map(mesh, Parameterization([[0.0, 0], [4, 0], [0, 1]], mesh.faces))
    np.testing.assert_allclose(found.angle, [2.0])
    np.testing.assert_allclose(found.area, [0.0], atol=1e-12)


def test_a_face_without_uv_area_has_the_worst_colour():
    mesh = sheet()
    uv = flat(mesh).uv.copy()
    uv[mesh.faces[0]] = uv[mesh.faces[0, 0]]
    found = Map(mesh, Parameterization(uv, mesh.faces))
    assert found.angle[0] == np.inf
    assert found.area[0] == -np.inf
    colours = heat(np.array([0.0, np.inf, 2.0, np.nan]), ANGLE_SCALE)
    np.testing.assert_array_equal(colours[1], colours[2])
    np.testing.assert_allclose(colours[3], linear([0.8] * 3))


def test_pictures_are_drawn_once_and_again_when_something_changed(results, tmp_path):
    suite = contents(results)[0]
    assert draw(suite, tmp_path, 1) == []
    files = sorted(path.name for path in tmp_path.glob("*.webp"))
    assert len(files) == 3 * 2 + 7 * 7 + 3 * 4
    before = {name: (tmp_path / name).read_bytes() for name in files}
    stamps = {name: (tmp_path / name).stat().st_mtime_ns for name in files}
    (tmp_path / files[0]).unlink()
    record = tmp_path / "keys.json"
    record.write_text(json.dumps(json.loads(record.read_text()) | {"gone.webp": "0"}))
    (tmp_path / "gone.webp").touch()  # of a cell that gave way
    draw(suite, tmp_path, 1)
    assert not (tmp_path / "gone.webp").exists()
    other = [name for name in files if name.split(".")[0] != files[0].split(".")[0]]
    assert {name: (tmp_path / name).read_bytes() for name in files} == before
    assert all((tmp_path / name).stat().st_mtime_ns == stamps[name] for name in other)


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
