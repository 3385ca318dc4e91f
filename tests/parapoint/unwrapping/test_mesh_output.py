"""What `unwrap` writes of a mesh keeps what the file says of it, and shows what it showed."""

import base64
import io
import json
import struct

import numpy as np
import pytest
from numpy.testing import assert_allclose
from PIL import Image

from parapoint import InputError, Mesh, Parameterization
from parapoint.commands.mesh_output import mesh_output
from parapoint.files.attributes import srgb
from parapoint.files.meshes.gltf import opened
from parapoint.files.meshes.painting import painting_of
from parapoint.files.meshes.ply import Table
from parapoint.files.meshes.ply import opened as opened_ply
from parapoint.files.reading import read_parameterized, read_polygons
from parapoint.files.writing.mesh_writers import write_glb, write_ply
from parapoint.surfaces.parameterization import Charted

SIDE = 4
"""Quads along a side of the sheet."""
BLUE, RED, GREEN = (20, 40, 200), (200, 30, 30), (10, 220, 90)


def old_picture() -> np.ndarray:
    """(64, 64, 3) a picture that has another colour at each place."""
    line, column = np.mgrid[:64, :64]
    return np.stack([4 * column, 4 * line, 255 - 2 * (line + column)], axis=2).astype(np.uint8)


def grid() -> tuple[np.ndarray, list[tuple[int, ...]]]:
    """(25, 3) points of a bent sheet, and its quads."""
    x, y = np.meshgrid(np.arange(SIDE + 1.0), np.arange(SIDE + 1.0), indexing="ij")
    points = np.stack([x, y, 0.1 * x**2], axis=2).reshape(-1, 3)
    index = np.arange(len(points)).reshape(SIDE + 1, -1)
    quads = np.stack([index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]], axis=2)
    return points, [tuple(quad) for quad in quads.reshape(-1, 4).tolist()]


def new_map(faces: np.ndarray, points: np.ndarray) -> Charted:
    """Another map: turned by a right angle, and cut in two where x is 2; no polygon is split."""
    half = (points[faces][:, :, 0].mean(axis=1) > 2).astype(np.int64)
    flat = np.stack([1 - points[:, 1] / SIDE, points[:, 0] / SIDE], axis=1) * 0.8 + 0.05
    uv = np.concatenate([flat, flat + np.array([0.0, 0.1])])
    return Charted(Mesh(points, faces), Parameterization(uv, faces + half[:, None] * len(points)))


@pytest.fixture
def textured(tmp_path):
    """The sheet as OBJ: one half shows a picture, one row is red, the last is without material."""
    points, quads = grid()
    Image.fromarray(old_picture()).save(tmp_path / "old one.png")
    (tmp_path / "old.mtl").write_text(
        "newmtl shown\nKd 1 1 1\nmap_Kd -s 1 1 1 old one.png\nmap_Bump bumps.png\nNs 12\n"
        f"newmtl red\nKd {RED[0] / 255} {RED[1] / 255} {RED[2] / 255}\n"
    )
    lines = ["mtllib old.mtl", *(f"v {x} {y} {z}" for x, y, z in points)]
    lines += [f"vt {x / SIDE} {y / SIDE}" for x, y, _ in points]
    lines += ["vn 0 0 1", "g left", "usemtl shown"]
    for k, quad in enumerate(quads):
        if k == SIDE * (SIDE - 1):
            lines += ["g right", "usemtl red"]
        lines.append("f " + " ".join(f"{at + 1}/{at + 1}/1" for at in quad))
    path = tmp_path / "sheet.obj"
    path.write_text("\n".join(lines) + "\n")
    return path


def written(source, out, texture=256):
    """The new map of a file, once it has been written."""
    given = read_polygons(source)
    placed = new_map(given.mesh.faces, given.mesh.vertices)
    output = mesh_output(given, str(source), str(out), texture, 4)
    output.check(force=False)
    output.write(placed, output.picture(placed))
    return placed


def seen(path, picture, points):
    """(n, 3) the colours of a picture where the middles of a file's faces at `points` lie."""
    mesh, own = read_parameterized(path)
    middles = mesh.vertices[mesh.faces].mean(axis=1)
    at = own.uv[own.corners].mean(axis=1)
    face = ((points[:, None] - middles[None]) ** 2).sum(axis=2).argmin(axis=1)
    height, width = picture.shape[:2]
    return picture[((1 - at[face, 1]) * height).astype(int), (at[face, 0] * width).astype(int), :3]


