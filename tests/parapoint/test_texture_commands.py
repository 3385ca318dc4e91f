"""`unwrap` of clouds into textured meshes, and `bake`."""

import contextlib
import io
import json
import logging

import numpy as np
import pytest
from PIL import Image
from rich.console import Console
from rich.progress import Progress as Bar

from parapoint import ComputedMap, PointCloud, cli
from parapoint.commands.output import write
from parapoint.commands.progress import bar
from parapoint.commands.telling import advice_of_cloud
from parapoint.files.reading import read_parameterized, read_surface
from parapoint.files.writing.point_writers import write_points
from parapoint.fitting import Progress
from parapoint.textures.preview import SIDE

COUNT = 400


def run(arguments: list, capsys) -> tuple[int, str, str]:
    """Exit status, standard output and standard error of a command."""
    with pytest.raises(SystemExit) as end:
        cli.console.run(cli.parapoint, list(map(str, arguments)))
    shown = capsys.readouterr()
    return int(end.value.code or 0), shown.out, shown.err


@pytest.fixture(scope="module")
def bowl() -> PointCloud:
    """A coloured bowl, seen from below: its normals point down."""
    rng = np.random.default_rng(0)
    xy = np.sqrt(rng.random((COUNT, 1))) * [[1, 0]]
    turn = 2 * np.pi * rng.random(COUNT)
    xy = np.column_stack([xy[:, 0] * np.cos(turn), xy[:, 0] * np.sin(turn)])
    points = np.column_stack([xy, 0.5 * (xy**2).sum(axis=1)])
    normals = np.column_stack([xy, -np.ones(COUNT)])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    colours = np.rint(127.5 * (1 + np.column_stack([xy, 0 * turn]))).astype(np.uint8)
    return PointCloud(points, normals, attributes={"colours": colours, "intensity": points[:, 0]})


@pytest.fixture(scope="module")
def model(bowl) -> ComputedMap:
    return ComputedMap().fit(bowl)


@pytest.fixture
def scan(bowl, tmp_path):
    path = tmp_path / "scan.ply"
    write_points(path, bowl, bowl.points[:, :2])
    return path


def test_a_scan_becomes_a_textured_model_in_one_command(scan, tmp_path, capsys) -> None:
    target = tmp_path / "scan.glb"
    status, out, err = run(
        ["unwrap", scan, "--out", target, "--texture", 128, "--margin", 4, "--json"], capsys
    )
    assert (status, err) == (0, "")
    facts = json.loads(out)
    assert facts["texture"] == 128
    assert 0.4 < facts["texture_fill"] < 1
    mesh, own = read_parameterized(target)
    assert own.uv.min() > 3 / 128
    assert own.uv.max() < 1 - 3 / 128
    assert len(mesh.vertices) == COUNT
    # Seen from below, as the normals point, nothing is mirrored.
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    assert np.cross(b - a, c - a)[:, 2].max() < 0
    first, second = (own.uv[own.corners[:, k]] - own.uv[own.corners[:, 0]] for k in (1, 2))
    assert (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]).min() > 0


@pytest.mark.parametrize("command", ["unwrap", "fit", "map"])
def test_the_last_lines_say_how_good_the_map_is(command, model, scan, capsys, monkeypatch) -> None:
    monkeypatch.setattr("parapoint.commands.output.TEXTURE", 64)
    tmp_path = scan.parent
    target = tmp_path / "model.glb"
    arguments = {
        "unwrap": ["unwrap", scan, "--out", target, "--texture", 64],
        "fit": ["fit", scan, "--out", target],
        "map": ["map", tmp_path / "model", scan, "--out", target],
    }
    model.save(tmp_path / "model")
    status, out, err = run(arguments[command], capsys)
    assert (status, err) == (0, "")
    first, angles, part, seam = out.splitlines()
    assert first.startswith(f"{target}: ")
    assert " faces in " in first
    assert "° at worst; stretch" in angles
    assert part.endswith("; 0 flipped faces, overlap: none")
    assert seam.startswith("1 chart, seam 0")
    assert "texels per unit" in seam


class Watched:
    """Stands in for the bar: what it was told."""

    def __init__(self) -> None:
        self.told: list[Progress] = []

    @contextlib.contextmanager
    def __call__(self):
        yield self.told.append

    @property
    def phases(self) -> list[str]:
        """Each phase once, in their order."""
        return list(dict.fromkeys(now.phase for now in self.told))


