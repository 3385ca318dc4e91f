"""What is a fault of a file, and what is a bug of ours."""

import numpy as np
import pytest

from parapoint import InputError
from parapoint.files import reading

CORNERS = np.eye(3)
FACES = np.array([[0, 1, 2], [0, 2, 1]])
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


@pytest.mark.parametrize(
    ("arrays", "names"),
    [
        ({"uv": CORNERS}, "UVs of shape (3, 3)"),
        ({"uv": np.array(["a", "b"])}, "UVs of shape (2,)"),
        ({"uv": np.array(3.0)}, "UVs of shape ()"),
        ({"uv": CORNERS[:, :2] * 1j}, "complex"),
        ({"uv": CORNERS[:, :2], "corners": FACES[:1]}, "UVs of corners of shape (3,)"),
    ],
)
def test_uvs_that_do_not_fit_their_mesh_are_refused(tmp_path, arrays, names):
    path = tmp_path / "map.npz"
    np.savez(path, vertices=CORNERS, faces=FACES, **arrays)
    with pytest.raises(InputError, match="do not fit its 3 vertices and 2 faces") as caught:
        reading.read_parameterized(path)
    assert str(caught.value).startswith(f"{path}: has ")
    assert names in str(caught.value)


@pytest.mark.parametrize("normals", [CORNERS[:1], CORNERS[:, :2], np.array("x"), [["a"] * 3] * 3])
def test_normals_that_do_not_fit_their_points_are_refused(tmp_path, normals):
    path = tmp_path / "cloud.npz"
    np.savez(path, points=CORNERS, normals=normals)
    with pytest.raises(InputError, match="has normals of shape"):
        reading.read_surface(path)


def test_what_a_library_raises_on_bad_bytes_is_a_fault_of_the_file(tmp_path, monkeypatch):
    path = tmp_path / "a.obj"
    path.write_text(TRIANGLE)
    for error in reading.UNREADABLE:

        def fails(*_, error=error):
            raise error("no such number")

        monkeypatch.setitem(reading.FORMATS, ".obj", fails)
        with pytest.raises(InputError, match=r"a\.obj: is no OBJ file that can be read \(no such"):
            reading.read_surface(path)


def test_a_bug_is_not_dressed_up_as_a_bad_file(tmp_path, monkeypatch):
    """What goes wrong after a file was read, or is no error of a parser, shows itself."""
    path = tmp_path / "a.obj"
    path.write_text(TRIANGLE)

    def broken(*_):
        raise ValueError("ours")

    with monkeypatch.context() as patch:
        patch.setattr(reading, "triangle_rows", broken)
        with pytest.raises(ValueError, match=r"^ours$"):
            reading.read_surface(path)

    def asserts(*_):
        raise AssertionError("ours")

    monkeypatch.setitem(reading.FORMATS, ".obj", asserts)
    with pytest.raises(AssertionError, match=r"^ours$"):
        reading.read_surface(path)