TRIANGLE = {
    "all.obj": (
        (
            "mtllib no.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\no a\ng b\ns 1\nusemtl m\n"
            "f 1/1/1 2/1/1 3/1/1\nl 1 2\np 1\n"
        ),
        "old UVs, normals, objects, groups, smoothing groups, materials, lines, points",
    ),
    "plain.obj": ("s off\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", ""),
    "all.ply": (
        (
            "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
            "property float z\nproperty float nx\nproperty float ny\nproperty float nz\n"
            "property float quality\nelement face 1\nproperty list uchar int vertex_indices\n"
            "property list uchar int tags\nproperty uchar red\nproperty uchar green\n"
            "property uchar blue\nproperty uchar flags\nelement edge 1\nproperty int vertex1\n"
            "property int vertex2\nend_header\n0 0 0 0 0 1 5\n1 0 0 0 0 1 5\n0 1 0 0 0 1 5\n"
            "3 0 1 2 1 7 1 2 3 4\n0 1\n"
        ),
        "normals, quality, colours of faces, tags of faces, flags of faces, the element edge",
    ),
    "all.off": (
        "STOFF\n3 1 0\n0 0 0 0 0\n1 0 0 0 0\n0 1 0 0 0\n3 0 1 2 9 9 9\n",
        "colours of faces, old UVs",
    ),
    "all.stl": (
        2
        * (
            "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n"
            "endloop\nendfacet\nendsolid a\n"
        ),
        "solids",
    ),
}
"""Files of one triangle, and what they hold beside it."""


@pytest.mark.parametrize("name", TRIANGLE)
def test_what_a_file_holds_beside_its_mesh_is_known(name, tmp_path) -> None:
    text, extras = TRIANGLE[name]
    (tmp_path / name).write_text(text)
    assert ", ".join(read_polygons(tmp_path / name).extras) == extras


def test_what_other_files_hold_beside_their_mesh_is_known(tmp_path) -> None:
    """Of binary STL, NPZ and glTF."""
    points, faces = np.eye(3, dtype=np.float32), np.array([[0, 1, 2]])
    facet = np.zeros(3, "f4").tobytes() + points.tobytes() + b"\1\0"
    (tmp_path / "a.stl").write_bytes(b"\0" * 80 + struct.pack("<I", 1) + facet)
    np.savez(tmp_path / "a.npz", vertices=points, faces=faces, normals=points, quality=points[0])
    data = base64.b64encode(points.tobytes()).decode()
    names = ("POSITION", "NORMAL", "TEXCOORD_1", "_ID")
    primitive = {"attributes": dict.fromkeys(names, 0), "material": 0}
    tree = {
        "buffers": [{"uri": f"data:,{data}", "byteLength": 36}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3}],
        "materials": [{}],
        "cameras": [{}],
        "meshes": [{"primitives": [primitive, primitive]}],
    }
    (tmp_path / "a.gltf").write_text(json.dumps(tree))
    found = {path.suffix: read_polygons(path).extras for path in tmp_path.iterdir()}
    assert found == {
        ".stl": ("attributes of triangles",),
        ".npz": ("normals", "quality"),
        ".gltf": ("normals", "TEXCOORD_1", "_ID", "objects", "materials", "cameras"),
    }


@pytest.mark.parametrize("ending", [".ply", ".obj", ".glb", ".npz"])
def test_colours_of_faces_are_painted_or_said_to_be_left_out(
    ending, tmp_path, caplog, monkeypatch
) -> None:
    """Flat, one to a face; a PLY file keeps them as they were, without a picture."""
    points, quads = grid()
    colours = np.random.default_rng(0).integers(0, 256, (len(quads), 3))
    header = ["ply", "format ascii 1.0", f"element vertex {len(points)}"]
    header += [f"property float {axis}" for axis in "xyz"]
    header += [f"element face {len(quads)}", "property list uchar int vertex_indices"]
    header += [*(f"property uchar {of}" for of in ("red", "green", "blue")), "end_header"]
    rows = [" ".join(map(str, point)) for point in points.tolist()]
    pairs = zip(quads, colours.tolist(), strict=True)
    rows += [" ".join(map(str, (4, *quad, *of))) for quad, of in pairs]
    source, out = tmp_path / "faces.ply", tmp_path / f"new{ending}"
    source.write_text("\n".join([*header, *rows, ""]))
    monkeypatch.setattr("parapoint.commands.mesh_output.TEXTURE", 256)
    written(source, out, None)
    assert ("colours of faces" in caplog.text) == (ending == ".npz")
    assert (tmp_path / "new.png").exists() == (ending == ".obj")
    if ending == ".glb":
        (tmp_path / "new.png").write_bytes(opened(out).image(0))
    if ending in {".obj", ".glb"}:
        shown = seen(out, np.asarray(Image.open(tmp_path / "new.png")), middles(source))
        assert np.array_equal(shown, colours[read_polygons(source).polygon_of])