@pytest.mark.parametrize("command", ["unwrap", "bake", "fit", "map", "mesh"])
def test_every_phase_is_told(command, model, scan, capsys, monkeypatch) -> None:
    tmp_path = scan.parent
    model.save(tmp_path / "model")
    write(model, read_surface(scan), str(tmp_path / "mesh.obj"), texture=64)
    arguments = {
        "unwrap": ["unwrap", scan, "--out", tmp_path / "a.glb", "--texture", 64],
        "bake": [
            *("bake", tmp_path / "model", scan, "--map", "colour"),
            *("--texture", 64, "--out", tmp_path / "a.png"),
        ],
        "fit": ["fit", scan, "--out", tmp_path / "other"],
        "map": ["map", tmp_path / "model", scan, "--out", tmp_path / "a.glb"],
        "mesh": ["unwrap", tmp_path / "mesh.obj", "--out", tmp_path / "a.glb", "--texture", 64],
    }
    computing = ["reconstructing", "cutting", "flattening"]
    wanted = {
        "unwrap": ["reading", *computing, "mapping", "baking", "writing", "measuring"],
        "bake": ["reading", "baking", "writing"],
        "fit": ["reading", *computing, "writing", "measuring"],
        "map": ["reading", "mapping", "baking", "writing", "measuring"],
        "mesh": ["reading", "cutting and flattening", "packing", "baking", "writing", "measuring"],
    }
    place = arguments[command][0]
    watched = Watched()
    monkeypatch.setattr("parapoint.commands.output.TEXTURE", 64)
    monkeypatch.setattr(f"parapoint.commands.{place}.bar", watched)
    assert run(arguments[command], capsys)[0] == 0
    assert watched.phases == wanted[command]
    shares = [now.fraction for now in watched.told if now.phase == "baking" and now.fraction]
    assert shares == sorted(shares)
    assert not shares or shares[-1] == 1


def test_log_lines_stand_above_the_bar(monkeypatch) -> None:
    drawn = io.StringIO()
    monkeypatch.setattr(
        "parapoint.commands.progress.terminal",
        lambda **_: Console(file=drawn, force_terminal=True, width=60),
    )
    monkeypatch.setattr(logging.root, "handlers", [])
    cli.parapoint.callback()
    with bar() as tell:
        tell(Progress("baking", 0.25))
        logging.getLogger("parapoint").warning("a %s", "line")
        tell(Progress("baking", 0.5))
    before, _, after = drawn.getvalue().partition("a line\n")
    assert before.endswith("\x1b[2K")  # the bar was wiped off the line
    assert "baking" in after


def test_the_bar_fills_where_a_share_is_told_and_pulses_elsewhere(monkeypatch) -> None:
    bars = []

    class Kept(Bar):
        def __init__(self, *columns, **options) -> None:
            super().__init__(*columns, **options)
            bars.append(self)

    monkeypatch.setattr("parapoint.commands.progress.Bar", Kept)
    with bar() as tell:
        for share, total in ((None, None), (0.25, 1.0), (1.0, 1.0), (None, None)):
            tell(Progress("baking", share))
            (task,) = bars[0].tasks
            assert (task.completed, task.total) == (share or 0.0, total)
            assert task.finished == (share == 1)  # then its clock stands still


def test_the_end_is_reckoned_from_the_share_that_is_done(monkeypatch) -> None:
    drawn = io.StringIO()
    monkeypatch.setattr(
        "parapoint.commands.progress.terminal",
        lambda **_: Console(file=drawn, force_terminal=True, width=60),
    )
    now = [0.0]
    monkeypatch.setattr("parapoint.commands.progress.monotonic", lambda: now[0])
    with bar() as tell:
        tell(Progress("reading"))
        now[0] = 100.0
        tell(Progress("baking"))
        now[0] = 130.0
        tell(Progress("baking", 0.25))
        now[0] = 170.0  # the time goes on although nothing is told
    assert "50 s left" in drawn.getvalue()


