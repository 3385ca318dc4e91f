"""Dialects of modellers, sculptors, CAD programs and surveyors, and the arrays that are meant."""

import base64
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from parapoint.errors import InputError
from parapoint.files.reading import read_surface
from parapoint.files.writing.point_writers import write_points
from parapoint.surfaces.surface import FloatArray, Mesh, PointCloud

POINTS = [[1.5, 2.25, -3], [4, 5.5, 6]]
SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
CORNERS = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
UVS = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"


def of_file(folder: Path, name: str, data: bytes | str) -> FloatArray:
    """Vertices or points of a file with these bytes."""
    path = folder / name
    path.write_bytes(data.encode() if isinstance(data, str) else data)
    surface = read_surface(path)
    return surface.vertices if isinstance(surface, Mesh) else surface.points


@pytest.mark.parametrize(
    "text",
    [
        CORNERS + "f -4 -3 -2 -1\n",
        CORNERS.replace("\n", " 1.0\n") + "f 1 2 3 4\n",
        CORNERS.replace("\n", " 0.1 0.2 0.3\n") + "f 1 2 3 4\n",
        CORNERS.replace("\n", " # c\n") + "f 1 2 \\\n3 \\\n 4 # quad\n",
        (CORNERS + "f 1 2 3 4").replace("\n", "\r\n").replace(" ", "\t"),
        (CORNERS + "f 1 2 3 4").replace("\n", "\r"),
        CORNERS + UVS + "vn 0 0 1\nf 1//1 2//1 3//1 4//1\n",
        CORNERS + UVS + "l 1 2 3\np 1 2\nf 1/1/ 2/2/ 3/3/ 4/4/\n",
        "mtllib a b.mtl\no a\nusemtl x#1\ns off\n" + CORNERS + "#MRGB ffffff\nf 1 2 3 4\n",
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nf -3 -2 -1\nv 0 1 0\nf 1 -2 -1\n",
    ],
)
def test_obj_of_other_writers(tmp_path: Path, text: str) -> None:
    """A square, as modellers and sculptors write it."""
    (tmp_path / "a.obj").write_bytes(text.encode())
    mesh = read_surface(tmp_path / "a.obj")
    assert isinstance(mesh, Mesh)
    assert_array_equal(mesh.vertices, SQUARE)
    assert mesh.face_areas.sum() == 1


@pytest.mark.parametrize("line", ["surf 0 1 0 1 1 2 3 4", "curv 0 1 1 2 3 4", "curv2 1 2 3"])
def test_control_points_are_no_cloud(tmp_path: Path, line: str) -> None:
    """Curves and free-form surfaces, as CAD programs write them, are refused by name."""
    with pytest.raises(InputError, match="free-form surfaces and no face; export it as a mesh"):
        of_file(tmp_path, "a.obj", CORNERS + f"cstype bspline\ndeg 1 1\n{line}\nend\n")


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("count", ["uchar B", "uint I", "ushort H"])
@pytest.mark.parametrize("index", ["uchar B", "short h", "ushort H", "int i", "uint I", "int64 q"])
def test_ply_of_any_types_in_any_order(tmp_path: Path, order: str, count: str, index: str) -> None:
    """Coordinates between other columns, lists of any whole numbers, comments that mislead."""
    kind = "little" if order == "<" else "big"
    (count, count_code), (index, code) = count.split(), index.split()
    header = (
        f"ply\nformat binary_{kind}_endian 1.0\ncomment end_header comes later\nobj_info x\n"
        "element vertex 4\nproperty double z\nproperty uchar red\nproperty float x\n"
        f"property float y\nelement face 1\nproperty list {count} {index} vertex_index\n"
        "end_header\n"
    )
    body = b"".join(struct.pack(order + "dBff", z, 7, x, y) for x, y, z in SQUARE)
    body += struct.pack(order + count_code, 4) + struct.pack(order + 4 * code, 0, 1, 2, 3)
    assert_array_equal(of_file(tmp_path, "a.ply", header.encode() + body), SQUARE)


@pytest.mark.parametrize(
    "heading",
    [
        "//X Y Z Scalar_field_1",
        "X Y Z Scalar_0",
        "X [m] Y [m] Z [m] I",
        "x(m) y(m) z(m) c1",
        "x y z i\nm m m 1/1",
        "Easting Northing Elevation Code2",
        "# written by hand\nx y z col4",
    ],
)
def test_headings_of_other_writers(tmp_path: Path, heading: str) -> None:
    """With digits, units, and the words of surveyors."""
    text = heading + "\n1.5 2.25 -3 0.5\n4 5.5 6 0.25\n"
    assert_allclose(of_file(tmp_path, "a.xyz", text), POINTS)
    assert_allclose(of_file(tmp_path, "b.xyz", text.replace(" ", ",")), POINTS)