@pytest.mark.parametrize("ending", [".ply", ".obj", ".glb"])
def test_colours_of_vertices_beneath_a_texture_are_said_to_be_left_out(
    ending, tmp_path, caplog
) -> None:
    """The texture is what the file shows; strips are no faces that can be written again."""
    Image.fromarray(old_picture()).save(tmp_path / "old.png")
    header = ["ply", "format ascii 1.0", "comment TextureFile old.png", "element vertex 4"]
    header += [f"property float {name}" for name in "xyzst"]
    header += [f"property uchar {name}" for name in ("red", "green", "blue")]
    header += ["element tristrips 1", "property list int int vertex_indices", "end_header"]
    rows = ["0 0 0 0 0 1 2 3", "1 0 0 1 0 4 5 6", "0 1 0 0 1 7 8 9", "1 1 0 1 1 1 2 3"]
    source = tmp_path / "strips.ply"
    source.write_text("\n".join([*header, *rows, "4 0 1 2 3", ""]))
    written(source, tmp_path / f"new{ending}")
    assert "what it shows in a texture; left out: colours" in caplog.text
    assert "would keep them" not in caplog.text


def middles(path) -> np.ndarray:
    mesh = read_polygons(path).mesh
    return mesh.vertices[mesh.faces].mean(axis=1)


def shows_the_old(path, picture, source) -> None:
    """Check that a file shows with `picture` what the textured sheet did."""
    at = middles(source)
    before = seen(source, old_picture(), at)
    before[at[:, 0] > SIDE - 1] = RED
    after = seen(path, picture, at).astype(int)
    assert np.abs(after - before).max() <= 6  # a texel of the old picture is four grey levels


@pytest.mark.parametrize("ending", [".obj", ".ply", ".glb"])
def test_an_old_texture_is_baked_into_the_new_uvs(ending, textured, tmp_path) -> None:
    out = tmp_path / f"new{ending}"
    written(textured, out)
    if ending == ".glb":
        tree = opened(out)
        (tmp_path / "new.png").write_bytes(tree.image(0))
    picture = np.asarray(Image.open(tmp_path / "new.png"))
    if ending == ".obj":  # the red material has no picture, before or after
        library = (tmp_path / "new.mtl").read_text()
        assert "map_Kd new.png" in library
        assert library.count("newmtl") == 2
        assert "Ns 12" in library
        assert "ump" not in library
        text = out.read_text()
        assert text.startswith("mtllib new.mtl\n")
        assert "old.mtl" not in text
        assert "usemtl red" in text
        assert text.count("\nf ") == SIDE**2
    shows_the_old(out, picture, textured)


def test_a_library_whose_pictures_are_missing_shows_none(textured, tmp_path, caplog) -> None:
    (tmp_path / "old one.png").unlink()
    written(textured, tmp_path / "new.obj")
    assert "map" not in (tmp_path / "new.mtl").read_text().partition("# ")[0]
    assert "left out: map_Bump, map_Kd" in caplog.text


def test_a_picture_that_cannot_be_read_is_one_line(textured, tmp_path) -> None:
    (tmp_path / "old one.png").write_bytes(b"\x89PNG nothing")
    with pytest.raises(InputError, match=r"sheet\.obj: .*old one\.png: is no picture"):
        written(textured, tmp_path / "new.obj")


def ply_sheet(path, text) -> None:
    """The sheet as PLY with all sorts of properties, of either encoding."""
    points, quads = grid()
    count = np.arange(len(points))
    names = [("double x", "d"), ("double y", "d"), ("double z", "d"), ("float u", "f")]
    names += [("float v", "f"), ("uchar red", "B"), ("int64 q", "q")]
    vertex = np.column_stack([points, points[:, :2] / SIDE, count, -count])
    kind = "ascii" if text else "binary_big_endian"
    header = ["ply", f"format {kind} 1.0", "comment TextureFile old one.png", "comment by hand"]
    header += [f"element vertex {len(points)}", *(f"property {name}" for name, _ in names)]
    header += [f"element face {len(quads)}", "property list uchar uint vertex_indices"]
    header += ["property uchar flags", "element edge 2", "property int vertex1"]
    header += ["property int vertex2", "end_header", ""]
    rows = [
        *(
            (codes, row)
            for codes in ["".join(code for _, code in names)]
            for row in vertex.tolist()
        ),
        *(("B4IB", [4, *quad, k]) for k, quad in enumerate(quads)),
        *(("2i", row) for row in ([0, 1], [1, 2])),
    ]
    if text:
        body = "\n".join(" ".join(f"{value:.9g}" for value in row) for _, row in rows).encode()
    else:
        body = b"".join(
            struct.pack(
                f">{codes}",
                *(v if c in "df" else int(v) for v, c in zip(row, spelt(codes), strict=True)),
            )
            for codes, row in rows
        )
    path.write_bytes("\n".join(header).encode() + body)


