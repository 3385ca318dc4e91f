"""Dialects: each format as several writers write it, and the arrays that are meant."""

import base64
import gzip
import json
import struct
from collections.abc import Sequence
from contextvars import copy_context
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from parapoint import console
from parapoint.cli import parapoint
from parapoint.errors import InputError
from parapoint.files.polygons import triangle_rows
from parapoint.files.reading import read_parameterized, read_surface
from parapoint.surfaces.surface import FloatArray, Mesh, PointCloud

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
POINTS = [[1.5, 2.25, -3], [4, 5.5, 6]]


def of_file(folder: Path, name: str, data: bytes | str) -> FloatArray:
    """Vertices or points of a file with these bytes."""
    path = folder / name
    path.write_bytes(data.encode() if isinstance(data, str) else data)
    surface = read_surface(path)
    return surface.vertices if isinstance(surface, Mesh) else surface.points


@pytest.mark.parametrize(
    "data",
    [
        b"\xef\xbb\xbf" + TRIANGLE.encode(),
        TRIANGLE.encode("utf-16"),
        b"\xfe\xff" + TRIANGLE.encode("utf-16-be"),
        TRIANGLE.encode("utf-32"),
        b"\xef\xbb\xbf" + TRIANGLE.replace("\n", "\r\n").encode(),
    ],
)
def test_byte_order_marks_cost_no_vertex(tmp_path: Path, data: bytes) -> None:
    """Windows' editors write them."""
    assert_array_equal(of_file(tmp_path, "a.obj", data), [[0, 0, 0], [1, 0, 0], [0, 1, 0]])


@pytest.mark.parametrize(
    ("data", "tool"),
    [
        (gzip.compress(TRIANGLE.encode(), mtime=0), "gzip"),
        (b"PK\x03\x04rest", "zip"),
        (b"BZh91AY", "bzip2"),
        (b"\x28\xb5\x2f\xfdrest", "zstd"),
        (b"\xfd7zXZ\x00", "xz"),
    ],
)
def test_packed_files_are_refused_by_the_name_of_the_tool(
    tmp_path: Path, data: bytes, tool: str
) -> None:
    """One line says what would do."""
    with pytest.raises(InputError, match=f"is packed by {tool}; unpack it first"):
        of_file(tmp_path, "a.obj", data)


@pytest.mark.parametrize(
    "text",
    [
        "1.5 2.25 -3\n4 5.5 6\n",
        "1.5,2.25,-3\n4,5.5,6\n",
        "1.5, 2.25, -3\n4, 5.5, 6\n",
        "1,5 2,25 -3\n4 5,5 6\n",
        "1,5\t2,25\t-3,0\n4,0\t5,5\t6,0\n",
        "1,5;2,25;-3\n4;5,5;6\n",
        "1,5, 2,25, -3,0\n4,0, 5,5, 6,0\n",
        "x y z\n1.5 2.25 -3\n4 5.5 6\n",
        "X,Y,Z\n1.5,2.25,-3\n4,5.5,6\n",
        "//X Y Z\n1.5 2.25 -3\n4 5.5 6\n",
        "2\n1.5 2.25 -3\n4 5.5 6\n",
        "1\n1.5 2.25 -3\n1\n4 5.5 6\n",
        "1,50e0 2,25 -3\n4 5,5 6\n",
        '"1,5";"2,25";"-3"\n"4,0";"5,5";"6,0"\n',
        "Point_ID X Y Z\n7 1.5 2.25 -3\n9 4 5.5 6\n",
        "z,y,x\n-3,2.25,1.5\n6,5.5,4\n",
        "# intensity x y z\n9 1.5 2.25 -3\n8 4 5.5 6\n",
        "//R;X;Y;Z\n9;1,5;2,25;-3\n8;4,0;5,5;6,0\n",
    ],
)
@pytest.mark.parametrize("ending", [".xyz", ".pts"])
def test_numbers_in_text(tmp_path: Path, text: str, ending: str) -> None:
    """Whatever parts them and marks their decimals, headings and counts left out."""
    assert_allclose(of_file(tmp_path, f"a{ending}", text), POINTS)


