"""Reading and writing: what is in a file, in its order; one line for whatever is wrong with it."""

import base64
import errno
import json
import logging
import os
import struct
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from parapoint import InputError, Mesh, Parameterization, PointCloud
from parapoint.commands.given_seams import read_seams
from parapoint.files.pieces import point_pieces
from parapoint.files.reading import FORMATS, has_faces, read_parameterized, read_surface
from parapoint.files.writing import point_writers
from parapoint.files.writing.mesh_writers import write_obj
from parapoint.files.writing.point_writers import write_points
from parapoint.testing import irregular_disk

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
TRIANGLES = [[0, 1, 2], [0, 2, 3]]

OBJ_TEXT = b"""# a square in two triangles, cut along its diagonal
mtllib x.mtl
v 0 0 0
v 1 0 0 # with a remark
v 1 1 0 1.0
v 0 1 0
vt 0 0
vt 1 0
vt 1 1
vt 5 5 0
vt 6 6
vt 5 6
vn 0 0 1
f 1/1/1 2/2/1 3/3/1
f 1/4 3/5 4/6
"""


def saved(folder: Path, name: str, data: bytes | str) -> Path:
    path = folder / name
    path.write_bytes(data.encode() if isinstance(data, str) else data)
    return path


def mesh_of(folder, name, data):
    surface = read_surface(saved(folder, name, data))
    assert isinstance(surface, Mesh)
    return surface


def cloud_of(folder, name, data):
    surface = read_surface(saved(folder, name, data))
    assert isinstance(surface, PointCloud)
    return surface


def fault(folder, name, data, reader=read_surface):
    path = saved(folder, name, data)
    with pytest.raises(InputError) as caught:
        reader(path)
    message = str(caught.value)
    assert message.startswith(str(path))
    assert "\n" not in message
    return message


# OBJ


def test_obj_keeps_the_order_of_vertices_faces_and_uv(tmp_path):
    path = saved(tmp_path, "a.obj", OBJ_TEXT)
    mesh, parameterization = read_parameterized(path)
    assert_array_equal(mesh.vertices, SQUARE)
    assert_array_equal(mesh.faces, TRIANGLES)
    assert_array_equal(parameterization.corners, [[0, 1, 2], [3, 4, 5]])
    assert_array_equal(parameterization.uv, [[0, 0], [1, 0], [1, 1], [5, 5], [6, 6], [5, 6]])
    assert_array_equal(parameterization.seams(mesh), [[0, 2]])
    assert_array_equal(read_surface(path).faces, TRIANGLES)


def test_obj_unreferenced_and_duplicate_vertices_are_kept(tmp_path):
    mesh = mesh_of(tmp_path, "a.obj", "v 9 9 9\nv 0 0 0\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 3 4 5\n")
    assert len(mesh.vertices) == 5
    assert_array_equal(mesh.faces, [[2, 3, 4]])


def test_obj_negative_indices_count_backwards_from_their_line(tmp_path):
    text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nf -3/-3 -2/-2 -1/-1\n"
    text += "v 0 1 0\nvt 0 1\nf 1/1 3/3 -1/-1\n"
    mesh, parameterization = read_parameterized(saved(tmp_path, "a.obj", text))
    assert_array_equal(mesh.faces, TRIANGLES)
    assert_array_equal(parameterization.corners, TRIANGLES)


@pytest.mark.parametrize("end", [b"\n", b"\r\n", b"\r"])
def test_obj_line_ends_and_continued_lines(tmp_path, end):
    text = b"v 0 0 0\n v 1 0 0\nv\t1 1 0\nv 0 1 0\nf 1 2 \\\n 3\nf 1 3 4"
    if end == b"\r":
        text = text.replace(b"\\\n", b"")  # a lone return cannot be continued
    mesh = mesh_of(tmp_path, "a.obj", text.replace(b"\n", end))
    assert_array_equal(mesh.faces, TRIANGLES)


def test_quads_and_their_uv_are_cut_along_the_same_diagonal(tmp_path):
    text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n"
    mesh, parameterization = read_parameterized(saved(tmp_path, "a.obj", text))
    assert_array_equal(mesh.faces, TRIANGLES)
    assert_array_equal(parameterization.corners, TRIANGLES)


@pytest.mark.parametrize("turn", range(4))
def test_an_arrowhead_quad_does_not_fold(tmp_path, turn):
    arrow = np.roll([[0, 0, 0], [2, -1, 0], [0.5, 0, 0], [2, 1, 0]], turn, axis=0)
    text = "".join(f"v {x} {y} {z}\n" for x, y, z in arrow) + "f 1 2 3 4\n"
    mesh = mesh_of(tmp_path, "a.obj", text)
    # Twice the area of the arrowhead is 2 * (0.5 * 0.5 * 2) = 1 by the shoelace formula.
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    assert np.abs(np.cross(b - a, c - a)[:, 2].sum()) == pytest.approx(1)
    assert mesh.face_areas.sum() == pytest.approx(0.5)


