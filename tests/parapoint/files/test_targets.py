"""What may be written: the user's files stay, and every fault is found before any work."""

import io
import os
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from parapoint.errors import InputError
from parapoint.files.targets import (
    beside,
    checked_picture,
    checked_target,
    complete_file,
    is_ours,
    sealed_png,
    sealed_text,
)

SIDES = (".mtl", ".png")


def png() -> bytes:
    """The bytes of a small picture."""
    file = io.BytesIO()
    Image.fromarray(np.arange(48, dtype=np.uint8).reshape(4, 4, 3)).save(file, "png")
    return file.getvalue()


def test_a_new_name_and_an_older_output_are_free(tmp_path: Path) -> None:
    """What `--out` names may be replaced, whatever it holds; nothing is left behind."""
    out = tmp_path / "out.obj"
    assert checked_target(out, sides=SIDES) == out
    out.write_bytes(b"of the user")
    assert checked_target(out, sides=SIDES) == out
    assert [path.name for path in tmp_path.iterdir()] == ["out.obj"]


@pytest.mark.parametrize("ending", SIDES)
def test_sides_of_the_user_stay(tmp_path: Path, ending: str) -> None:
    """A texture or material that we did not write is named, unless --force."""
    (tmp_path / f"out{ending}").write_bytes(b"of the user")
    with pytest.raises(InputError, match=rf"out\{ending}: is a file of yours"):
        checked_target(tmp_path / "out.obj", sides=SIDES)
    checked_target(tmp_path / "out.obj", sides=SIDES, force=True)


def test_sides_of_ours_are_replaced_until_somebody_changes_them(tmp_path: Path) -> None:
    """The seal tells a file as we wrote it from one that was edited or cut."""
    for ending, data in (".mtl", sealed_text("newmtl map\n")), (".png", sealed_png(png())):
        side = tmp_path / f"out{ending}"
        side.write_bytes(data)
        assert is_ours(side)
        checked_target(tmp_path / "out.obj", sides=SIDES)
        for changed in (data[:20] + b"!" + data[21:], data[:-60], data + b"more\n" * 20):
            side.write_bytes(changed)
            assert not is_ours(side)
        side.unlink()


def test_a_sealed_picture_is_the_same_picture() -> None:
    """Every PNG reader still reads it, its checksums included."""
    with Image.open(io.BytesIO(sealed_png(png()))) as picture:
        picture.load()
        assert np.asarray(picture).reshape(-1).tolist() == list(range(48))
        assert str(picture.text["Comment"]).startswith("ParaPoint wrote this: ")  # type: ignore[attr-defined]  # of PNG pictures alone
    with pytest.raises(ValueError, match="IEND"):
        sealed_png(b"no picture")


@pytest.mark.parametrize("kind", ["itself", "hard link", "symbolic link", "through a folder"])
def test_an_input_is_never_replaced(tmp_path: Path, kind: str) -> None:
    """By whatever name it goes."""
    given = tmp_path / "in.obj"
    given.write_bytes(b"v 0 0 0\n")
    out = tmp_path / "out.obj"
    if kind == "itself":
        out = given
    elif kind == "hard link":
        os.link(given, out)
    elif kind == "symbolic link":
        out.symlink_to(given)
    else:
        (tmp_path / "folder").symlink_to(tmp_path)
        out = tmp_path / "folder" / "in.obj"
    with pytest.raises(InputError, match="is the input"):
        checked_target(out, inputs=[given])
    checked_target(out, inputs=[given], force=True)


def test_an_input_beside_the_output_is_never_replaced(tmp_path: Path) -> None:
    """Even where it carries our seal."""
    (tmp_path / "out.mtl").write_bytes(sealed_text(""))
    with pytest.raises(InputError, match="is the input"):
        checked_target(tmp_path / "out.obj", sides=SIDES, inputs=[tmp_path / "out.mtl"])


MODELS = {
    "obj": ("in.obj", b"mtllib it.mtl\nv 0 0 0\n"),
    "ply": ("in.ply", b"ply\nformat ascii 1.0\ncomment TextureFile it.png\nend_header\n"),
    "gltf": ("in.gltf", b'{"meshes": [{}], "images": [{"uri": "it.png"}]}'),
}
"""Models, each by its name and bytes, that name a picture."""


@pytest.mark.parametrize("kind", MODELS)
def test_what_an_input_names_is_never_replaced(tmp_path: Path, kind: str) -> None:
    """As a picture, and beside a mesh, even where it carries our seal."""
    name, data = MODELS[kind]
    (tmp_path / name).write_bytes(data)
    (tmp_path / "it.mtl").write_bytes(sealed_text("newmtl a\nmap_Bump -bm 0.5 it.png\n"))
    (tmp_path / "it.png").write_bytes(sealed_png(png()))
    inputs = [tmp_path / name]
    for checked in (
        lambda **of: checked_picture(tmp_path / "it.png", inputs=inputs, **of),
        lambda **of: checked_target(tmp_path / "it.glb", sides=(".png",), inputs=inputs, **of),
    ):
        with pytest.raises(InputError, match=rf"it\.png: is named by .*{name}"):
            checked()
        checked(force=True)
    checked_picture(tmp_path / "it.png", inputs=[tmp_path / "it.png.xyz"])