@pytest.mark.parametrize(
    ("text", "point"),
    [
        ("1,234.5 2,345.6 3,456.7\n", [1234.5, 2345.6, 3456.7]),
        ("1.234,5 2.345,6 3.456,7\n", [1234.5, 2345.6, 3456.7]),
        ("63,696 21,583 0,041\n", [63.696, 21.583, 0.041]),
        ("1,234,567.5 2,345.25 3,000\n", [1234567.5, 2345.25, 3000]),
        ("1,2,3\n", [1, 2, 3]),
        ("1,234,567 255 0 0\n", [1, 234, 567]),
        ("1,-5,2,0,0,1\n", [1, -5, 2]),
        ("1.0,2.0,3.0 255,0,0\n", [1, 2, 3]),
        ("1,2,3 255 0 0\n", [1, 2, 3]),
    ],
)
def test_commas_that_can_be_told(tmp_path: Path, text: str, point: Sequence[float]) -> None:
    """By what stands beside them."""
    assert_allclose(of_file(tmp_path, "a.xyz", text), [point])


@pytest.mark.parametrize("first", [0, 1])
def test_numbers_of_rows_are_no_coordinates(tmp_path: Path, first: int, caplog: Any) -> None:
    """As total stations write them; a grid whose first column counts is none."""
    points = np.random.default_rng(0).normal(size=(5, 3))
    rows = [f"{k + first} {x} {y} {z}\n" for k, (x, y, z) in enumerate(points)]
    assert_allclose(of_file(tmp_path, "a.xyz", "".join(rows)), points)
    assert "numbers the rows" in caplog.text
    assert_allclose(of_file(tmp_path, "b.xyz", "0 0 5 1\n1 0 5 1\n2 0 5 1\n")[:, 0], [0, 1, 2])


@pytest.mark.parametrize("text", ["1,5,2,5,3,5\n", "1,5,2,5,3,5,7\n", "1,5,2 3,5\n"])
def test_commas_that_cannot_be_told(tmp_path: Path, text: str) -> None:
    """One line, for three numbers or six."""
    with pytest.raises(InputError, match="it cannot be told whether they part numbers"):
        of_file(tmp_path, "a.xyz", text)


def pcd(counts: str, points: str, data: bytes) -> bytes:
    """A PCD file with padding fields, as lidar drivers write it."""
    header = (
        "VERSION .7\nFIELDS x y z _ intensity _\nSIZE 4 4 4 1 4 1\nTYPE F F F U F U\n"
        f"{counts}{points}DATA binary\n"
    )
    return header.encode() + data


@pytest.mark.parametrize("points", ["WIDTH 2\nHEIGHT 2\n", "WIDTH 4\n", "WIDTH 4\nPOINTS 4\n"])
@pytest.mark.parametrize(("counts", "pads"), [((0, 0), 0), ((4, 0), 4), ((0, 3), 3), ((2, 5), 7)])
def test_pcd_padding_and_sizes(
    tmp_path: Path, points: str, counts: tuple[int, int], pads: int
) -> None:
    """A padding field of COUNT 0 takes no room; WIDTH x HEIGHT stand for POINTS."""
    expected = np.arange(12.0).reshape(4, 3)
    rows = [
        row.astype("<f4").tobytes() + bytes(counts[0]) + struct.pack("<f", 7.0) + bytes(counts[1])
        for row in expected
    ]
    assert len(rows[0]) == 16 + pads
    count = f"COUNT 1 1 1 {counts[0]} 1 {counts[1]}\n"
    read = of_file(tmp_path, "a.pcd", pcd(count, points, b"".join(rows)))
    assert_array_equal(read, expected)


RING = [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 1.0), (1.0, 2.0), (0.0, 2.0)]
KEYHOLE = [(0, 0), (4, 0), (4, 4), (0, 4), (0, 0), (1, 1), (1, 3), (3, 3), (3, 1), (1, 1)]
MIDPOINTS = [(0, 0), (1, 0), (2, 0), (2, 1), (2, 2), (1, 2), (0, 2), (0, 1)]
TURNS = 2 * np.pi * np.arange(60) / 60
FLOWER = np.stack([np.cos(TURNS), np.sin(TURNS)], axis=1) * (1 + 0.4 * np.cos(7 * TURNS))[:, None]
COMB = [(0, 0), (11, 0), *((11 - k, 1 if k % 2 else 5) for k in range(12))]


@pytest.mark.parametrize("shape", [RING, KEYHOLE, MIDPOINTS, FLOWER, COMB])
@pytest.mark.parametrize("turn", [0, 1, 4])
@pytest.mark.parametrize("backwards", [False, True])
def test_polygons_are_filled_once(shape: Any, turn: int, backwards: bool) -> None:
    """Every triangle turns as the polygon does, all corners are used, areas add up; any plane."""
    flat = np.roll(np.asarray(shape, dtype=np.float64), turn, axis=0)[:: -1 if backwards else 1]
    axes = np.eye(3)[:2]
    if turn:
        axes = np.linalg.qr(np.random.default_rng(turn).normal(size=(3, 3)))[0][:2]
    corners = flat @ axes + [5.0, -3.0, 1.0]
    rows = triangle_rows(corners, np.array([len(flat)]), np.arange(len(flat)))
    assert rows.shape == (len(flat) - 2, 3)
    assert len(np.unique(rows)) == len(flat)
    a, b, c = flat[rows].transpose(1, 0, 2)
    doubled = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    x, y = flat.T
    whole = float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum())
    assert (doubled * whole > (-1e-9 if turn else 0)).all()
    assert doubled.sum() == pytest.approx(whole)