def spelt(codes) -> str:
    """Codes of struct without numbers of repetitions."""
    return codes.replace("4I", "IIII").replace("2i", "ii")


def elements(path) -> tuple[list[str], dict[str, Table]]:
    """The comments and the elements of a PLY file."""
    comments, tables = opened_ply(path.read_bytes())
    return comments, {table.name: table for table in tables}


@pytest.mark.parametrize("text", [True, False])
def test_a_ply_file_keeps_all_but_the_uvs(text, tmp_path) -> None:
    source, out = tmp_path / "old.ply", tmp_path / "new.ply"
    Image.fromarray(old_picture()).save(tmp_path / "old one.png")
    ply_sheet(source, text)
    placed = written(source, out)
    _, before = elements(source)
    comments, after = elements(out)
    assert comments == ["TextureFile new.png", "by hand"]
    count, seam = before["vertex"].count, SIDE + 1  # one copy of each vertex where x is 2
    assert after["vertex"].count == count + seam
    assert list(after["vertex"].columns) == ["x", "y", "z", "red", "q", "s", "t"]
    for name in ("x", "y", "z", "red", "q"):
        kept = after["vertex"].columns[name].values
        assert kept.dtype == before["vertex"].columns[name].values.dtype
        assert np.array_equal(kept[:count], before["vertex"].columns[name].values)
    assert np.array_equal(after["face"].columns["flags"].values, np.arange(SIDE**2))
    assert after["edge"].columns["vertex2"].values.tolist() == [1, 2]
    index = after["face"].columns["vertex_indices"].values
    original = -after["vertex"].columns["q"].values[index]
    assert np.array_equal(original, before["face"].columns["vertex_indices"].values)
    sizes = after["face"].columns["vertex_indices"].sizes
    assert np.array_equal(after["face"].columns["texcoord"].sizes, 2 * sizes)
    wedges = after["face"].columns["texcoord"].values.reshape(-1, 2)
    assert_allclose(wedges[:, 0], after["vertex"].columns["s"].values[index], atol=1e-6)
    own = read_parameterized(out)[1]
    assert_allclose(own.uv[own.corners], placed.map.uv[placed.map.corners])
    at = middles(source)
    after_colours = seen(out, np.asarray(Image.open(tmp_path / "new.png")), at).astype(int)
    assert np.abs(after_colours - seen(source, old_picture(), at)).max() <= 6