@pytest.mark.parametrize("saved", [True, False])
def test_a_fit_that_is_broken_off_says_how_to_go_on(saved, scan, tmp_path, capsys, caplog) -> None:
    def broken_off(*_, **__):
        if saved:
            (tmp_path / "model" / "component-0").mkdir(parents=True)
            (tmp_path / "model" / "component-0" / "checkpoint.json").touch()
        raise KeyboardInterrupt

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("parapoint.commands.fit.fitted", broken_off)
        status, _, err = run(["fit", scan, "--out", tmp_path / "model"], capsys)
    assert (status, err) == (130, "\ninterrupted\n")
    assert ("the same command goes on" if saved else "--time-budget SECONDS") in caplog.text


@pytest.mark.parametrize("ending", [".obj", ".ply"])
def test_the_texture_shows_each_point_in_its_colour(ending, model, bowl, tmp_path) -> None:
    target = tmp_path / f"a{ending}"
    write(model, bowl, str(target), texture=256)
    picture = np.asarray(Image.open(tmp_path / "a.png"))
    assert picture.shape == (256, 256, 3)
    if ending == ".ply":
        mesh = read_surface(target)
        assert len(mesh.vertices) == COUNT
        return
    mesh, own = read_parameterized(target)
    uv = np.empty((len(mesh.vertices), 2))
    uv[mesh.faces] = own.uv[own.corners]
    column, line = (256 * uv[:, 0]).astype(int), (256 * (1 - uv[:, 1])).astype(int)
    wanted = 127.5 * (1 + np.column_stack([mesh.vertices[:, :2], np.zeros(COUNT)]))
    assert np.abs(picture[line, column] - wanted).mean() < 3


def test_a_cloud_without_colours_gets_a_checkerboard(model, bowl, tmp_path) -> None:
    facts = write(model, PointCloud(bowl.points), str(tmp_path / "a.ply"), texture=64)
    assert "texture_fill" not in facts
    values = np.unique(np.asarray(Image.open(tmp_path / "a.png")))
    assert values.tolist() == [70, 235]