def test_polygons_that_cross_themselves_are_read(tmp_path: Path) -> None:
    """A pentagram has no right cut; it still has three triangles."""
    star = [(np.cos(2.4 * np.pi * k), np.sin(0.8 * np.pi * k)) for k in range(5)]
    text = "".join(f"v {x} {y} 0\n" for x, y in star) + "f 1 2 3 4 5\n"
    path = tmp_path / "a.obj"
    path.write_text(text)
    surface = read_surface(path)
    assert isinstance(surface, Mesh)
    assert len(surface.faces) == 3


def glb(folder: Path, **changes: Any) -> Path:
    """A glTF triangle with UV, and whatever is changed of its tree."""
    data = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4").tobytes()
    data += np.array([[0, 0], [0.5, 0], [0, 0.5]], "<f4").tobytes()
    uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    tree: dict[str, Any] = {
        "buffers": [{"uri": uri}],
        "bufferViews": [{"buffer": 0}, {"buffer": 0, "byteOffset": 36}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC2"},
        ],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}}]}],
        "nodes": [{"mesh": 0}],
    }
    path = folder / "a.gltf"
    path.write_text(json.dumps(tree | changes))
    return path


def test_gltf_moves_uv_as_the_texture_is_moved(tmp_path: Path) -> None:
    """KHR_texture_transform: scaled, turned, then moved; v upwards as in OBJ."""
    moved = {"offset": [0.25, 0.5], "scale": [2, 4], "rotation": np.pi / 2}
    texture = {"index": 0, "extensions": {"KHR_texture_transform": moved}}
    primitive = {"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "material": 0}
    path = glb(
        tmp_path,
        materials=[{"pbrMetallicRoughness": {"baseColorTexture": texture}}],
        meshes=[{"primitives": [primitive]}],
        extensionsRequired=["KHR_texture_transform", "KHR_materials_unlit"],
    )
    _, found = read_parameterized(path)
    assert_allclose(found.uv[found.corners[0]], [[0.25, 0.5], [0.25, 1.5], [2.25, 0.5]])


@pytest.mark.parametrize(
    ("scale", "turned"), [([1, 1, 1], False), ([-1, 1, 1], True), ([-2, -1, 1], False)]
)
def test_gltf_mirror_images_face_outwards(tmp_path: Path, scale: list[float], turned: bool) -> None:
    """A node of negative scale turns its faces round."""
    mesh = read_surface(glb(tmp_path, nodes=[{"mesh": 0, "scale": scale}]))
    assert isinstance(mesh, Mesh)
    a, b, c = mesh.vertices[mesh.faces[0]]
    assert np.cross(b - a, c - a)[2] > 0
    assert (mesh.faces[0].tolist() == [2, 1, 0]) is turned


def test_gltf_instances_are_copies(tmp_path: Path) -> None:
    """EXT_mesh_gpu_instancing: one copy for each row."""
    shifts = np.array([[0, 0, 0], [5, 0, 0], [0, 7, 0]], "<f4").tobytes()
    path = glb(tmp_path)
    tree = json.loads(path.read_text())
    uri = "data:application/octet-stream;base64," + base64.b64encode(shifts).decode()
    tree["buffers"].append({"uri": uri})
    tree["bufferViews"].append({"buffer": 1})
    tree["accessors"].append({"bufferView": 2, "componentType": 5126, "count": 3, "type": "VEC3"})
    instancing = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 2}}}
    tree["nodes"] = [{"mesh": 0, "extensions": instancing}]
    path.write_text(json.dumps(tree))
    mesh = read_surface(path)
    assert isinstance(mesh, Mesh)
    assert len(mesh.faces) == 3
    assert mesh.vertices.max(axis=0).tolist() == [6, 8, 0]


@pytest.mark.parametrize(
    "name", ["KHR_draco_mesh_compression", "EXT_meshopt_compression", "MY_shapes"]
)
def test_gltf_extensions_that_are_not_read_are_named(tmp_path: Path, name: str) -> None:
    """Where the file cannot do without."""
    with pytest.raises(InputError, match=f"needs {name}, which is not read"):
        read_surface(glb(tmp_path, extensionsRequired=[name]))


