"""The `score` command: tables, JSON, heatmap, and one line for whatever is wrong."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from benchmarks.__main__ import main
from benchmarks.commands.score import (
    json_values,
    map_state,
    number,
    worst_faces,
    worst_table,
)
from benchmarks.metrics import evaluation
from benchmarks.metrics.evaluation import evaluate
from benchmarks.metrics.grades import GRADES
from benchmarks.metrics.state import MapState
from benchmarks.metrics.table import METRICS
from benchmarks.store.submissions import difference
from parapoint import Mesh, PointCloud, console
from parapoint.files.reading import read_parameterized
from parapoint.files.writing.point_writers import write_points

# Two quads side by side; the second is drawn twice as long, in a chart of its own.
OBJ = """v 0 0 0
v 1 0 0
v 2 0 0
v 0 1 0
v 1 1 0
v 2 1 0
vt 0 0
vt 1 0
vt 1 1
vt 0 1
vt 2 0
vt 4 0
vt 4 1
vt 2 1
f 1/1 2/2 5/3 4/4
f 2/5 3/6 6/7 5/8
"""


@pytest.fixture
def obj(tmp_path):
    path = tmp_path / "quads.obj"
    path.write_text(OBJ)
    return path


def run(capsys, *arguments):
    with pytest.raises(SystemExit) as end:
        console.run(main, ["score", *map(str, arguments)])
    out, err = capsys.readouterr()
    return end.value.code, out, err


def fault(capsys, *arguments):
    code, out, err = run(capsys, *arguments)
    assert code == 2
    assert out == ""
    assert err.startswith("error: ")
    assert err.count("\n") == 1
    return err


def test_the_tables_have_every_metric_in_its_group(obj, capsys):
    code, out, err = run(capsys, obj)
    assert (code, err) == (0, "")
    for name, metric in METRICS.items():
        printed = metric.group not in ("reference", "points") and "_without" not in name
        assert (f"  {name} " in out) == printed, name
    assert "4 faces, surface: disk" in out
    assert "worst faces" in out
    # The seam between the quads is 1 long, on an area of 2.
    assert "0.70711" in out


def test_json_is_one_object_with_the_names_of_the_registry(obj, capsys):
    code, out, err = run(capsys, obj, "--json", "--reference", obj)
    assert (code, err) == (0, "")
    values = json.loads(out)
    assert values.pop("grade") in GRADES
    assert list(values) == [m.name for m in METRICS.values() if m.group != "points"]
    assert values == evaluate(*read_parameterized(obj), read_parameterized(obj)[1])
    assert values["chart_count"] == 2
    assert values["seam_excess"] == 0


def test_infinity_is_a_string_in_json(tmp_path, capsys):
    path = tmp_path / "flat.obj"
    path.write_text(OBJ.replace("vt 4 1", "vt 4 0"))
    code, out, _ = run(capsys, path, "--json")
    assert code == 0
    values = json.loads(out, parse_constant=lambda _: pytest.fail("not strict JSON"))
    assert values["degenerate_uv_count"] == 1
    assert values["quasi_conformal_max"] == "inf"
    assert float(values["quasi_conformal_max"]) == np.inf
    assert json_values({"a": 1.0, "b": np.inf}) == {"a": 1.0, "b": "inf"}


def test_the_worst_faces_are_named(tmp_path):
    path = tmp_path / "bent.obj"
    path.write_text(OBJ.replace("vt 4 1", "vt 9 1"))
    state = map_state(path)
    angle, area = worst_faces(state)
    ratio = np.full(4, 0.0)
    ratio[state.distortion.faces] = state.distortion.quasi_conformal
    assert angle.tolist() == np.argsort(-ratio, kind="stable").tolist()
    assert set(area.tolist()) == {0, 1, 2, 3}
    columns = {str(column.header): list(column.cells) for column in worst_table(state).columns}
    assert columns["worst by"] == ["angle"] * 4 + ["area"] * 4
    assert columns["face"] == [str(face) for face in (*angle, *area)]
    first = int(angle[0])
    assert columns["vertices"][0] == " ".join(map(str, state.mesh.faces[first]))
    assert columns["chart"][0] == str(state.parameterization.charts()[first])
    assert columns["σ1/σ2"][0] == number(ratio[first])
    assert columns["notes"] == [""] * 8


def test_what_is_wrong_with_one_of_the_worst_faces_is_noted(tmp_path: Path) -> None:
    path = tmp_path / "folded.obj"
    path.write_text(OBJ.replace("vt 4 1", "vt 0 5"))
    columns = {
        str(column.header): list(column.cells) for column in worst_table(map_state(path)).columns
    }
    notes = dict(zip(columns["face"], columns["notes"], strict=True))
    flipped = map_state(path).validity.flipped
    assert flipped.any()
    assert {face for face, note in notes.items() if "flipped" in note} == {
        str(face) for face in np.flatnonzero(flipped)
    }


def test_a_point_cloud_is_scored_without_a_mesh(tmp_path, capsys):
    uv = np.random.default_rng(0).uniform(size=(200, 2))
    path = tmp_path / "cloud.npz"
    np.savez(path, points=np.column_stack([uv, np.zeros(200)]), uv=uv * [3, 1])
    code, out, _ = run(capsys, path, "--json")
    assert code == 0
    values = json.loads(out)
    assert values.pop("grade") == "usable"
    names = [m.name for m in METRICS.values() if m.group == "points"]
    assert list(values) == [*names, "coverage"]
    assert values["local_quasi_conformal_mean"] == pytest.approx(3, rel=1e-9)
    code, out, _ = run(capsys, path)
    assert "neighbour_preservation" in out


def test_the_heatmap_shows_the_stretched_quad_in_another_colour(obj, tmp_path, capsys):
    path = tmp_path / "heat.png"
    code, _, err = run(capsys, obj, "--heatmap", path, "--json")
    assert (code, err) == (0, "")
    with Image.open(path) as image:
        colours = np.asarray(image.convert("RGB")).reshape(-1, 3)
    assert len(colours) > 500_000
    spread = np.ptp(colours.astype(int), axis=1)
    assert (spread > 60).mean() > 0.02  # coloured faces on white


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "no such file"),
        ("", "empty"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "has no UV coordinates"),
        (OBJ.replace("6/7", "6/70"), "UV index out of range"),
        (OBJ.replace("vt 4 1", "vt nan 1"), "finite"),
        (OBJ.replace("vt 4 1", "vt inf 1"), "finite"),
        (OBJ.replace("vt 4 1", "vt 1e200 1"), "uv above 1e+151 make areas overflow"),
        (OBJ.replace("v 2 1 0", "v 2 1e200 0"), "areas of it are beyond a float64"),
        (OBJ.replace("2/5 3/6 6/7 5/8", "2 3 6 5"), "have no UV"),
        ("\n".join("vt 0 0" if x.startswith("vt") else x for x in OBJ.split("\n")), "zero UV area"),
        ("no mesh at all", "no"),
    ],
)
def test_bad_maps_get_one_line(tmp_path, capsys, content, words):
    path = tmp_path / "bad.obj"
    if content is not None:
        path.write_text(content)
    message = fault(capsys, path)
    assert words in message
    assert "bad.obj" in message


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (OBJ.replace("f 2/5 3/6 6/7 5/8\n", ""), "other faces"),
        (OBJ.replace("v 2 1 0", "v 2 1 0.1"), "other faces"),
        (OBJ.replace("f 1/1 2/2 5/3 4/4", "f 2/2 5/3 4/4 1/1"), "other faces"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "has no UV"),
    ],
)
def test_bad_references_get_one_line(obj, tmp_path, capsys, content, words):
    path = tmp_path / "reference.obj"
    path.write_text(content)
    message = fault(capsys, obj, "--reference", path)
    assert words in message
    assert "reference.obj" in message


def test_a_rounded_reference_is_the_same_mesh(obj):
    mesh, _ = read_parameterized(obj)
    assert not difference(mesh, Mesh(mesh.vertices + 1e-6, mesh.faces))
    assert difference(mesh, Mesh(mesh.vertices + 1e-3, mesh.faces))


@pytest.mark.parametrize(
    ("arrays", "words"),
    [
        ({"points": np.zeros((9, 3))}, "has no uv for each point"),
        ({"points": np.zeros((9, 3)), "uv": np.zeros((8, 2))}, "8 uv rows"),
        ({"points": np.full((9, 3), np.nan), "uv": np.zeros((9, 2))}, "finite"),
        ({"points": np.zeros((3, 3)), "uv": np.zeros((3, 2))}, "4 are needed"),
    ],
)
def test_bad_point_maps_get_one_line(tmp_path, capsys, arrays, words):
    path = tmp_path / "cloud.npz"
    np.savez(path, **arrays)
    assert words in fault(capsys, path)


@pytest.mark.parametrize("ending", [".ply", ".npz", ".obj"])
@pytest.mark.parametrize("stray", [False, True])
def test_points_are_scored_in_every_format_that_is_written(tmp_path, capsys, ending, stray):
    """One map, one set of numbers; a stray row is not covered."""
    points = np.random.default_rng(0).uniform(size=(60, 3)) * [1, 1, 0]
    uv = points[:, :2] * [2.0, 1.0]
    uv[7] = np.nan if stray else uv[7]
    path = tmp_path / f"cloud{ending}"
    write_points(path, PointCloud(points), uv)
    _, out, _ = run(capsys, path, "--json")
    values = json.loads(out)
    assert values["local_quasi_conformal_mean"] == pytest.approx(2, abs=1e-6)
    assert values["coverage"] == pytest.approx(59 / 60 if stray else 1)


def test_the_heatmap_is_refused_before_any_work(obj, tmp_path, capsys, monkeypatch):
    """A folder that is not there, a folder in the way, an input."""
    monkeypatch.setattr(evaluation, "values", None)
    (tmp_path / "folder.png").mkdir()
    for name, words in {"none/x.png": "no such folder", "folder.png": "is a folder"}.items():
        assert words in fault(capsys, obj, "--heatmap", tmp_path / name)


def test_wrong_use_gets_one_line(obj, tmp_path, capsys):
    assert "--colour" in fault(capsys, obj, "--colour")
    assert "ends in .png" in fault(capsys, obj, "--heatmap", tmp_path / "x.jpg")
    cloud = tmp_path / "cloud.npz"
    cloud.write_bytes(b"PK no zip")
    assert "cloud.npz" in fault(capsys, cloud)
    np.savez(cloud, points=np.eye(3), uv=np.eye(3)[:, :2])
    assert "need a mesh" in fault(capsys, cloud, "--heatmap", tmp_path / "x.png")
    assert not list(tmp_path.glob("x.*"))


def test_scoring_leaves_torch_and_drawing_out(obj):
    code = (
        "import sys; from benchmarks.__main__ import main; from parapoint import console\n"
        f"try: console.run(main, ['score', {str(obj)!r}, '--json'])\n"
        "except SystemExit: pass\n"
        "assert not {'torch', 'matplotlib'} & set(sys.modules), 'imported'"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_numbers_are_short():
    assert [number(x) for x in (1.0, 32416.0, 0.123456789, np.inf, 1e-9)] == [
        "1",
        "32416",
        "0.12346",
        "inf",
        "1e-09",
    ]


def test_a_map_state_shares_what_the_tables_and_the_picture_need(obj):
    state = map_state(obj)
    assert isinstance(state, MapState)
    assert state.distortion is state.distortion
