"""OFF and STL as programs write them: all kinds and layouts, and what is cut off or miscounted."""

import struct

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from parapoint import InputError, Mesh, PointCloud
from parapoint.files.reading import read_polygons, read_surface

SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
NORMALS = np.array([[0.0, 0.6, 0.8], [0, 0, -1], [1, 0, 0], [0, 1, 0]])
COLOURS = np.array([[255, 0, 0], [0, 128, 0], [1, 2, 3], [9, 8, 7]])
ALPHA = np.array([[255], [200], [100], [0]])
UV = np.array([[0.25, 0.5]] * 4)


def off(kind: str, *columns: np.ndarray, faces: str = "4 0 1 2 3\n") -> str:
    rows = np.hstack([SQUARE, *columns]).tolist()
    text = "".join(" ".join(f"{value:g}" for value in row) + "\n" for row in rows)
    return f"{kind}\n4 {faces.count(chr(10))} 0\n{text}{faces}"


@pytest.mark.parametrize("faces", ["", "4 0 1 2 3\n", "3 0 1 2 0.5 0.5 0.5\n3 0 2 3 7\n"])
@pytest.mark.parametrize(
    ("kind", "columns", "expected"),
    [
        ("COFF", (COLOURS,), COLOURS),
        ("coff", (COLOURS, ALPHA), np.hstack([COLOURS, ALPHA])),
        ("COFF", (COLOURS / 255,), COLOURS / 255),
        ("COFF", (np.hstack([COLOURS, ALPHA]) / 255,), np.hstack([COLOURS, ALPHA]) / 255),
        ("CNOFF", (NORMALS, COLOURS, ALPHA), np.hstack([COLOURS, ALPHA])),
        ("NCOFF", (NORMALS, COLOURS, ALPHA), np.hstack([COLOURS, ALPHA])),
        ("NCOFF", (COLOURS, ALPHA, NORMALS), np.hstack([COLOURS, ALPHA])),
        ("NCOFF", (COLOURS, NORMALS), COLOURS),
        ("STCNOFF", (NORMALS, COLOURS, UV), COLOURS),
        ("NCSTOFF", (COLOURS, ALPHA, NORMALS, UV), np.hstack([COLOURS, ALPHA])),
        ("NSTOFF", (NORMALS, UV), None),
        ("NOFF", (NORMALS,), None),
        ("STOFF", (UV,), None),
        ("OFF", (), None),
    ],
)
def test_off_of_all_kinds(kind, columns, expected, faces, tmp_path):
    (tmp_path / "a.off").write_text(off(kind, *columns, faces=faces))
    given = read_polygons(tmp_path / "a.off")
    if isinstance(given, PointCloud):
        assert_array_equal(given.points, SQUARE)
        assert (given.normals is not None) == ("N" in kind)
        if given.normals is not None:
            assert_array_equal(given.normals, NORMALS)
        colours = given.attributes.get("colours")
    else:
        assert_array_equal(given.mesh.vertices, SQUARE)
        colours = given.colours
    if expected is None:
        assert colours is None
    else:
        assert_allclose(colours, expected, atol=1e-5)


@pytest.mark.parametrize(
    ("kind", "columns"),
    [("OFF", (COLOURS,)), ("COFF", (ALPHA,)), ("NOFF", (NORMALS, UV)), ("NCOFF", (COLOURS,))],
)
def test_numbers_that_are_not_of_the_kind_are_told(kind, columns, tmp_path, caplog):
    (tmp_path / "a.off").write_text(off(kind, *columns))
    given = read_polygons(tmp_path / "a.off")
    assert given.colours is None
    assert f"left out: they do not fit the kind {kind}" in caplog.text


@pytest.mark.parametrize("kind", ["OFF", "COFF", "NOFF", "STCNOFF"])
@pytest.mark.parametrize("words", [1, 2, 5, 1000])
def test_off_in_free_layout(kind, words, tmp_path):
    behind = [NORMALS] if "N" in kind else []
    behind += [COLOURS, ALPHA] if "C" in kind else []
    behind += [UV] if "ST" in kind else []
    first, counts, *rest = off(kind, *behind, faces="3 0 1 2\n3 0 2 3\n").splitlines()
    run = " ".join(rest).split()
    lines = [" ".join(run[k : k + words]) for k in range(0, len(run), words)]
    text = "\n".join([f"{first} {counts}", *lines] if words < 1000 else [first, counts, *lines])
    (tmp_path / "a.off").write_text(text)
    given = read_polygons(tmp_path / "a.off")
    assert_array_equal(given.mesh.vertices, SQUARE)
    assert_array_equal(given.mesh.faces, [[0, 1, 2], [0, 2, 3]])
    assert (given.colours is not None) == ("C" in kind)
    (tmp_path / "a.off").write_text(text + " 7")
    with pytest.raises(InputError, match=r"ends early|coordinates|corners"):
        read_surface(tmp_path / "a.off")


