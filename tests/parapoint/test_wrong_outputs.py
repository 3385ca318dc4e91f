"""What no command can or may write is said in one line, before anything is read."""

import contextlib
from pathlib import Path

import numpy as np
import pytest

from parapoint import cli
from parapoint.testing import irregular_disk

UNWRAP, MESH = ["unwrap", "scan.xyz"], ["unwrap", "mesh.obj"]
FIT, MAP = ["fit", "scan.xyz"], ["map", "model", "scan.xyz"]
BAKE = ["bake", "mesh.obj", "scan.xyz", "--map", "colour"]
READERS = ("unwrap.read_polygons", "fit.read_surface", "map.read_surface")
READERS += ("bake.point_pieces", "bake.read_parameterized")

CASES = [
    *(
        (arguments, f"error: {name} is an empty name; name a file or a folder")
        for arguments, name in (
            (["unwrap", "", "--out", "a.obj"], "INPUT"),
            (["fit", "", "--out", "a"], "INPUT"),
            (["map", "", "scan.xyz", "--out", "a.obj"], "DIR"),
            (["bake", "mesh.obj", "", "--map", "colour", "--out", "a.png"], "CLOUD"),
            *(([*command, "--out", ""], "--out") for command in (UNWRAP, FIT, MAP, BAKE)),
            ([*MESH, "--out", "a.obj", "--preview", ""], "--preview"),
            ([*MESH, "--out", "a.obj", "--seams", ""], "--seams"),
        )
    ),
    *(
        ([*command, "--out", out], message)
        for command, good in ((UNWRAP, ".glb"), (MESH, ".obj"), (MAP, ".ply"), (BAKE, ".png"))
        for out, message in (
            ("a.fbx", "ending" if good != ".png" else "ends in .png"),
            ("a", "ending" if good != ".png" else "ends in .png"),
            (f"no/a{good}", "there is no such folder"),
            (f"locked/a{good}", "cannot be written: permission denied"),
            (f"folder{good}", "is a folder"),
        )
    ),
    (["fit", "scan.xyz", "--out", "scan.xyz"], "is a file; name a folder"),
    ([*FIT, "--out", "scan.xyz/model"], "is a file; name a folder"),
    ([*FIT, "--out", "locked"], "error: locked: cannot be written: permission denied"),
    ([*FIT, "--out", "locked/deep/model"], "locked: cannot be written: permission denied"),
    ([*FIT, "--out", "theirs"], "is in the way and not ours"),
    ([*MESH, "--out", "mesh.obj"], "is the input"),
    (["map", "model", "mesh.obj", "--out", "mesh.obj"], "is the input"),
    (["map", "model", "mesh.obj", "--out", "link.obj"], "is the input"),
    (["bake", "old.png", "scan.xyz", "--map", "colour", "--out", "old.png"], "is the input"),
    *(
        ([*command, "--out", "mine.obj"], "mine.png: is a file of yours")
        for command in (UNWRAP, MESH, MAP)
    ),
    *(
        ([*command, "--out", f"a{ending}", "--texture", size], "--texture must be from 16 to 8192")
        for command, ending in ((UNWRAP, ".glb"), (MESH, ".glb"), (BAKE, ".png"))
        for size in ("0", "-1", "15", "100000")
    ),
    *(
        ([*command, "--out", f"a{ending}", "--margin", "9999"], "--margin must be from 0 to")
        for command, ending in ((UNWRAP, ".glb"), (MESH, ".glb"), (BAKE, ".png"))
    ),
]


@pytest.mark.parametrize(("arguments", "message"), CASES)
def test_what_cannot_be_written_is_said_first(
    arguments, message, tmp_path, monkeypatch, capsys
) -> None:
    def too_early(*_):
        pytest.fail("a file was read")

    def touch(self, *arguments, **options) -> None:
        if self.parent.name == "locked":
            raise PermissionError(13, "permission denied")
        original(self, *arguments, **options)

    original = Path.touch
    np.savetxt(tmp_path / "scan.xyz", np.random.default_rng(0).normal(size=(200, 3)))
    mesh = irregular_disk()
    lines = [f"v {x} {y} {z}" for x, y, z in mesh.vertices]
    lines += [f"f {a} {b} {c}" for a, b, c in mesh.faces + 1]
    (tmp_path / "mesh.obj").write_text("\n".join(lines))
    (tmp_path / "link.obj").symlink_to("mesh.obj")
    for name in ("mine.png", "old.png"):
        (tmp_path / name).write_bytes(b"a picture of my own")
    for ending in (".glb", ".obj", ".ply", ".png"):
        (tmp_path / f"folder{ending}").mkdir()
    for name in ("locked", "model", "theirs"):
        (tmp_path / name).mkdir()
    (tmp_path / "theirs" / "model.json").write_text("{}")
    for reader in READERS:
        monkeypatch.setattr(f"parapoint.commands.{reader}", too_early)
    monkeypatch.setattr(Path, "touch", touch)
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    with contextlib.chdir(tmp_path), pytest.raises(SystemExit) as end:
        cli.console.run(cli.parapoint, arguments)
    shown = capsys.readouterr()
    assert (end.value.code, shown.out) == (2, "")
    assert message in shown.err.lower() if message.islower() else message in shown.err
    assert shown.err.count("\n") == 1
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before