@pytest.mark.parametrize("ending", [".glb", ".npz"])
def test_a_preview_shows_the_surface_beside_its_layout(
    ending, model, bowl, tmp_path, monkeypatch
) -> None:
    monkeypatch.setattr("parapoint.textures.preview.SAMPLES", 200_000)
    write(model, bowl, str(tmp_path / f"a{ending}"), texture=64, preview=tmp_path / "p.png")
    picture = np.asarray(Image.open(tmp_path / "p.png"))
    assert picture.shape == (SIDE, 3 * SIDE, 3)
    for third in np.split(picture, 3, axis=1):
        white = (third == 255).all(axis=2)
        assert not white[SIDE // 2, SIDE // 2]
        assert 0.1 < white.mean() < 0.9
        assert white[0, 0]


def test_points_keep_what_is_known_of_them(model, bowl, tmp_path) -> None:
    write(model, bowl, str(tmp_path / "a.ply"))
    cloud = read_surface(tmp_path / "a.ply")
    assert np.array_equal(cloud.attributes["colours"], bowl.attributes["colours"])
    uv = np.column_stack([cloud.attributes["u"], cloud.attributes["v"]])
    assert uv.min() >= 0
    assert uv.max() <= 1


@pytest.mark.parametrize("kind", ["colour", "normal", "position", "intensity"])
def test_bake_of_a_saved_model(kind, model, scan, tmp_path, capsys) -> None:
    model.save(tmp_path / "model")
    target = tmp_path / f"{kind}.png"
    status, out, err = run(
        ["bake", tmp_path / "model", scan, "--out", target, "--map", kind, "--texture", 64], capsys
    )
    assert (status, err) == (0, "")
    assert out == f"{target}: {kind} of {COUNT} points in 64 x 64 texels\n"
    with Image.open(target) as image:
        assert image.size == (64, 64)
        if kind == "position":
            assert len(image.info["position of black"].split()) == 3
        if kind == "normal":  # the mesh has the normals of the cloud, up to the triangles' size
            blue = np.asarray(image)[..., 2]
            assert blue[24:40, 24:40].min() > 240


def test_bake_of_a_mesh_is_of_its_own_uv(model, bowl, scan, tmp_path, capsys) -> None:
    write(model, bowl, str(tmp_path / "mesh.obj"), texture=64)
    first = ["bake", tmp_path / "mesh.obj", scan, "--map", "colour", "--texture", 64]
    assert run([*first, "--out", tmp_path / "b.png", "--json"], capsys)[0] == 0
    # 64 texels leave a quarter of a texel free around the map, as unwrap does.
    again = np.asarray(Image.open(tmp_path / "b.png")).astype(int)
    written = np.asarray(Image.open(tmp_path / "mesh.png")).astype(int)
    assert np.abs(again - written).mean() < 0.1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["unwrap", "SCAN", "--out", "a.glb", "--texture", "0"], "--texture must be from 16 to"),
        (["unwrap", "SCAN", "--out", "a.glb", "--texture", "100000"], "--texture must be from"),
        (["unwrap", "SCAN", "--out", "a.glb", "--margin", "-1"], "--margin must be from 0"),
        (["unwrap", "SCAN", "--out", "a.fbx"], "cannot write this ending"),
        (["unwrap", "SCAN", "--out", "no/a.glb"], "there is no such folder"),
        (["unwrap", "SCAN", "--out", "SCAN"], "is the input"),
        (["unwrap", "SCAN", "--out", "mine.obj"], "is a file of yours"),
        (
            ["unwrap", "SCAN", "--out", "mine.ply", "--texture", "64"],
            "is a file of yours",
        ),
        (["unwrap", "SCAN", "--out", "a.glb", "--preview", "a.jpg"], "ends in .png"),
        (["unwrap", "SCAN", "--out", "a.obj", "--preview", "a.png"], "is the texture of"),
        (["unwrap", "SCAN", "--out", "A.OBJ", "--preview", "A.png"], "is the texture of"),
        (["unwrap", "SCAN", "--out", "a b.Ply", "--preview", "a_b.png"], "is the texture of"),
        (["unwrap", "SCAN", "--out", "a.obj", "--preview", "empty/../a.png"], "is the texture of"),
        (["unwrap", "SCAN", "--out", "a.glb", "--preview", "no/a.png"], "no such folder"),
        (["bake", "MESH", "SCAN", "--out", "a.jpg", "--map", "colour"], "ends in .png"),
        (["bake", "MESH", "SCAN", "--out", "a.png", "--map", "gloss"], "--map must be one of"),
        (
            ["bake", "MESH", "SCAN", "--out", "a.png", "--map", "colour", "--texture", "0"],
            "from 16",
        ),
        (["bake", "MESH", "SCAN", "--out", "no/a.png", "--map", "colour"], "no such folder"),
        (["bake", "MESH", "BARE", "--out", "a.png", "--map", "colour"], "bare.xyz: has no colours"),
        (["bake", "MESH", "BARE", "--out", "a.png", "--map", "normal"], "has no normals"),
        (["bake", "MESH", "MESH", "--out", "a.png", "--map", "position"], "is a mesh; a cloud"),
        (["bake", "SCAN", "SCAN", "--out", "a.png", "--map", "colour"], "a UV map needs a mesh"),
        (["bake", "MESH", "FAR", "--out", "a.png", "--map", "position"], "does not lie on"),
        (["bake", "NO_AREA", "SCAN", "--out", "a.png", "--map", "colour"], "UVs have no area"),
        (["bake", "NO_SIZE", "SCAN", "--out", "a.png", "--map", "colour"], "UVs have no area"),
        (["bake", "EMPTY", "SCAN", "--out", "a.png", "--map", "colour"], "no saved model here"),
    ],
)
@pytest.mark.usefixtures("scan")
def test_wrong_use_is_one_line_and_nothing_written(arguments, message, tmp_path, capsys) -> None:
    points = read_surface(tmp_path / "scan.ply").points
    np.savetxt(tmp_path / "bare.xyz", points)
    np.savetxt(tmp_path / "far.xyz", points + 10)
    (tmp_path / "empty").mkdir()
    (tmp_path / "mine.png").write_bytes(b"a picture of my own")
    (tmp_path / "mesh.obj").write_text(
        "v -1 -1 0\nv 1 -1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n"
    )
    names = {"SCAN": "scan.ply", "BARE": "bare.xyz", "FAR": "far.xyz"}
    names |= {"MESH": "mesh.obj", "EMPTY": "empty", "NO_AREA": "line.obj"}
    names |= {"NO_SIZE": "point.obj"}
    (tmp_path / "point.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 2 0 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n"
    )
    (tmp_path / "line.obj").write_text(
        "v -1 -1 0\nv 1 -1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0.5 0\nf 1/1 2/2 3/3\n"
    )
    before = {path: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()}
    with contextlib.chdir(tmp_path):
        status, out, err = run([names.get(word, word) for word in arguments], capsys)
    assert (status, out) == (2, "")
    assert message in err
    assert err.count("\n") == 1
    assert not any(err.count(f"{name}: ") > 1 for name in names.values())
    assert {path: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()} == before