def test_a_pentagon_is_a_fan_among_other_faces(tmp_path):
    text = "".join(f"v {k} {k * k} 0\n" for k in range(6)) + "f 1 2 3\nf 1 2 3 4 5\nf 4 5 6\n"
    mesh = mesh_of(tmp_path, "a.obj", text)
    assert_array_equal(mesh.faces, [[0, 1, 2], [0, 1, 2], [0, 2, 3], [0, 3, 4], [3, 4, 5]])


def test_equal_uv_of_one_vertex_is_no_seam(tmp_path):
    text = OBJ_TEXT.replace(b"vt 5 5 0", b"vt 0 0").replace(b"vt 6 6", b"vt 1 1")
    mesh, parameterization = read_parameterized(saved(tmp_path, "a.obj", text))
    assert_array_equal(parameterization.corners, [[0, 1, 2], [0, 2, 5]])
    assert len(parameterization.uv) == 6
    assert len(parameterization.seams(mesh)) == 0


def test_uv_written_once_for_two_places_joins_no_charts(tmp_path):
    # Two triangles apart in space, drawn on the same three vt lines.
    places = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 5 0 0\nv 6 0 0\nv 5 1 0\n"
    text = places + "vt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\nf 4/1 5/2 6/3\n"
    _, parameterization = read_parameterized(saved(tmp_path, "a.obj", text))
    assert_array_equal(parameterization.corners, [[0, 1, 2], [3, 4, 5]])
    assert_array_equal(parameterization.uv, 2 * [[0, 0], [1, 0], [0, 1]])
    assert_array_equal(parameterization.charts(), [0, 1])
    # Vertices that the file doubles, as renderers need them, are one place: no seam is made of it.
    welded = text.replace("v 5 0 0", "v 1 0 0").replace("v 6 0 0", "v 1 1 0")
    welded = welded.replace("v 5 1 0", "v 0 1 0").replace("f 4/1 5/2 6/3", "f 4/2 5/1 6/3")
    _, parameterization = read_parameterized(saved(tmp_path, "b.obj", welded))
    assert_array_equal(parameterization.corners, [[0, 1, 2], [1, 3, 2]])


def test_obj_without_faces_is_a_point_cloud(tmp_path):
    assert_array_equal(
        cloud_of(tmp_path, "a.obj", "v 1 2 3\nv 4 5 6\n").points, [[1, 2, 3], [4, 5, 6]]
    )


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", "face 0 has a vertex index out of range"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n", "face 0 has a vertex index out of range"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 -4\n", "face 0 has a vertex index out of range"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2\n", "face 0 has 2 corners"),
        ("v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "vertices must be finite; row 0"),
        ("v 0 0 0\nv 1 inf 0\nv 0 1 0\nf 1 2 3\n", "vertices must be finite; row 1"),
        ("v 0 0\nf 1 1 1\n", "fewer than three coordinates"),
        ("v 0 0 x\nf 1 1 1\n", "'x'"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 three\n", "'three'"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3/4\n", "no vt line"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1/1/1/1 2 3\n", "v/vt/vn"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 99999999999999999999\n", ""),
        ("nothing of it\n", "no point"),
    ],
)
def test_faulty_obj(tmp_path, text, says):
    assert says in fault(tmp_path, "a.obj", text)


VERTICES = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (VERTICES + "f 1 2 3\n", "has no UV coordinates"),
        (VERTICES + "vt 0 0\nf 1/1 2/1 3/2\n", "triangle 0 has a UV index out of range"),
        (VERTICES + "vt 0 0\nvt 0 1\nvt 1 1\nf 1/1 2/2 3/3\nf 1 3 4\n", "1 of 2 triangles"),
        (VERTICES + "vt 0 0\nvt 0 1\nvt 1 1\nf 1/1 2/2 3\n", "1 of 1 triangles"),
        (VERTICES + "vt 0 0\nvt 0 nan\nvt 1 1\nf 1/1 2/2 3/3\n", "uv must be finite; row 1"),
        (VERTICES + "vt 0 0\nvt inf 0\nvt 1 1\nf 1/1 2/2 3/3\n", "uv must be finite; row 1"),
        (VERTICES + "vt 0 0\n", "has no faces"),
    ],
)
def test_faulty_uv(tmp_path, text, says):
    assert says in fault(tmp_path, "a.obj", text, read_parameterized)