@pytest.mark.parametrize("names", ["ID Easting Northing Height", "# by x\nid X Y Z", "No y0 X Y Z"])
def test_named_columns_behind_others(tmp_path: Path, names: str) -> None:
    """Numbers of points that do not count on are no coordinates."""
    before = "17 3" if "y0" in names else "17"
    text = f"{names}\n{before} 1.5 2.25 -3\n{before} 4 5.5 6\n"
    assert_allclose(of_file(tmp_path, "a.xyz", text), POINTS)


def triangle(path: Path) -> Path:
    """A glTF file of one triangle."""
    path.write_text(
        json.dumps(
            {
                "buffers": [],
                "bufferViews": [],
                "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
                "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
                "nodes": [{"mesh": 0}],
            }
        )
    )
    appended(path, np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4"))
    return path


def appended(path: Path, *arrays: Any) -> list[int]:
    """Buffer views with these arrays, added to a glTF file; their numbers."""
    tree = json.loads(path.read_text())
    first = len(tree["bufferViews"])
    for array in arrays:
        uri = "data:application/octet-stream;base64," + base64.b64encode(array.tobytes()).decode()
        tree["bufferViews"].append({"buffer": len(tree["buffers"])})
        tree["buffers"].append({"uri": uri})
    path.write_text(json.dumps(tree))
    return list(range(first, first + len(arrays)))


@pytest.mark.parametrize("has_base", [True, False])
def test_gltf_sparse_accessors(tmp_path: Path, has_base: bool) -> None:
    """Some values replaced, of others or of zeros; rows out of range are refused."""
    path = triangle(tmp_path / "a.gltf")
    rows, places = appended(path, np.array([1, 2], "<u2"), np.array([[2, 0, 0], [0, 3, 0]], "<f4"))
    tree = json.loads(path.read_text())
    sparse = {
        "count": 2,
        "indices": {"bufferView": rows, "componentType": 5123},
        "values": {"bufferView": places},
    }
    tree["accessors"][0]["sparse"] = sparse
    if not has_base:
        del tree["accessors"][0]["bufferView"]
    path.write_text(json.dumps(tree))
    mesh = read_surface(path)
    assert isinstance(mesh, Mesh)
    assert_array_equal(mesh.vertices, [[0, 0, 0], [2, 0, 0], [0, 3, 0]])
    tree["accessors"][0]["count"] = 2
    path.write_text(json.dumps(tree))
    with pytest.raises(InputError, match="index out of range"):
        read_surface(path)


def test_gltf_skins_and_morph_targets_are_posed(tmp_path: Path) -> None:
    """Joints move the vertices, the node does not; morph targets count by their weights."""
    path = triangle(tmp_path / "a.gltf")
    joints, weights, target = appended(
        path,
        np.array([[0, 1, 0, 0]] * 3, "u1"),
        np.array([[1, 0, 0, 0], [1, 0, 0, 0], [0, 1, 0, 0]], "<f4"),
        np.array([[0, 0, 0], [2, 0, 0], [0, 0, 0]], "<f4"),
    )
    tree = json.loads(path.read_text())
    kinds = ((joints, 5121, "VEC4"), (weights, 5126, "VEC4"), (target, 5126, "VEC3"))
    for view, kind, shape in kinds:
        tree["accessors"].append(
            {"bufferView": view, "componentType": kind, "count": 3, "type": shape}
        )
    primitive = tree["meshes"][0]["primitives"][0]
    primitive["attributes"] |= {"JOINTS_0": 1, "WEIGHTS_0": 2}
    primitive["targets"] = [{"POSITION": 3}]
    tree["meshes"][0]["weights"] = [0.5]
    tree["skins"] = [{"joints": [1, 2]}]
    tree["nodes"] = [
        {"mesh": 0, "skin": 0, "scale": [9, 1, 1]},
        {"children": [2], "translation": [0, 0, 1]},
        {"translation": [0, 4, 0]},
    ]
    path.write_text(json.dumps(tree))
    mesh = read_surface(path)
    assert isinstance(mesh, Mesh)
    assert_array_equal(mesh.vertices, [[0, 0, 1], [2, 0, 1], [0, 5, 1]])


def test_what_an_obj_file_of_points_has_no_room_for_is_said(tmp_path, caplog) -> None:
    """All but colours; other formats keep it."""
    colours, echo = np.zeros((2, 3), dtype=np.uint8), np.ones(2)
    cloud = PointCloud(np.eye(3)[:2], attributes={"colours": colours, "intensity": echo})
    for ending in (".npz", ".ply", ".obj"):
        write_points(tmp_path / f"out{ending}", cloud, np.zeros((2, 2)))
        said = "OBJ has no room for: intensity; a .ply or .npz file keeps them"
        assert caplog.messages == [said] * (ending == ".obj")