def test_a_seam_through_polygons_of_a_ply_file_makes_triangles(tmp_path) -> None:
    source, out = tmp_path / "old.ply", tmp_path / "new.ply"
    ply_sheet(source, text=False)
    given = read_polygons(source)
    apart = np.arange(3 * len(given.mesh.faces)).reshape(-1, 3)  # each triangle is a chart
    uv = np.random.default_rng(0).random((apart.size, 2))
    placed = Charted(given.mesh, Parameterization(uv, apart))
    output = mesh_output(given, str(source), str(out), None, 4)
    facts = output.write(placed, output.picture(placed))
    assert facts["polygons_split"] == SIDE**2
    flags = elements(out)[1]["face"].columns["flags"].values
    assert flags.tolist() == [k // 2 for k in range(2 * SIDE**2)]
    mesh, own = read_parameterized(out)
    assert_allclose(own.uv[own.corners], uv[apart])
    assert np.array_equal(mesh.vertices[mesh.faces], given.mesh.vertices[given.mesh.faces])


def glb_of(tree: dict, body: bytes) -> bytes:
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(body), b"BIN\0") + body
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def gltf_sheet(path, materials) -> None:
    """The sheet as GLB: colours, a second UV set, an animation, drawn twice, once mirrored."""
    points, quads = grid()
    faces = np.array([(a, b, c) for a, b, c, d in quads] + [(a, c, d) for a, b, c, d in quads])
    uv = points[:, :2] / SIDE * [1, -1] + [0, 1]
    colours = np.zeros((len(points), 4), np.uint8)
    colours[:, 0], colours[:, 3] = np.arange(len(points)), 255
    body, views, accessors = b"", [], []

    def add(values, kind, component, **more):
        nonlocal body
        data = np.ascontiguousarray(values).tobytes()
        views.append({"buffer": 0, "byteOffset": len(body), "byteLength": len(data)})
        body += data + b"\0" * (-len(data) % 4)
        item = {"bufferView": len(views) - 1, "componentType": component, "count": len(values)}
        accessors.append(item | {"type": kind} | more)
        return len(accessors) - 1

    low, high = points.min(axis=0).tolist(), points.max(axis=0).tolist()
    attributes = {
        "POSITION": add(points.astype(np.float32), "VEC3", 5126, min=low, max=high),
        "COLOR_0": add(colours, "VEC4", 5121, normalized=True),
        "TEXCOORD_0": add(uv.astype(np.float32), "VEC2", 5126),
        "TEXCOORD_1": add((uv / 2).astype(np.float32), "VEC2", 5126),
    }
    indices = add(faces.astype(np.uint16).reshape(-1, 1), "SCALAR", 5123)
    times = add(np.array([[0.0], [1.0]], np.float32), "SCALAR", 5126, min=[0], max=[1])
    moves = add(np.eye(3, dtype=np.float32)[:2], "VEC3", 5126)
    primitive = {"attributes": attributes, "indices": indices}
    tree = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0, 1]}],
        "nodes": [
            {"mesh": 0, "name": "one"},
            {"mesh": 0, "name": "other", "scale": [-1, 1, 1], "translation": [-9, 0, 0]},
        ],
        "meshes": [{"name": "sheet", "primitives": [primitive]}],
        "materials": materials,
        "animations": [
            {
                "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}],
                "samplers": [{"input": times, "output": moves}],
            }
        ],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(body)}],
    }
    if materials:
        primitive["material"] = 0
        tree["textures"] = [{"source": 0}]
        tree["images"] = [{"uri": "old%20one.png"}]
    path.write_bytes(glb_of(tree, body))