def test_a_format_without_uv_says_so(tmp_path):
    assert "carries no UV" in fault(tmp_path, "a.off", "OFF\n", read_parameterized)


# OFF


@pytest.mark.parametrize(
    "text",
    [
        "OFF\n4 2 5\n{v}3 0 1 2\n3 0 2 3\n",
        "OFF 4 2 5\n{v}3 0 1 2 255 0 0\n3 0 2 3 0 255 0\n",
        "# remark\nCOFF\n\n4 2 0\n{v}\n3 0 1 2 # colours gone\n3 0 2 3\n",
        "4 2 0\n{v}3 0 1 2\n3 0 2 3\n",
        "OFF\n4 1 0\n{v}4 0 1 2 3\n",
    ],
)
def test_off(tmp_path, text):
    v = "".join(f"{x} {y} {z} 1 1 1 1\n" for x, y, z in SQUARE)
    mesh = mesh_of(tmp_path, "a.off", text.format(v=v))
    assert_array_equal(mesh.vertices, SQUARE)
    assert_array_equal(mesh.faces, TRIANGLES)


@pytest.mark.parametrize("order", "<>")
@pytest.mark.parametrize("colours", [(), (0,), (3, 1, 2, 3)])
def test_binary_off(tmp_path, order, colours):
    data = b"OFF BINARY\n" + np.array([4, 2, 0], f"{order}i4").tobytes()
    data += SQUARE.astype(f"{order}f4").tobytes()
    for face in TRIANGLES:
        data += np.array([3, *face, *colours], f"{order}i4").tobytes()
    mesh = mesh_of(tmp_path, "a.off", data)
    assert_array_equal(mesh.vertices, SQUARE)
    assert_array_equal(mesh.faces, TRIANGLES)
    assert "ends early" in fault(tmp_path, "b.off", data[:-8])


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("OFF\n9 9 9\n0 0 0\n", "ends early"),
        ("OFF\nx y\n", "numbers of vertices"),
        ("4OFF\n1 0 0\n0 0 0 0\n", "no kind of OFF"),
        ("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1\n", "fewer corners"),
        ("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n", "out of range"),
    ],
)
def test_faulty_off(tmp_path, text, says):
    assert says in fault(tmp_path, "a.off", text)


# PLY


def ply_header(encoding: str, elements: str) -> bytes:
    return f"ply\nformat {encoding} 1.0\ncomment made\n{elements}\nend_header\n".encode()


ELEMENTS = """element vertex 5
property float x
property double y
property uchar flag
property float z
element face 2
property uchar flag
property list uchar int vertex_indices
property list uchar float texcoord
element edge 1
property int vertex1
property int vertex2"""
PENTAGON = np.array([[0, 0, 0], [2, 0, 0], [3, 1, 0], [1, 2, 0], [-1, 1, 0]], dtype=float)