def test_gltf_buffers_without_data_are_no_triangles(tmp_path: Path) -> None:
    """Place holders of compressed data."""
    with pytest.raises(InputError, match="a buffer without data"):
        read_surface(glb(tmp_path, buffers=[{"byteLength": 60}]))


def test_las_noise_and_withheld_points_are_left_out(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """With a word that counts them."""
    laspy = pytest.importorskip("laspy")
    cloud = laspy.LasData(laspy.LasHeader(point_format=6, version="1.4"))
    cloud.x = cloud.y = cloud.z = np.arange(6.0)
    cloud.classification = np.array([0, 2, 7, 18, 2, 1], dtype=np.uint8)
    cloud.withheld = np.array([0, 0, 0, 0, 1, 0], dtype=np.uint8)
    for ending in (".las", ".laz"):
        cloud.write(tmp_path / f"a{ending}")
        surface = read_surface(tmp_path / f"a{ending}")
        assert isinstance(surface, PointCloud)
        assert_allclose(surface.points[:, 0], [0, 1, 5])
        assert "3 of 6 points left out" in caplog.text


def test_small_files_that_decode_to_much_are_refused(tmp_path: Path) -> None:
    """Instances of instances: 4,000 million triangles in a few kilobytes."""
    nodes: list[dict[str, Any]] = [{"mesh": 0} for _ in range(700)]
    primitives = [{"attributes": {"POSITION": 0}}] * 900
    path = glb(tmp_path, nodes=nodes, meshes=[{"primitives": primitives}])
    with pytest.raises(InputError, match="bytes that decode to"):
        read_surface(path)


def test_memory_lifts_the_bound_on_what_files_decode_to(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Zeros a thousand times as large as their file."""
    np.savez_compressed(tmp_path / "zeros.npz", points=np.zeros((3_000_000, 3)))
    command = ["unwrap", str(tmp_path / "zeros.npz"), "--out", str(tmp_path / "a.ply")]
    said = []
    for options in ([], ["--memory", "1"], ["--memory", "-1"]):
        with pytest.raises(SystemExit) as end:
            copy_context().run(console.run, parapoint, [*command, *options])
        assert end.value.code == 2
        said.append(capsys.readouterr().err)
    assert "or allow --memory 1 GB" in said[0]
    assert "1 distinct points; a fit needs at least 100" in said[1]
    assert "--memory must be" in said[2]


def test_stl_with_notes_behind_its_triangles(tmp_path: Path) -> None:
    """As some tools append; a text that says solid is a text."""
    triangle = np.array([[0, 0, 1], [0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4").tobytes() + bytes(2)
    data = bytes(80) + struct.pack("<I", 1) + triangle
    for notes in (b"", b"colour=red", bytes(60)):
        assert len(of_file(tmp_path, "a.stl", data + notes)) == 3


@pytest.mark.parametrize(
    ("text", "announced", "found"),
    [
        ("5\n1 2 3\n4 5 6\n", 5, 2),
        ("2\n1 2 3\n4 5 6\n3\n1 2 3\n", 3, 1),
        ("3\n1 2 3\n2\n4 5 6\n4 5 7\n", 3, 1),
        ("2\r\n1,5 2,5 3,5\r\n", 2, 1),
        ("4\n1 2 3 -7 9 9 9\n1 2 4 -7 9 9 9\n1 2 5 -7 9 9 9\n", 4, 3),
    ],
)
def test_a_pts_file_that_ends_early_is_refused(
    tmp_path: Path, text: str, announced: int, found: int
) -> None:
    """One line with both numbers, whichever scan it is."""
    with pytest.raises(InputError, match=f"{announced} points are announced, {found} are there"):
        of_file(tmp_path, "a.pts", text)


@pytest.mark.parametrize("corners", ["1 2 3", "1/1 2/2 3/3", "-3/-3 -2/-2 -1/-1", "1//1 2//2 3//3"])
@pytest.mark.parametrize("key", ["fo ", "fo\t"])
def test_faces_of_the_old_name(tmp_path: Path, corners: str, key: str) -> None:
    """`fo` was a face before 1993."""
    path = tmp_path / "a.obj"
    uv = "vt 0 0\nvt 1 0\nvt 0 1\nvn 0 0 1\n"
    path.write_text(TRIANGLE.replace("f 1 2 3\n", uv + key + corners + "\n" + "f 1 2 3\n"))
    surface = read_surface(path)
    assert isinstance(surface, Mesh)
    assert_array_equal(surface.faces, [[0, 1, 2], [0, 1, 2]])