SHOWN = [{"name": "cloth", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]


@pytest.mark.parametrize("materials", [SHOWN, [{"name": "plain"}], []])
def test_a_glb_file_keeps_all_but_the_uvs(materials, tmp_path, caplog) -> None:
    source, out = tmp_path / "old.glb", tmp_path / "new.glb"
    Image.fromarray(old_picture()).save(tmp_path / "old one.png")
    gltf_sheet(source, materials)
    before = read_polygons(source)
    apart = np.arange(3 * len(before.mesh.faces)).reshape(-1, 3)
    uv = np.random.default_rng(0).random((apart.size, 2))
    output = mesh_output(before, str(source), str(out), 64, 4)
    output.check(force=False)
    placed = Charted(before.mesh, Parameterization(uv, apart))
    facts = output.write(placed, output.picture(placed))
    (tmp_path / "old one.png").unlink()  # it is inside the new file

    after = read_polygons(out)
    corners = before.mesh.vertices[before.mesh.faces]
    assert_allclose(after.mesh.vertices[after.mesh.faces], corners, atol=1e-6)
    tree = opened(out)
    number = 2 if materials == SHOWN else 0
    assert facts["uv_set"] == f"TEXCOORD_{number}"
    assert ("keep their own UVs" in caplog.text) == (number == 2)
    begin = 0
    assert [mesh["name"] for mesh in tree.tree["meshes"]] == ["sheet", "sheet"]
    assert [node["name"] for node in tree.tree["nodes"]] == ["one", "other"]
    for primitive, transform, *_ in tree.placed_primitives():
        attributes = primitive["attributes"]
        faces = tree.triangles(primitive)
        found = tree.accessor(attributes[f"TEXCOORD_{number}"])[faces] * [1, -1] + [0, 1]
        order = slice(None, None, -1) if np.linalg.det(transform) < 0 else slice(None)
        assert_allclose(found[:, order], uv[apart[begin : begin + len(faces)]], atol=1e-6)
        begin += len(faces)
        red = np.rint(255 * tree.accessor(attributes["COLOR_0"])[:, 0]).astype(int)
        assert_allclose(grid()[0][red], tree.accessor(attributes["POSITION"]), atol=1e-6)
        second = tree.accessor(attributes["TEXCOORD_1"])
        assert_allclose(second[:, 0], grid()[0][red, 0] / SIDE / 2, atol=1e-6)
    sampler = tree.tree["animations"][0]["samplers"][0]
    assert tree.accessor(sampler["output"]).tolist() == np.eye(3)[:2].tolist()
    if materials == SHOWN:
        with Image.open(io.BytesIO(tree.image(0))) as image:
            assert np.array_equal(np.asarray(image), old_picture())
    elif not materials:  # the colours of the vertices would tint a picture
        assert not tree.tree["materials"]
        assert "no texture is written: its own colours and materials stay" in caplog.text
    used = {
        i
        for mesh in tree.tree["meshes"]
        for p in mesh["primitives"]
        for i in p["attributes"].values()
    }
    assert len(tree.tree["accessors"]) == len(used) + 2 + 2  # and indices, and the animation


@pytest.mark.parametrize("ending", [".obj", ".ply"])
@pytest.mark.parametrize("has_colours", [False, True])
def test_a_glb_file_as_another_shows_its_texture(ending, has_colours, tmp_path, caplog) -> None:
    """Times the colours of its vertices, as light: their red grows from 0 to 24/255."""
    Image.fromarray(old_picture()).save(tmp_path / "old one.png")
    gltf_sheet(tmp_path / "old.glb", SHOWN)
    tree = opened(tmp_path / "old.glb").tree
    tree["nodes"] = tree["nodes"][:1]
    tree["scenes"][0]["nodes"] = [0]
    if not has_colours:
        del tree["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"]
    (tmp_path / "one.glb").write_bytes(glb_of(tree, opened(tmp_path / "old.glb").chunk))
    written(tmp_path / "one.glb", tmp_path / f"new{ending}")
    at = middles(tmp_path / "one.glb")
    picture = np.asarray(Image.open(tmp_path / "new.png"))
    after = seen(tmp_path / f"new{ending}", picture, at).astype(int)
    wanted = seen(tmp_path / "one.glb", old_picture(), at).astype(np.float64)
    if has_colours:
        light = ((wanted[:, 0] / 255 + 0.055) / 1.055) ** 2.4 * (5 * at[:, 0] + at[:, 1]) / 255
        wanted = np.stack([255 * srgb(light), 0 * light, 0 * light], axis=1)
    assert np.abs(after - wanted).max() <= 6
    assert "colours" not in caplog.text


def test_colours_that_do_not_tint_are_named(tmp_path, caplog) -> None:
    """A picture of a PLY file hides them."""
    source = tmp_path / "old.ply"
    rows = [f"{x} {y} 0 {x} {y} 9 9 9" for x, y in ((0, 0), (1, 0), (0, 1))]
    names = [f"float {name}" for name in "xyzst"] + ["uchar red", "uchar green", "uchar blue"]
    header = ["ply", "format ascii 1.0", "comment TextureFile old one.png", "element vertex 3"]
    header += [*(f"property {name}" for name in names), "element face 1"]
    header += ["property list uchar int vertex_indices", "end_header"]
    source.write_text("\n".join([*header, *rows, "3 0 1 2\n"]))
    Image.fromarray(old_picture()).save(tmp_path / "old one.png")
    written(source, tmp_path / "new.glb")
    assert "left out: colours. A .ply file would keep them" in caplog.text


@pytest.mark.parametrize(
    ("sampler", "wraps"),
    [
        ({}, ("repeat", "repeat")),
        ({"wrapS": 33071}, ("clamp", "repeat")),
        ({"wrapS": 10497, "wrapT": 33648}, ("repeat", "mirror")),
    ],
)
def test_the_sampler_of_a_gltf_texture_says_how_it_goes_on(sampler, wraps, tmp_path) -> None:
    source = tmp_path / "old.glb"
    Image.fromarray(old_picture()).save(tmp_path / "old one.png")
    gltf_sheet(source, SHOWN)
    scene = opened(source)
    scene.tree["textures"][0]["sampler"] = 0
    scene.tree["samplers"] = [sampler]
    source.write_bytes(glb_of(scene.tree, scene.chunk))
    given = read_polygons(source)
    assert painting_of(source, given.polygon_of, given.uv).materials[0].wraps == wraps


CLEAR = {"none": [255], "holes": [0, 255], "glass": [60, 120, 180], "soft": [255, 254, 1, 0]}
"""Alphas of the columns of a picture, by turns."""
MODES = {"none": None, "holes": "MASK", "glass": "BLEND", "soft": "MASK"}


def see_through(kind) -> np.ndarray:
    """(64, 64, 4) the old picture with columns eight wide of alphas."""
    alphas = np.array(CLEAR[kind], np.uint8)[np.arange(64) // 8 % len(CLEAR[kind])]
    return np.dstack([old_picture(), np.broadcast_to(alphas, (64, 64))])


@pytest.mark.parametrize("kind", CLEAR)
def test_what_an_obj_lets_through_stays(kind, textured, tmp_path, caplog) -> None:
    Image.fromarray(see_through(kind)).save(tmp_path / "old one.png")
    with (tmp_path / "old.mtl").open("a") as file:
        file.write("newmtl glass\nmap_Kd old one.png\nmap_d old one.png\n")
    written(textured, tmp_path / "new.glb")
    assert opened(tmp_path / "new.glb").tree["materials"][0].get("alphaMode") == MODES[kind]
    written(textured, tmp_path / "new.obj")
    picture = np.asarray(Image.open(tmp_path / "new.png"))
    assert picture.shape[2] == (3 if kind == "none" else 4)
    assert ("map_d new.png" in (tmp_path / "new.mtl").read_text()) == (kind != "none")
    assert ("left out: map_Bump, map_d" in caplog.text) == (kind == "none")


@pytest.mark.parametrize(
    ("material", "alpha"),
    [
        ({}, None),
        ({"alphaMode": "BLEND"}, 60),
        ({"alphaMode": "MASK"}, 0),
        ({"alphaMode": "MASK", "alphaCutoff": 0.25}, 0),
        ({"alphaMode": "MASK", "alphaCutoff": 0.2}, None),
        ({"alphaMode": "MASK", "alphaCutoff": 0}, None),
        ({"alphaMode": "BLEND", "factor": [1, 1, 1, 0.5]}, 30),
    ],
)
def test_what_a_gltf_lets_through_stays(material, alpha, tmp_path) -> None:
    """As its material says."""
    source = tmp_path / "old.glb"
    Image.fromarray(see_through("glass")).save(tmp_path / "old one.png")
    base = SHOWN[0]["pbrMetallicRoughness"] | {
        "baseColorFactor": material.pop("factor", [1, 1, 1, 1])
    }
    gltf_sheet(source, [material | {"pbrMetallicRoughness": base}])
    written(source, tmp_path / "new.obj")
    picture = np.asarray(Image.open(tmp_path / "new.png"))
    assert picture.shape[2] == (3 if alpha is None else 4)
    assert alpha is None or picture[..., 3].min() == alpha
    if alpha == 0:  # cut out, but for the texels at the very edges
        assert np.isin(picture[..., 3:], [0, 255]).mean() > 0.8
    library = (tmp_path / "new.mtl").read_text()
    assert ("map_Kd new.png\nmap_d new.png\n" in library) == (alpha is not None)


SPECULAR = "KHR_materials_pbrSpecularGlossiness"
WEBP = {"EXT_texture_webp": {"source": 0}}
KTX = {"KHR_texture_basisu": {"source": 0}}
ROSE = {"diffuseFactor": [1.0, 0.25, 0.25, 1.0], "diffuseTexture": {"index": 0}}


@pytest.mark.parametrize(
    ("extensions", "image", "material"),
    [
        (WEBP, "webp", SHOWN[0]),
        (KTX, "ktx", SHOWN[0]),
        (KTX, "jpeg", {"extensions": {SPECULAR: ROSE}}),
        ({}, "png", {"extensions": {SPECULAR: ROSE}, **SHOWN[0]}),
    ],
)
def test_pictures_of_gltf_extensions_are_seen_or_named(
    extensions, image, material, tmp_path, caplog
) -> None:
    source, picture = tmp_path / "old.glb", tmp_path / "old one.png"
    if image == "ktx":
        picture.write_bytes(b"\xabKTX 20\xbb\r\n\x1a\n")
    else:
        Image.fromarray(old_picture()).save(picture, format=image)
    gltf_sheet(source, [material])
    scene = opened(source)
    scene.tree["textures"] = [{"extensions": extensions} if extensions else {"source": 0}]
    source.write_bytes(glb_of(scene.tree, scene.chunk))
    given = read_polygons(source)
    painting = painting_of(source, given.polygon_of, given.uv)
    if image == "ktx":
        assert painting is None
        said = "old%20one.png is left out: KTX 2 is not read; export it as PNG or JPEG"
        assert caplog.messages == [f"{source}: the picture {said}"]
    else:
        assert painting.largest == 64
        rose = "extensions" in material
        assert painting.materials[0].colour == ((255, 137, 137) if rose else (255, 255, 255))
        assert not caplog.messages
    written(source, tmp_path / "new.glb")  # which keeps the picture
    kind = {"ktx": "image/ktx2"}.get(image, f"image/{image}")
    assert opened(tmp_path / "new.glb").tree["images"][0]["mimeType"] == kind


def test_instances_are_refused_before_any_work(tmp_path) -> None:
    gltf_sheet(tmp_path / "old.glb", [])
    source = opened(tmp_path / "old.glb")
    source.tree["nodes"][0]["extensions"] = {
        "EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 6}}
    }
    (tmp_path / "many.glb").write_bytes(glb_of(source.tree, source.chunk))
    given = read_polygons(tmp_path / "many.glb")
    output = mesh_output(given, str(tmp_path / "many.glb"), str(tmp_path / "new.glb"), None, 4)
    with pytest.raises(InputError, match=r"many\.glb: draws instances"):
        output.check(force=False)


@pytest.mark.parametrize("ending", [".ply", ".obj"])
def test_colours_of_vertices_are_painted(ending, tmp_path) -> None:
    source, out = tmp_path / f"old{ending}", tmp_path / "new.glb"
    points, quads = grid()
    vertex = [f"{x} {y} {z} {40 * round(x)} {40 * round(y)} 7" for x, y, z in points]
    names = [*"xyz", "red", "green", "blue"]
    header = ["ply", "format ascii 1.0", f"element vertex {len(points)}"]
    header += [f"property {'double' if n in 'xyz' else 'uchar'} {n}" for n in names]
    header += [f"element face {len(quads)}", "property list uchar int vertex_indices", "end_header"]
    faces = ["4 " + " ".join(map(str, quad)) for quad in quads]
    if ending == ".obj":
        header, vertex = [], [f"v {row}" for row in vertex]
        faces = ["f " + " ".join(str(at + 1) for at in quad) for quad in quads]
    source.write_text("\n".join([*header, *vertex, *faces]) + "\n")
    written(source, out)
    picture = tmp_path / "new.png"
    picture.write_bytes(opened(out).image(0))
    at = middles(source)
    wanted = np.column_stack([40 * at[:, :2], np.full(len(at), 7)])
    assert np.abs(seen(out, np.asarray(Image.open(picture)), at) - wanted).max() <= 2


@pytest.mark.parametrize("strip", ["face 0", "face 1"])
def test_strips_are_painted_and_become_faces(strip, tmp_path) -> None:
    """Beside faces or alone; a file of strips is written anew as its triangles."""
    points = [f"{x} {y} {x * y}" for x in range(3) for y in range(3)]
    lists = "property list uchar int vertex_indices"
    header = ["ply", "format ascii 1.0", "comment TextureFile old one.png", "element vertex 9"]
    header += [*(f"property float {axis}" for axis in "xyz"), "property float s"]
    header += ["property float t", f"element {strip}", lists, "element tristrips 1", lists]
    face = ["4 4 7 8 5"] * int(strip[-1])
    rows = [f"{row} {0.1 * k} {0.2}" for k, row in enumerate(points)] + face
    (tmp_path / "old.ply").write_text("\n".join([*header, "end_header", *rows, "6 0 3 1 4 2 5"]))
    Image.fromarray(old_picture()).save(tmp_path / "old one.png")
    given = read_polygons(tmp_path / "old.ply")
    assert len(given.mesh.faces) == 4 + 2 * len(face)
    painting = painting_of(tmp_path / "old.ply", given.polygon_of, given.uv)
    assert painting.largest == 64
    output = mesh_output(given, str(tmp_path / "old.ply"), str(tmp_path / "new.ply"), None, 4)
    assert not output.is_rewritten


def test_a_side_file_of_the_user_stays(tmp_path) -> None:
    ply_sheet(tmp_path / "old.ply", text=False)
    Image.fromarray(old_picture()).save(tmp_path / "old one.png")
    (tmp_path / "new.png").write_bytes(b"mine")
    given = read_polygons(tmp_path / "old.ply")
    output = mesh_output(given, str(tmp_path / "old.ply"), str(tmp_path / "new.ply"), None, 4)
    with pytest.raises(InputError, match=r"new\.png: is a file of yours"):
        output.check(force=False)


def test_one_colour_alone_is_no_painting(tmp_path) -> None:
    points, quads = grid()
    faces = np.array([(a, b, c) for a, b, c, _ in quads])
    placed = new_map(faces, points)
    write_ply(tmp_path / "a.ply", placed)
    given = read_polygons(tmp_path / "a.ply")
    assert painting_of(tmp_path / "a.ply", given.polygon_of, given.uv) is None
    write_glb(tmp_path / "a.glb", placed, old_picture())
    given = read_polygons(tmp_path / "a.glb")
    painting = painting_of(tmp_path / "a.glb", given.polygon_of, given.uv)
    assert painting.largest == 64