@pytest.mark.parametrize("encoding", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_ply_with_mixed_polygons_and_other_data(tmp_path, encoding):
    rows = [("fdBf", (x, y, 7, z)) for x, y, z in PENTAGON]
    rows.append(("BB4iB2f", (1, 4, 0, 1, 2, 3, 2, 0.5, 0.5)))
    rows.append(("BB3iB0f", (1, 3, 0, 3, 4, 0)))
    rows.append(("2i", (0, 1)))
    if encoding == "ascii":
        body = "\n".join(" ".join(map(str, values)) for _, values in rows).encode()
    else:
        order = "<" if "little" in encoding else ">"
        body = b"".join(struct.pack(order + code, *values) for code, values in rows)
    data = ply_header(encoding, ELEMENTS) + body
    mesh = mesh_of(tmp_path, "a.ply", data)
    assert_array_equal(mesh.vertices, PENTAGON)
    assert_array_equal(mesh.faces, [[0, 1, 2], [0, 2, 3], [0, 3, 4]])
    short = data.rsplit(b"\n", 3)[0] if encoding == "ascii" else data[:-30]
    fault(tmp_path, "b.ply", short)


def test_ply_whose_lists_of_uv_are_all_empty_has_no_uv(tmp_path: Path) -> None:
    header = "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    header += "element face 1\nproperty list int int vertex_indices\n"
    header += "property list uchar float texcoord"
    data = ply_header("ascii", header) + b"0 0 0\n1 0 0\n0 1 0\n3 0 1 2 0\n"
    assert "has no UV coordinates" in fault(tmp_path, "a.ply", data, read_parameterized)


def test_ply_strips_turn_every_second_triangle_and_stop_at_minus_one(tmp_path):
    vertices = "\n".join(f"{k} {k % 2} 0" for k in range(6))
    header = "element vertex 6\nproperty float x\nproperty float y\nproperty float z\n"
    header += "element tristrips 1\nproperty list int int vertex_indices"
    data = ply_header("ascii", header) + f"{vertices}\n8 0 1 2 3 -1 3 4 5\n".encode()
    assert_array_equal(mesh_of(tmp_path, "a.ply", data).faces, [[0, 1, 2], [2, 1, 3], [3, 4, 5]])


def test_ply_points_with_normals(tmp_path):
    header = "element vertex 1\n" + "\n".join(
        f"property float {name}" for name in ("x", "y", "z", "nx", "ny", "nz")
    )
    cloud = cloud_of(tmp_path, "a.ply", ply_header("ascii", header) + b"1 2 3 0 0 1\n")
    assert_array_equal(cloud.points, [[1, 2, 3]])
    assert_array_equal(cloud.normals, [[0, 0, 1]])


@pytest.mark.parametrize(
    "elements",
    [
        "element vertex 99999999999\nproperty float x\nproperty float y\nproperty float z",
        "element vertex 1\nproperty float x\nproperty float y",
        "element vertex -1\nproperty float x\nproperty float y\nproperty float z",
        "element vertex 1\nproperty list uchar float x",
        "property float x",
        "element vertex 1\nproperty quaternion x",
        "element nothing 99999999999",
        "element vertex 99999999999",
    ],
)
def test_faulty_ply(tmp_path, elements):
    fault(tmp_path, "a.ply", ply_header("binary_little_endian", elements) + b"\0" * 40)


# STL, glTF


def test_stl_corners_are_welded_where_they_are_equal(tmp_path):
    corners = SQUARE[TRIANGLES].astype("<f4")
    data = b"solid in name only".ljust(80) + struct.pack("<I", 2)
    for triangle in corners:
        data += np.zeros(3, "<f4").tobytes() + triangle.tobytes() + b"\0\0"
    mesh = mesh_of(tmp_path, "a.stl", data)
    assert_array_equal(mesh.vertices, SQUARE)
    assert_array_equal(mesh.faces, TRIANGLES)
    assert mesh.topology == "disk"
    lines = ["solid a"]
    for triangle in corners:
        lines += ["facet normal 0 0 1", "outer loop"]
        lines += [f"vertex {x} {y} {z}" for x, y, z in triangle]
        lines += ["endloop", "endfacet"]
    assert_array_equal(
        mesh_of(tmp_path, "A.STL", "\n".join([*lines, "endsolid a"])).faces, TRIANGLES
    )


def gltf_tree(blob: bytes, *, strip: bool = False) -> dict:
    """The square as glTF: positions, indices, UV; four vertices more than it needs, moved by 10."""
    return {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [1]}],
        "nodes": [
            {"mesh": 0, "scale": [2, 2, 2]},
            {"children": [0], "translation": [10, 0, 0], "rotation": [0, 0, 2**-0.5, 2**-0.5]},
        ],
        "meshes": [
            {
                "primitives": [
                    {
                        "attributes": {"POSITION": 0, "TEXCOORD_0": 2},
                        "indices": 1,
                        "mode": 5 if strip else 4,
                    }
                ]
            }
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 6, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"},
            {
                "bufferView": 2,
                "componentType": 5121,
                "count": 6,
                "type": "VEC2",
                "normalized": True,
            },
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 72},
            {"buffer": 0, "byteOffset": 72, "byteLength": 12},
            {"buffer": 0, "byteOffset": 84, "byteLength": 24, "byteStride": 4},
        ],
        "buffers": [{"byteLength": len(blob)}],
    }


def gltf_blob() -> bytes:
    uv = np.array([[0, 255], [255, 255], [255, 0], [0, 255], [255, 0], [0, 0]], dtype=np.uint8)
    return (
        SQUARE[TRIANGLES].reshape(-1, 3).astype("<f4").tobytes()
        + np.arange(6, dtype="<u2").tobytes()
        + np.pad(uv, ((0, 0), (0, 2))).tobytes()
    )


def glb_bytes(tree: dict, blob: bytes) -> bytes:
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text
    body += struct.pack("<I4s", len(blob), b"BIN\0") + blob
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