def test_a_picture_beside_the_output_replaces_one_of_ours_alone(tmp_path: Path) -> None:
    """One that `--out` itself names replaces any."""
    path = tmp_path / "seen.png"
    for data in (b"of the user", sealed_png(png())):
        path.write_bytes(data)
        checked_picture(path)
        checked_picture(path, is_side=True, force=True)
        if data != b"of the user":
            checked_picture(path, is_side=True)
            continue
        with pytest.raises(InputError, match=r"seen\.png: is a file of yours"):
            checked_picture(path, is_side=True)


@pytest.mark.parametrize("force", [False, True])
@pytest.mark.parametrize("name", ["out.obj", "out.mtl"])
def test_a_write_protected_file_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, force: bool
) -> None:
    """Also with --force; root, who may write everything, sees what others do."""
    (tmp_path / name).write_bytes(sealed_text(""))
    (tmp_path / name).chmod(0o444)
    monkeypatch.setattr(os, "access", lambda path, _: bool(path.stat().st_mode & 0o200))
    with pytest.raises(InputError, match=rf"{name}: is write-protected"):
        checked_target(tmp_path / "out.obj", sides=SIDES, force=force)


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such modes")
def test_a_file_that_is_replaced_keeps_its_mode(tmp_path: Path) -> None:
    """A new one gets that of all new files."""
    for name, mode in (("kept", 0o640), ("new", None)):
        path = tmp_path / name
        if mode is not None:
            path.touch()
            path.chmod(mode)
        with complete_file(path) as file:
            file.write(b"v")
        (tmp_path / "other").touch()
        expected = mode or (tmp_path / "other").stat().st_mode & 0o777
        assert path.stat().st_mode & 0o777 == expected


def test_a_link_is_followed_and_said(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """What is written is the file it points to; one to a side is a file of the user's."""
    (tmp_path / "far").mkdir()
    (tmp_path / "out.obj").symlink_to(tmp_path / "far" / "real.obj")
    assert checked_target(tmp_path / "out.obj") == tmp_path / "far" / "real.obj"
    assert "is a link" in caplog.text
    (tmp_path / "in.png").write_bytes(sealed_png(png()))
    (tmp_path / "b.png").symlink_to(tmp_path / "in.png")
    with pytest.raises(InputError, match="of yours"):
        checked_target(tmp_path / "b.obj", sides=SIDES)


@pytest.mark.parametrize(
    ("name", "fault"),
    [
        ("none/out.obj", "no such folder"),
        ("folder", "not a file"),
        ("n" * 300 + ".obj", "cannot be written: File name too long"),
        ("loop.obj", "cannot be written"),
        ("a\0b.obj", "cannot be written"),
        ("file/out.obj", "no such folder"),
    ],
)
def test_what_cannot_be_written_is_said(tmp_path: Path, name: str, fault: str) -> None:
    """In one line, before any work."""
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").touch()
    (tmp_path / "loop.obj").symlink_to(tmp_path / "loop.obj")
    with pytest.raises(InputError, match=fault):
        checked_target(tmp_path / name)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_without_leave_is_said(tmp_path: Path) -> None:
    """Found by trying."""
    tmp_path.chmod(0o500)
    with pytest.raises(InputError, match="Permission denied"):
        checked_target(tmp_path / "out.obj")
    tmp_path.chmod(0o700)


def test_long_names_are_written(tmp_path: Path) -> None:
    """A name as long as the file system takes needs no more room than that."""
    path = checked_target(tmp_path / ("n" * 251 + ".obj"))
    with complete_file(path) as file:
        file.write(b"v")
    assert path.read_bytes() == b"v"


def test_half_a_file_is_never_seen(tmp_path: Path) -> None:
    """A fault while writing leaves what was there."""
    path = tmp_path / "out.obj"
    path.write_bytes(b"before")
    with pytest.raises(TypeError), complete_file(path) as file:
        file.writelines([b"half", None])  # type: ignore[list-item]
    assert [(item.name, item.read_bytes()) for item in tmp_path.iterdir()] == [
        ("out.obj", b"before")
    ]


def test_side_names_suit_an_obj_file() -> None:
    """A blank would end the name in mtllib, a # begin a comment."""
    assert beside(Path("d/my big #1.obj"), ".mtl") == Path("d/my_big__1.mtl")