def test_points_that_the_mesh_leaves_out_are_counted(bowl, tmp_path, capsys, caplog) -> None:
    clump = 0.2 * np.random.default_rng(1).normal(size=(150, 3)) + [0, 0, 3]
    path = tmp_path / "parts.xyz"
    np.savetxt(path, np.concatenate([bowl.points, clump]))
    arguments = ["unwrap", path, "--out", tmp_path / "a.glb", "--json"]
    status, out, _ = run(arguments, capsys)
    assert status == 0
    facts = json.loads(out)
    assert (facts["mapped_points"], facts["unmapped_points"]) == (COUNT, 150)
    assert "--components each maps parts that stand apart" in caplog.text
    caplog.clear()
    status, out, _ = run([*arguments, "--components", "each"], capsys)
    assert json.loads(out)["mapped_points"] > COUNT + 100
    assert "--components each maps" not in caplog.text


def test_a_texture_that_the_format_cannot_hold_is_told(scan, tmp_path, capsys, caplog) -> None:
    target = tmp_path / "a.npz"
    assert run(["unwrap", scan, "--out", target, "--texture", 64], capsys)[0] == 0
    assert caplog.messages == [f"{target}: no texture is written: this format has none"]


@pytest.mark.parametrize(
    ("budget", "distortion", "says"),
    [
        (9.0, "balanced", "more time or --distortion isometric can help"),
        (None, "balanced", "--distortion isometric can help"),
        (None, None, "--distortion isometric can help"),
        (9.0, "isometric", "more time can help"),
        (None, "isometric", "crop it to the part that matters"),
    ],
)
def test_advice_is_none_that_was_followed(budget, distortion, says) -> None:
    assert advice_of_cloud(budget, distortion, "together")["starved"] == says
    for components in ("together", "largest", "each"):
        overlap = advice_of_cloud(budget, distortion, components)["overlap"]
        assert ("--components each" in overlap) == (components != "each")


@pytest.mark.parametrize(("ending", "is_y_up"), [(".obj", True), (".ply", False)])
def test_a_picture_of_a_cloud_is_upright(ending, is_y_up, scan, capsys, monkeypatch) -> None:
    tmp_path, source = scan.parent, scan.with_suffix(ending)
    if ending != ".ply":
        cloud = read_surface(scan)
        write_points(source, cloud, cloud.points[:, :2])
    seen = []
    monkeypatch.setattr(
        "parapoint.commands.output.write_preview",
        lambda *_, is_y_up: seen.append(is_y_up),
    )
    arguments = ["unwrap", source, "--out", tmp_path / "a.npz", "--preview", tmp_path / "a.png"]
    assert run(arguments, capsys)[0] == 0
    assert seen == [is_y_up]


def test_a_checkerboard_has_the_size_that_was_asked_for(model, bowl, tmp_path) -> None:
    bare = PointCloud(bowl.points)
    for size in (16, 100):
        facts = write(model, bare, str(tmp_path / "a.obj"), texture=size)
        assert facts["texture"] == size
        with Image.open(tmp_path / "a.png") as picture:
            assert picture.size == (size, size)


def test_points_that_are_left_out_are_those_of_the_cloud(model, bowl, tmp_path, monkeypatch):
    """The model's counts are of the points drawn, which may be few of a scan's."""
    many = PointCloud(np.repeat(bowl.points, 5, axis=0))
    monkeypatch.setattr(ComputedMap, "report_", {"points": COUNT, "missed": COUNT // 10})
    facts = write(model, many, str(tmp_path / "a.glb"), texture=16)
    assert facts["unmapped_points"] == COUNT // 2
    assert facts["mapped_points"] == 5 * COUNT - COUNT // 2