@pytest.mark.parametrize("form", ["glb", "beside", "inside"])
def test_gltf_is_placed_welded_and_keeps_uv_without_a_material(tmp_path, form):
    blob = gltf_blob()
    tree = gltf_tree(blob)
    if form == "glb":
        path = saved(tmp_path, "a.glb", glb_bytes(tree, blob))
    elif form == "beside":
        saved(tmp_path, "a b.bin", blob)
        tree["buffers"][0]["uri"] = "a%20b.bin"
        path = saved(tmp_path, "a.gltf", json.dumps(tree))
    else:
        text = base64.b64encode(blob).decode()
        tree["buffers"][0]["uri"] = f"data:application/octet-stream;base64,{text}"
        path = saved(tmp_path, "a.gltf", json.dumps(tree))
    mesh, parameterization = read_parameterized(path)
    assert_array_equal(mesh.faces, TRIANGLES)
    # Doubled, turned by a quarter about z, moved by 10 along x.
    x, y = 2 * SQUARE[:, 0], 2 * SQUARE[:, 1]
    np.testing.assert_allclose(mesh.vertices, np.stack([10 - y, x, 0 * x], axis=1), atol=1e-12)
    assert_array_equal(parameterization.uv[parameterization.corners], SQUARE[TRIANGLES][..., :2])
    assert len(parameterization.seams(mesh)) == 0