@pytest.mark.parametrize("kind", ["4OFF", "nOFF", "C4OFF", "XOFF"])
def test_off_of_other_dimensions_is_refused(kind, tmp_path):
    (tmp_path / "a.off").write_text(off(kind))
    with pytest.raises(InputError, match="no kind of OFF that has three coordinates"):
        read_surface(tmp_path / "a.off")


def test_lines_behind_the_faces_of_off_are_told(tmp_path, caplog):
    (tmp_path / "a.off").write_text(off("OFF", faces="3 0 1 2\n") + "3 0 2 3\n1 2 3\n")
    assert isinstance(read_surface(tmp_path / "a.off"), Mesh)
    assert "lines behind the last face left out: 2" in caplog.text


TRIANGLES = SQUARE[[[0, 1, 2], [0, 2, 3]]]


def binary_stl(announced: int) -> bytes:
    rows = (struct.pack("<12fH", 0, 0, 1, *corners.ravel(), 0) for corners in TRIANGLES)
    return b"solid by name".ljust(80) + struct.pack("<I", announced) + b"".join(rows)


def text_stl() -> str:
    lines = ["solid a facet of my vertex"]
    for corners in TRIANGLES:
        lines += ["facet normal 0.0 0.0 1.0", "outer loop"]
        lines += [" vertex " + " ".join(map(str, corner)) for corner in corners.tolist()]
        lines += ["endloop", "endfacet"]
    return "\n".join([*lines, "endsolid a facet of my vertex", ""])


@pytest.mark.parametrize(
    "data",
    [
        binary_stl(2),
        text_stl().encode(),
        text_stl().upper().encode(),
        text_stl().replace("\n", "\r\n").encode(),
        text_stl().replace("\n", "\r").encode(),
        text_stl().replace("1.0", "1.0D+00").encode(),
        text_stl().replace("1.0", "0.1d01").encode(),
        text_stl().replace(" ", "\t").encode(),
        text_stl().replace("\n vertex", " vertex").encode(),
        ("; made by hand\n" + text_stl().replace("outer", "color 1 0 0\nouter")).encode(),
        text_stl().replace("endfacet", "endfacet\nendsolid\nsolid", 1).encode(),
    ],
)
def test_stl_of_all_spellings(data, tmp_path):
    (tmp_path / "a.stl").write_bytes(data)
    mesh = read_surface(tmp_path / "a.stl")
    assert isinstance(mesh, Mesh)
    assert_array_equal(mesh.vertices, SQUARE)
    assert_array_equal(mesh.faces, [[0, 1, 2], [0, 2, 3]])


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (binary_stl(3), "announces 3 triangles, and has room for 2"),
        (binary_stl(0), "announces 0 triangles, and has room for 2"),
        (binary_stl(2**32 - 1), "announces 4294967295 triangles, and has room for 2"),
        (binary_stl(2)[:-1], "announces 2 triangles, and has room for 1"),
        (binary_stl(2)[:84], "announces 2 triangles, and has room for 0"),
        (binary_stl(0)[:84], "has no triangle"),
        (binary_stl(0)[:83], "has no triangle"),
        (b"solid a\nendsolid a\n", "has no triangle"),
        (text_stl().rsplit("endsolid", 1)[0].encode(), "ends early: no 'endsolid'"),
        (text_stl().encode()[:-60], "ends early: no 'endsolid'"),
        (text_stl().encode()[:-90], "ends early: no 'endsolid'"),
        (text_stl().encode()[:170], "ends early: no 'endsolid'"),
        (text_stl().replace(" vertex 1.0 1.0 0.0\n", "", 1).encode(), "15 coordinates in 2"),
        (text_stl().replace("endloop", "vertex 1 1 1\nendloop", 1).encode(), "21 coordinates"),
        (text_stl().replace("1.0 1.0", "1,0 1,0").encode(), "could not convert string to float"),
        (text_stl().replace("vertex 1.0 1.0 0.0", "vertex 1.0 1.0").encode(), "could not convert"),
    ],
)
def test_stl_that_is_cut_off_or_miscounted_says_so(data, says, tmp_path):
    (tmp_path / "a.stl").write_bytes(data)
    with pytest.raises(InputError, match=says):
        read_surface(tmp_path / "a.stl")


def test_what_is_behind_the_triangles_of_stl_is_told(tmp_path, caplog):
    (tmp_path / "a.stl").write_bytes(binary_stl(1))
    mesh = read_surface(tmp_path / "a.stl")
    assert isinstance(mesh, Mesh)
    assert len(mesh.faces) == 1
    assert "bytes behind the last triangle left out: 50" in caplog.text
