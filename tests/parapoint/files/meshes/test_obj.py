"""OBJ: comments and lines that go on, colours and normals of points, and files that are none."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from parapoint.errors import InputError
from parapoint.files.meshes.obj import obj_lines
from parapoint.files.reading import read_polygons, read_surface
from parapoint.surfaces.surface import Mesh, PointCloud

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
FACE = "f 1 2 3 4\n"
RGB = np.array([[255, 0, 0], [0, 128, 0], [1, 2, 3], [9, 8, 7]], dtype=np.uint8)


def saved(folder: Path, data: str | bytes) -> Path:
    path = folder / "a.obj"
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    return path


def cloud_of(folder: Path, data: str) -> PointCloud:
    surface = read_surface(saved(folder, data))
    assert isinstance(surface, PointCloud)
    return surface


def with_columns(columns: np.ndarray, *, count: int = 4) -> str:
    """The corners of the square, the first `count` of them with these numbers behind."""
    lines = SQUARE.splitlines()
    ends = [" ".join(map(str, row)) for row in columns.tolist()[:count]] + [""] * (4 - count)
    return "".join(f"{line} {end}\n" for line, end in zip(lines, ends, strict=True))


@pytest.mark.parametrize(
    "text",
    [
        "# from C:\\models\\\n" + SQUARE + FACE,
        SQUARE + "# C:\\temp\\\n" + FACE,
        SQUARE + "g C:\\temp\\\n" + FACE,
        "o all\\ \t\n" + SQUARE + "usemtl a\\\n" + FACE,
        SQUARE.replace("v 1 1", "# a \\ b\nv 1 \\\n1") + "f 1 2 3 4 # these \\\n# all",
        SQUARE + "f 1 2 \\ \n3 \\\t\n4\n",
        SQUARE + "f 1 2 \\ # the rest\n3 4\n",
        SQUARE + "f 1 2 3 4 \\\n" + SQUARE,
        SQUARE + "f 1 2 3 4 \\",
        SQUARE + "f\nf # none\n" + FACE,
    ],
)
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_only_lines_that_end_in_a_backslash_go_on(text: str, end: str, tmp_path: Path) -> None:
    """No comment does, and no line before a vertex or a face."""
    mesh = read_surface(saved(tmp_path, text.replace("\n", end)))
    assert isinstance(mesh, Mesh)
    assert_array_equal(mesh.vertices[:4], [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    assert_array_equal(mesh.faces, [[0, 1, 2], [0, 2, 3]])


def test_comments_stay_in_lines() -> None:
    """A writer copies them."""
    data = b"# a\\\nv 1 \\\n 2 3 # b\\\ng c d\\\r\n e\n"
    assert obj_lines(data) == [b"# a\\", b"v 1   2 3 # b\\", b"g c d  e"]


@pytest.mark.parametrize("face", ["", FACE])
@pytest.mark.parametrize("columns", [RGB, np.column_stack([RGB, [255, 0, 1, 2]]), RGB / 255])
def test_colours_stand_behind_coordinates(face: str, columns: np.ndarray, tmp_path: Path) -> None:
    """Of points and of vertices, from 0 to 255 or from 0 to 1, with alpha or without."""
    found = read_polygons(saved(tmp_path, with_columns(columns) + face))
    colours = found.attributes["colours"] if isinstance(found, PointCloud) else found.colours
    assert colours is not None
    assert_allclose(colours, columns)
    assert colours.dtype == (np.uint8 if columns.max() > 1 else np.float64)


def test_a_weight_is_no_colour(tmp_path: Path) -> None:
    assert not cloud_of(tmp_path, with_columns(np.ones((4, 1)))).attributes


@pytest.mark.parametrize(("columns", "count"), [(RGB, 3), (np.column_stack([RGB, RGB]), 4)])
def test_colours_that_are_left_out_are_told(
    columns: np.ndarray, count: int, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Where some vertices have none, or more numbers stand there."""
    assert not cloud_of(tmp_path, with_columns(columns, count=count)).attributes
    assert "colours of vertices are left out" in caplog.text


def test_points_have_the_normals_of_their_order(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """If there is one for each; those of a mesh belong to its corners."""
    normals = "vn 0 0 1\nvn\t0 1 0\nvn 1 0 0\nvn 0 0 -1\n"
    cloud = cloud_of(tmp_path, SQUARE + normals)
    assert_array_equal(cloud.normals, [[0, 0, 1], [0, 1, 0], [1, 0, 0], [0, 0, -1]])
    assert not caplog.text
    for broken in (normals[9:], normals.replace("1 0 0", "1 0"), normals + "vn 0 0 1\n"):
        assert cloud_of(tmp_path, SQUARE + broken).normals is None
        assert "normals are left out: not each of 4 points has a vn line" in caplog.text
        caplog.clear()


@pytest.mark.parametrize(
    ("data", "says"),
    [
        ((SQUARE + FACE).upper(), "keywords are in upper case; write v, vt and f"),
        ((SQUARE + FACE).encode("utf-16-le"), "UTF-16 without a byte order mark; save it in UTF-8"),
        ((SQUARE + FACE).encode("utf-16-be"), "UTF-16 without a byte order mark; save it in UTF-8"),
        ("ply\nformat ascii 1.0\n", "the file begins with 'ply'"),
        ("<!DOCTYPE html>\n<p>v 1</p>", "the file begins with '<!DOCTYPE'"),
        (FACE, "the file begins with 'f'"),
    ],
)
def test_files_without_a_point_say_why(data: str | bytes, says: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="has no point: ") as caught:
        read_surface(saved(tmp_path, data))
    assert says in str(caught.value)


def test_lines_alone_are_no_cloud(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"lines, curves .* and no face; export it as a mesh"):
        read_surface(saved(tmp_path, SQUARE + "l 1 2 3 4\n"))
    cloud_of(tmp_path, SQUARE + "p 1 2 3 4\n")