def test_a_cube_as_blender_writes_it_is_one_chart_in_both_formats(tmp_path):
    # OBJ: quads, each vt and vn once a vertex, an object, smoothing off. GLB: triangles, a vertex
    # for each corner of a flat face, v downwards. Both files are the same map with seven seams.
    sides = np.array(
        [
            [[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]],
            [[1, 0, 1], [1, 0, 0], [1, 1, 0], [1, 1, 1]],
            [[1, 0, 0], [0, 0, 0], [0, 1, 0], [1, 1, 0]],
            [[0, 0, 0], [0, 0, 1], [0, 1, 1], [0, 1, 0]],
            [[0, 1, 1], [1, 1, 1], [1, 1, 0], [0, 1, 0]],
            [[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]],
        ]
    )
    cross = np.array([[1, 1], [2, 1], [3, 1], [0, 1], [1, 2], [1, 0]])
    squares = (cross[:, None] + [[0, 0], [1, 0], [1, 1], [0, 1]]) / 4
    points, point = np.unique(sides.reshape(-1, 3), axis=0, return_inverse=True)
    uv, row = np.unique(squares.reshape(-1, 2), axis=0, return_inverse=True)
    lines = ["# Blender 5.0.1", "# www.blender.org", "mtllib cube.mtl", "o Cube"]
    lines += ["v {:.6f} {:.6f} {:.6f}".format(*p) for p in points]
    lines += ["vn 0.0000 0.0000 1.0000", *("vt {:.6f} {:.6f}".format(*p) for p in uv), "s 0"]
    corners = [f"{v + 1}/{t + 1}/1" for v, t in zip(point.ravel(), row.ravel(), strict=True)]
    lines += ["f " + " ".join(corners[k : k + 4]) for k in range(0, 24, 4)]
    blob = sides.astype("<f4").tobytes() + (squares * [1, -1] + [0, 1]).astype("<f4").tobytes()
    indices = np.array([0, 1, 2, 0, 2, 3], "<u2") + 4 * np.arange(6, dtype="<u2")[:, None]
    kinds = [(5126, 24, "VEC3"), (5126, 24, "VEC2"), (5123, 36, "SCALAR")]
    sizes = np.array([288, 192, 72])
    tree = {
        "asset": {"generator": "Khronos glTF Blender I/O v5.0.21", "version": "2.0"},
        "scene": 0,
        "scenes": [{"name": "Scene", "nodes": [0]}],
        "nodes": [{"mesh": 0, "name": "Cube"}],
        "meshes": [
            {"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2}]}
        ],
        "accessors": [
            {"bufferView": k, "componentType": kind, "count": count, "type": name}
            for k, (kind, count, name) in enumerate(kinds)
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": int(end - size), "byteLength": int(size)}
            for end, size in zip(np.cumsum(sizes), sizes, strict=True)
        ],
        "buffers": [{"byteLength": int(sizes.sum())}],
    }
    maps = [
        read_parameterized(saved(tmp_path, "cube.obj", "\n".join(lines))),
        read_parameterized(saved(tmp_path, "cube.glb", glb_bytes(tree, blob + indices.tobytes()))),
    ]
    for mesh, parameterization in maps:
        assert mesh.topology == "sphere"
        assert len(np.unique(parameterization.corners)) == 14
        assert parameterization.charts().max() == 0
        assert len(parameterization.seams(mesh)) == 7
        halves = sides[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 3)
        assert_array_equal(mesh.vertices[mesh.faces], halves)
    placed = [parameterization.uv[parameterization.corners] for _, parameterization in maps]
    assert_array_equal(*placed)


def test_gltf_strip(tmp_path):
    blob = gltf_blob()[:72] + np.array([0, 1, 5, 2], "<u2").tobytes().ljust(12) + gltf_blob()[84:]
    tree = gltf_tree(blob, strip=True)
    tree["accessors"][1]["count"] = 4
    mesh = mesh_of(tmp_path, "a.glb", glb_bytes(tree, blob))
    assert_array_equal(mesh.faces, [[0, 1, 3], [3, 1, 2]])


def test_faulty_gltf(tmp_path):
    blob = gltf_blob()
    for change, says in [
        (lambda t: t["accessors"][0].update(count=10**9), "ends early"),
        (lambda t: t["accessors"][0].pop("bufferView"), "compressed"),
        (lambda t: t["nodes"][0].update(children=[1]), "two places"),
        (lambda t: t["buffers"][0].update(uri="../../../etc/hostname"), "put 'hostname' beside it"),
        (lambda t: t.update(meshes=[]), "no mesh"),
        (lambda t: t["accessors"][1].update(componentType=5126, count=3), "whole number"),
        (lambda t: t["nodes"][0].update(scale=[1e400, 1, 1]), "not finite"),
        (lambda t: t["meshes"][0]["primitives"][0].update(mode=1), "no triangle"),
    ]:
        tree = gltf_tree(blob)
        change(tree)
        assert says in fault(tmp_path, "a.glb", glb_bytes(tree, blob))


# Point clouds


def test_xyz_normals_are_columns_of_length_one(tmp_path):
    cloud = cloud_of(tmp_path, "a.xyz", "# scan\n1,2,3,0,0,1\n\n4 5 6 0 1 0\n")
    assert_array_equal(cloud.points, [[1, 2, 3], [4, 5, 6]])
    assert_array_equal(cloud.normals, [[0, 0, 1], [0, 1, 0]])
    assert cloud_of(tmp_path, "b.xyz", "1 2 3 255 0 0\n4 5 6 0 9 0\n").normals is None
    assert_array_equal(cloud_of(tmp_path, "c.xyz", "1\n1 2 3 9\n").points, [[1, 2, 3]])


def test_pts_of_both_kinds(tmp_path):
    hoppe = "# remark\nd 0 0 0\np 1 2 3\np 4 5 6\n"
    assert_array_equal(cloud_of(tmp_path, "a.pts", hoppe).points, [[1, 2, 3], [4, 5, 6]])
    scanner = "2\n1 2 3 -100 9 9 9\n4 5 6 -100 9 9 9\n"
    assert_array_equal(cloud_of(tmp_path, "b.pts", scanner).points, [[1, 2, 3], [4, 5, 6]])


def lzf_compressed(data: bytes) -> bytes:
    """A small LZF encoder: the first byte literally, then copies of it where they fit."""
    out, at = bytearray(), 0
    while at < len(data):
        run = 0
        while at and run < 264 and at + run < len(data) and data[at + run] == data[at - 1]:
            run += 1
        if run < 3:
            out += bytes([0, data[at]])
            at += 1
        elif run < 9:
            out += bytes([(run - 2) << 5, 0])
            at += run
        else:
            out += bytes([7 << 5, run - 9, 0])
            at += run
    return bytes(out)


@pytest.mark.parametrize("encoding", ["ascii", "binary", "binary_compressed"])
def test_pcd(tmp_path, encoding, caplog):
    points = np.zeros((50, 3), dtype="<f4")
    points[:, 0] = np.arange(50)
    points[7] = np.nan
    header = "# .PCD v.7\nVERSION .7\nFIELDS _ x y rgb z\nSIZE 1 4 4 4 4\nTYPE U F F U F\n"
    header += f"COUNT 3 1 1 1 1\nWIDTH 50\nHEIGHT 1\nPOINTS 50\nDATA {encoding}\n"
    kind = np.dtype([("_", "u1", 3), ("x", "<f4"), ("y", "<f4"), ("rgb", "<u4"), ("z", "<f4")])
    table = np.zeros(50, kind)
    for name, column in zip("xyz", points.T, strict=True):
        table[name] = column
    if encoding == "ascii":
        body = "\n".join(f"0 0 0 {x} {y} 7 {z}" for x, y, z in points).encode()
    elif encoding == "binary":
        body = table.tobytes()
    else:
        flat = b"".join(table[name].tobytes() for name in table.dtype.names or ())
        packed = lzf_compressed(flat)
        assert len(packed) < len(flat)
        body = struct.pack("<II", len(packed), len(flat)) + packed
    with caplog.at_level(logging.WARNING, logger="parapoint"):
        cloud = cloud_of(tmp_path, "a.pcd", header.encode() + body)
    assert_array_equal(cloud.points[:, 0], [k for k in range(50) if k != 7])
    assert "1 of 50 points dropped" in caplog.text
    assert cloud.dropped == 1
    fault(tmp_path, "b.pcd", header.encode() + body[: len(body) // 2])


def test_las(tmp_path):
    import laspy

    las = laspy.create()
    las.header.scales, las.header.offsets = [0.5, 0.5, 0.5], [100, 0, 0]
    las.x, las.y, las.z = np.array([[101.5, 99], [2, 3], [4.5, 5]])
    las.write(str(tmp_path / "a.las"))
    assert_array_equal(read_surface(tmp_path / "a.las").points, [[101.5, 2, 4.5], [99, 3, 5]])
    fault(tmp_path, "b.las", b"LASF" + b"\0" * 50)
    data = bytearray((tmp_path / "a.las").read_bytes())
    assert "ends early" in fault(tmp_path, "c.las", data[:-1])
    data[107:111] = b"\xff\xff\xff\xff"  # two points that claim to be four thousand million
    assert "4294967295 points" in fault(tmp_path, "d.las", data)
    data = bytearray((tmp_path / "a.las").read_bytes())
    data[100:104] = b"\xff\xff\xff\x7f"
    assert "2147483647 variable records" in fault(tmp_path, "e.las", data)


def test_a_cloud_without_a_finite_point_is_refused(tmp_path):
    assert "no point with finite" in fault(tmp_path, "a.xyz", "nan 0 0\n0 inf 0\n")
    assert "has no point" in fault(tmp_path, "b.xyz", "# nothing\n")


# Any file


@pytest.mark.parametrize("ending", FORMATS)
def test_files_that_are_not_there_or_hold_nothing(tmp_path, ending):
    for make, says in [
        (lambda _: None, "no such file"),
        (lambda path: path.write_bytes(b""), "is empty"),
        (lambda path: (path.unlink(), path.mkdir()), "is a folder"),
    ]:
        path = tmp_path / f"a{ending}"
        make(path)
        with pytest.raises(InputError, match=says):
            read_surface(path)


def test_an_unknown_ending_names_the_known(tmp_path):
    assert ".obj, .ply" in fault(tmp_path, "a.docx", b"x")


@pytest.mark.parametrize("ending", FORMATS)
@settings(max_examples=40, deadline=None)
@given(data=st.data())
def test_garbage_is_one_line(ending, data, tmp_path_factory):
    seeds = {
        ".obj": OBJ_TEXT,
        ".off": b"OFF BINARY\n" + np.array([1, 1, 0], ">i4").tobytes(),
        ".ply": ply_header("binary_little_endian", ELEMENTS),
        ".stl": b"solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\n",
        ".glb": glb_bytes(gltf_tree(gltf_blob()), gltf_blob()),
        ".gltf": json.dumps(gltf_tree(gltf_blob())).encode(),
        ".pcd": b"FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS 2\nDATA binary_compressed\n",
    }
    start = seeds.get(ending, b"1 2 3\n4 5 6\n")
    cut = data.draw(st.integers(0, len(start)))
    drop = data.draw(st.integers(0, 3))
    content = start[:cut] + data.draw(st.binary(max_size=40)) + start[cut + drop :]
    path = saved(tmp_path_factory.getbasetemp(), f"garbage{ending}", content)
    try:
        surface = read_surface(path)
    except InputError as error:
        assert "\n" not in str(error)  # noqa: PT017 - the other outcome is a surface
    else:
        assert isinstance(surface, Mesh | PointCloud)


# Writing


def bent() -> tuple[Mesh, Parameterization]:
    rng = np.random.default_rng(1)
    mesh = Mesh(rng.normal(size=(4, 3)) * 1e3, TRIANGLES)
    return mesh, Parameterization(rng.normal(size=(6, 2)) / 3, [[0, 1, 2], [3, 4, 5]])


def test_obj_is_read_back_exactly(tmp_path):
    mesh, parameterization = bent()
    write_obj(tmp_path / "a.obj", mesh, parameterization)
    mesh_read, read = read_parameterized(tmp_path / "a.obj")
    assert_array_equal(mesh_read.vertices, mesh.vertices)
    assert_array_equal(mesh_read.faces, mesh.faces)
    assert_array_equal(read.uv, parameterization.uv)
    assert_array_equal(read.corners, parameterization.corners)
    assert [file.name for file in tmp_path.iterdir()] == ["a.obj"]


def test_a_texture_comes_with_its_material(tmp_path):
    from matplotlib.image import imread

    pixels = np.random.default_rng(0).integers(0, 256, (5, 7, 3), dtype=np.uint8)
    write_obj(tmp_path / "a.obj", *bent(), texture=pixels)
    assert "mtllib a.mtl" in (tmp_path / "a.obj").read_text()
    assert "map_Kd a.png" in (tmp_path / "a.mtl").read_text()
    assert_array_equal(np.rint(imread(tmp_path / "a.png") * 255), pixels)
    with pytest.raises(InputError, match="texture"):
        write_obj(tmp_path / "b.obj", *bent(), texture=pixels[..., 0])
    assert not list(tmp_path.glob("*b.*"))


def test_writing_leaves_the_old_file_or_the_new_one(tmp_path, monkeypatch):
    path = saved(tmp_path, "a.obj", "precious")
    mesh, parameterization = bent()
    with pytest.raises(InputError, match="cannot be written"):
        write_obj(path, Mesh(mesh.vertices, mesh.faces[:1]), parameterization)

    def replace(*_):
        raise OSError(errno.ENOSPC, "disk full")

    monkeypatch.setattr(Path, "replace", replace)
    with pytest.raises(OSError, match=r"disk full: .*a\.obj"):
        write_obj(path, mesh, parameterization)
    assert [file.name for file in tmp_path.iterdir()] == ["a.obj"]
    assert path.read_text() == "precious"


@pytest.mark.parametrize("normals", [None, SQUARE])
def test_points_are_written_with_their_uv(tmp_path, normals):
    points = np.random.default_rng(2).normal(size=(4, 3))
    cloud, uv = PointCloud(points, normals), points[:, :2] / 3
    write_points(tmp_path / "a.ply", cloud, uv)
    read = read_surface(tmp_path / "a.ply")
    assert_array_equal(read.points, points)
    assert (read.normals is None) == (normals is None)
    assert b"property double u\nproperty double v\nend_header" in (tmp_path / "a.ply").read_bytes()
    stored = np.frombuffer((tmp_path / "a.ply").read_bytes().split(b"end_header\n")[1], "<f8")
    assert_array_equal(stored.reshape(4, -1)[:, -2:], uv)
    write_points(tmp_path / "a.npz", cloud, uv)
    with np.load(tmp_path / "a.npz", allow_pickle=False) as arrays:
        assert_array_equal(arrays["points"], points)
        assert_array_equal(arrays["uv"], uv)
    write_points(tmp_path / "a.obj", cloud, uv)
    rows = [line.split() for line in (tmp_path / "a.obj").read_text().splitlines()]
    assert_array_equal([[float(x) for x in row[1:]] for row in rows if row[0] == "vt"], uv)
    assert_array_equal(read_surface(tmp_path / "a.obj").points, points)


@pytest.mark.parametrize("uv", [np.zeros((3, 2)), np.zeros((4, 3)), np.array([[np.nan, 0]] * 4)])
def test_points_and_uv_must_agree(tmp_path, uv):
    with pytest.raises(InputError):
        write_points(tmp_path / "a.ply", PointCloud(SQUARE), uv)
    with pytest.raises(InputError, match=r"\.ply, \.npz, \.obj"):
        write_points(tmp_path / "a.las", PointCloud(SQUARE), np.zeros((4, 2)))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("ending", [".ply", ".obj"])
def test_points_are_written_in_bounded_memory(ending, tmp_path, monkeypatch) -> None:
    points = np.random.default_rng(0).normal(size=(20_000, 3))
    cloud, uv = PointCloud(points), points[:, :2].copy()
    write_points(tmp_path / f"whole{ending}", cloud, uv)
    monkeypatch.setattr(point_writers, "ROWS_WRITTEN", 999)
    tracemalloc.start()
    try:
        write_points(tmp_path / f"parts{ending}", cloud, uv)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert (tmp_path / f"parts{ending}").read_bytes() == (tmp_path / f"whole{ending}").read_bytes()
    assert peak < 2 * uv.nbytes  # one checked copy of uv, and 999 rows at a time


@pytest.mark.parametrize(("text", "expected"), [("v 0 0 0\nf 1 1 1\n", True), ("v 0 0 0\n", False)])
def test_a_file_is_known_to_have_faces(text: str, expected: bool, tmp_path: Path) -> None:
    assert has_faces(saved(tmp_path, "a.obj", text)) is expected


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="Windows has no named pipes")
@pytest.mark.parametrize("name", ["-", "pipe.obj", "pipe", "/dev/null"])
def test_pipes_and_devices_are_refused(name: str, tmp_path: Path) -> None:
    """At once: a command would wait for one for ever, or read it once where it reads twice."""
    path = tmp_path / name
    if name.startswith("pipe"):
        os.mkfifo(path)
    path = Path(name) if name == "-" else path
    readers = (read_surface, read_parameterized, lambda of: list(point_pieces(of)))
    for reader in (*readers, lambda of: read_seams(str(of), irregular_disk())):
        with pytest.raises(InputError, match=f"{name}: pipes and devices are not read; write to"):
            reader(path)
