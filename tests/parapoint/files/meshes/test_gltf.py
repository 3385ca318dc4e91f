"""glTF files as scanners, viewers and packers write them, and the arrays that are meant."""

import base64
import io
import json
import re
import struct
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from PIL import Image

from parapoint import InputError, Mesh, PointCloud
from parapoint.files.attributes import unit_colours
from parapoint.files.meshes.gltf import opened
from parapoint.files.meshes.painting import painting_of
from parapoint.files.reading import FORMATS, Polygons, read_polygons, read_surface
from parapoint.files.writing.gltf_rewriting import rewrite_gltf
from parapoint.surfaces.parameterization import Parameterization

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], "<f4")
TRIANGLES = np.array([0, 1, 2, 0, 2, 3], "<u2")
COMPONENTS = {"int8": 5120, "uint8": 5121, "uint16": 5123, "uint32": 5125, "float32": 5126}
COLOURS = np.array([[1, 0, 0, 1], [0, 1, 0, 1], [0.2, 0.2, 0.2, 1], [1, 1, 1, 1]])
"""Linear, as glTF has them."""
SHOWN = np.array([[1, 0, 0], [0, 1, 0], [0.4845, 0.4845, 0.4845], [1, 1, 1]])
"""The same in sRGB."""


def scene(arrays: list[npt.NDArray[Any]], *primitives: dict[str, Any], **more: Any) -> Any:
    """The tree of a scene of these primitives, whose accessors are of these arrays."""
    views, accessors, body = [], [], b""
    for array in arrays:
        data = np.ascontiguousarray(array).tobytes()
        views.append({"buffer": 0, "byteOffset": len(body), "byteLength": len(data)})
        body += data + b"\0" * (-len(data) % 4)
        kind = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}[array.ndim and array.size // len(array)]
        accessors.append({"bufferView": len(views) - 1, "count": len(array), "type": kind})
        accessors[-1]["componentType"] = COMPONENTS[array.dtype.name]
    uri = "data:application/octet-stream;base64," + base64.b64encode(body).decode()
    return {
        "asset": {"version": "2.0"},
        "buffers": [{"uri": uri, "byteLength": len(body)}],
        "bufferViews": views,
        "accessors": accessors,
        "meshes": [{"primitives": list(primitives)}],
        "nodes": [{"mesh": 0}],
        **more,
    }


def saved(folder: Path, tree: Any, name: str = "a.gltf") -> Path:
    (folder / name).write_text(json.dumps(tree))
    return folder / name


def cloud_of(folder: Path, tree: Any) -> PointCloud:
    cloud = read_surface(saved(folder, tree))
    assert isinstance(cloud, PointCloud)
    return cloud


@pytest.mark.parametrize("width", [3, 4])
@pytest.mark.parametrize("kind", ["float32", "uint8", "uint16"])
@pytest.mark.parametrize("normalised", [True, False])
def test_points_have_their_colours(tmp_path: Path, width: int, kind: str, normalised: bool) -> None:
    """Of every type that glTF allows, and where `normalized` was forgotten."""
    most = 1 if kind == "float32" else np.iinfo(kind).max
    colours = (COLOURS[:, :width] * most).astype(kind)
    primitive = {"attributes": {"POSITION": 0, "COLOR_0": 1}, "mode": 0}
    tree = scene([SQUARE, colours], primitive)
    tree["accessors"][1]["normalized"] = normalised
    cloud = cloud_of(tmp_path, tree)
    assert_array_equal(cloud.points, SQUARE)
    assert_allclose(np.float64(unit_colours(cloud.attributes["colours"])), SHOWN, atol=0.003)


def painted_square(folder: Path, *, has_colours: bool) -> Path:
    """Two triangles, each in a colour of its own, with four vertices at their common edge."""
    corners, colours = SQUARE[TRIANGLES], COLOURS[[0, 0, 0, 1, 1, 1]].astype("float32")
    attributes = {"POSITION": 0, "COLOR_0": 1} if has_colours else {"POSITION": 0}
    return saved(folder, scene([corners, colours], {"attributes": attributes}))


def test_faces_keep_their_own_colours(tmp_path: Path) -> None:
    """Vertices at one place are one only if they have one colour."""
    given = read_polygons(painted_square(tmp_path, has_colours=True))
    assert isinstance(given, Polygons)
    assert given.colours is not None
    assert len(given.mesh.vertices) == 6
    assert_allclose(given.colours[given.mesh.faces][:, :, :3], SHOWN[[[0] * 3, [1] * 3]], atol=3e-3)
    bare = read_polygons(painted_square(tmp_path, has_colours=False))
    assert isinstance(bare, Polygons)
    assert len(bare.mesh.vertices) == 4
    assert bare.colours is None


@pytest.mark.parametrize("has_colours", [True, False])
def test_a_mesh_without_materials_gets_one_unless_it_has_colours(
    tmp_path: Path, has_colours: bool
) -> None:
    """They would tint its picture."""
    source, out = painted_square(tmp_path, has_colours=has_colours), tmp_path / "out.glb"
    uv = np.random.default_rng(0).random((6, 2))
    grey = np.full((8, 8, 3), 127, np.uint8)
    rewrite_gltf(source, out, Parameterization(uv, np.arange(6).reshape(2, 3)), grey)
    written = opened(out)
    (primitive,) = written.tree["meshes"][0]["primitives"]
    assert ("material" in primitive) is not has_colours
    assert ("COLOR_0" in primitive["attributes"]) is has_colours
    if not has_colours:
        with Image.open(io.BytesIO(written.image(0))) as image:
            assert_array_equal(np.asarray(image), grey)


def test_points_without_colours_have_that_of_their_material(tmp_path: Path) -> None:
    """Beside others that have some, which it multiplies; transparency is kept."""
    tree = scene(
        [SQUARE, COLOURS.astype("<f4")],
        {"attributes": {"POSITION": 0, "COLOR_0": 1}, "mode": 0},
        {"attributes": {"POSITION": 0}, "mode": 0, "material": 0},
        {"attributes": {"POSITION": 0, "COLOR_0": 1}, "mode": 0, "material": 0},
        materials=[{"pbrMetallicRoughness": {"baseColorFactor": [0, 1, 1, 0.5]}}],
    )
    found = cloud_of(tmp_path, tree).attributes["colours"]
    assert_array_equal(found[4:8], [[0, 1, 1, 0.5]] * 4)
    assert_allclose(found[8:, 1:3], SHOWN[:, 1:], atol=1e-4)
    assert_array_equal(found[8:, 0], 0)


def test_points_without_any_colour_have_none(tmp_path: Path) -> None:
    tree = scene([SQUARE], {"attributes": {"POSITION": 0}, "mode": 0})
    assert not cloud_of(tmp_path, tree).attributes


@pytest.mark.parametrize("rows", [[0, 2], [3, 3, 1], [2]])
def test_indices_choose_points(tmp_path: Path, rows: list[int]) -> None:
    """Points and their colours; others are not drawn."""
    primitive = {"attributes": {"POSITION": 0, "COLOR_0": 1}, "mode": 0, "indices": 2}
    arrays = [SQUARE, COLOURS.astype("<f4"), np.array(rows, "<u4")]
    cloud = cloud_of(tmp_path, scene(arrays, primitive))
    assert_array_equal(cloud.points, SQUARE[rows])
    assert_allclose(cloud.attributes["colours"], SHOWN[rows], atol=1e-4)


@pytest.mark.parametrize(
    ("arrays", "says"),
    [
        ([SQUARE, np.array([0, 4], "<u4"), SQUARE], "a vertex index is out of range"),
        ([SQUARE, np.array([0, 1], "<u4"), SQUARE[:3]], "3 colours for 4 vertices"),
    ],
)
def test_faulty_points_are_refused(
    tmp_path: Path, arrays: list[npt.NDArray[Any]], says: str
) -> None:
    primitive = {"attributes": {"POSITION": 0, "COLOR_0": 2}, "mode": 0, "indices": 1}
    with pytest.raises(InputError, match=says):
        cloud_of(tmp_path, scene(arrays, primitive))


SQUARE_OF_TRIANGLES = {"attributes": {"POSITION": 0}, "indices": 1}


@pytest.mark.parametrize(
    ("other", "says"),
    [
        ({"attributes": {}}, "1 of 2 primitives are not mapped: 1 without POSITION"),
        ({"attributes": {"COLOR_0": 0}, "mode": 0}, "1 without POSITION, 0 of points or lines"),
        ({"attributes": {"POSITION": 0}, "mode": 0}, "0 without POSITION, 1 of points or lines"),
        ({"attributes": {"POSITION": 0}, "mode": 3}, "0 without POSITION, 1 of points or lines"),
    ],
)
@pytest.mark.parametrize("first", [True, False])
def test_other_primitives_are_passed_over_with_a_word(
    tmp_path: Path,
    other: dict[str, Any],
    says: str,
    first: bool,
    caplog: pytest.LogCaptureFixture,
) -> None:
    """And kept where the file is written anew."""
    both = [other, SQUARE_OF_TRIANGLES] if first else [SQUARE_OF_TRIANGLES, other]
    path = saved(tmp_path, scene([SQUARE, TRIANGLES], *both))
    given = read_polygons(path)
    assert not isinstance(given, PointCloud)
    assert len(given.mesh.faces) == 2
    assert says in caplog.text
    made = Parameterization(SQUARE[:, :2].astype(float), given.mesh.faces)
    rewrite_gltf(path, tmp_path / "b.glb", made, np.zeros((2, 2, 3), np.uint8))
    again = opened(tmp_path / "b.glb").tree["meshes"][0]["primitives"]
    assert [primitive.get("mode", 4) for primitive in again] == [
        primitive.get("mode", 4) for primitive in both
    ]


def test_a_file_without_any_position_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="has no triangle and no point"):
        read_surface(saved(tmp_path, scene([SQUARE], {"attributes": {}})))


@pytest.mark.parametrize("version", ["1.0", "1.1", 1, "3.0"])
def test_other_versions_are_named(tmp_path: Path, version: Any) -> None:
    """In text and in binary."""
    tree = scene([SQUARE, TRIANGLES], SQUARE_OF_TRIANGLES, asset={"version": version})
    if str(version) < "2":
        tree["meshes"] = {"mesh": tree["meshes"][0]}
    with pytest.raises(InputError, match=f"is glTF {version}; glTF 2 is read: convert it"):
        read_surface(saved(tmp_path, tree))
    number = int(float(version))
    (tmp_path / "a.glb").write_bytes(struct.pack("<4sIIII", b"glTF", number, 20, 0, 0))
    with pytest.raises(InputError, match=f"is binary glTF {number}; glTF 2 is read"):
        read_surface(tmp_path / "a.glb")


def test_files_are_known_by_their_first_bytes(tmp_path: Path) -> None:
    """A GLB named .gltf, and a text named .glb; the ending is not asked."""
    text = saved(tmp_path, scene([SQUARE, TRIANGLES], SQUARE_OF_TRIANGLES), "text.glb")
    made = Parameterization(SQUARE[:, :2].astype(float), TRIANGLES.reshape(-1, 3))
    rewrite_gltf(text, tmp_path / "a.glb", made, np.zeros((2, 2, 3), np.uint8))
    binary = (tmp_path / "a.glb").rename(tmp_path / "binary.gltf")
    assert binary.read_bytes().startswith(b"glTF")
    for path in (text, binary):
        mesh = read_surface(path)
        assert isinstance(mesh, Mesh)
        assert mesh.face_areas.sum() == 1
    assert FORMATS[".glb"] is FORMATS[".gltf"]


DRACO = {"KHR_draco_mesh_compression": {"bufferView": 2, "attributes": {"POSITION": 0}}}
VARIANTS = {"KHR_materials_variants": {"mappings": [{"variants": [0], "material": 0}]}}


@pytest.mark.parametrize(
    ("extensions", "stays"),
    [
        (DRACO, False),
        ({"CESIUM_primitive_outline": {"indices": 1}}, False),
        ({"MY_shape": {"levels": [{"accessor": 1}]}}, False),
        ({"EXT_mesh_features": {"featureIds": [{"featureCount": 3, "propertyTable": 0}]}}, False),
        (VARIANTS, True),
        ({"MY_note": {"text": "hand made"}}, True),
    ],
)
@pytest.mark.parametrize("at", ["primitive", "view", "tree"])
def test_extensions_that_number_data_are_left_out(
    tmp_path: Path,
    extensions: dict[str, Any],
    stays: bool,
    at: str,
    caplog: pytest.LogCaptureFixture,
) -> None:
    """Views and accessors are numbered anew, so the old numbers would name others."""
    unused = np.zeros((9, 3), "<f4")
    primitive = json.loads(json.dumps(SQUARE_OF_TRIANGLES))
    tree = scene([SQUARE, TRIANGLES, unused], primitive)
    held = {"primitive": primitive, "view": tree["bufferViews"][0], "tree": tree}[at]
    held["extensions"] = extensions | {"MY_mark": {}}
    tree["extensionsUsed"] = [*extensions, "MY_mark"]
    path = saved(tmp_path, tree)
    made = Parameterization(SQUARE[:, :2].astype(float), TRIANGLES.reshape(-1, 3))
    rewrite_gltf(path, tmp_path / "b.glb", made, np.zeros((2, 2, 3), np.uint8))
    again = opened(tmp_path / "b.glb").tree
    (name,) = extensions
    assert again["extensionsUsed"] == ([name, "MY_mark"] if stays else ["MY_mark"])
    assert (name in caplog.text) is not stays
    if at != "view":  # that view is no longer there
        assert (
            f'"{name}"' in json.dumps(again["meshes"]) + json.dumps(again.get("extensions"))
        ) is stays


def test_a_file_without_extensions_is_copied_without_a_word(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = saved(tmp_path, scene([SQUARE, TRIANGLES], SQUARE_OF_TRIANGLES, extensionsUsed=["MY"]))
    made = Parameterization(SQUARE[:, :2].astype(float), TRIANGLES.reshape(-1, 3))
    rewrite_gltf(path, tmp_path / "b.glb", made, np.zeros((2, 2, 3), np.uint8))
    assert opened(tmp_path / "b.glb").tree["extensionsUsed"] == ["MY"]
    assert not caplog.text


@pytest.mark.parametrize(
    "uri",
    [
        "deep/an%20image.bin",
        "deep/an image.bin",
        "DEEP\\An Image.BIN",
        "C:\\models\\an image.bin",
        "../elsewhere/flat.bin",
        "flat.bin",
        "per%20cent.bin",
    ],
)
def test_files_are_found_as_other_programs_name_them(uri: str, tmp_path: Path) -> None:
    """In the folder or below, in place of others that are named outside of it."""
    folder = tmp_path / "scene"
    for name in ("deep/an image.bin", "an image.bin", "flat.bin", "per%20cent.bin"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(b"here")
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "flat.bin").write_bytes(b"there")
    tree = scene([SQUARE], {"attributes": {"POSITION": 0}}, images=[{"uri": uri}])
    tree["buffers"].append({"uri": uri, "byteLength": 4})
    file = opened(saved(folder, tree))
    assert file.image(0) == file.buffer(1) == b"here"


@pytest.mark.parametrize(
    ("uri", "said"),
    [
        ("gone.png", "names 'gone.png', which is not found; put 'gone.png' beside it"),
        ("../a%20b.png", "names '../a%20b.png', which lies outside of its folder; put 'a b.png'"),
        ("data:image/png;base64,AAAA", "image 0: is no picture of a kind that is read; save it as"),
        ("text.png", "text.png: is no picture of a kind that is read; save it as PNG or JPEG"),
    ],
)
def test_a_picture_that_cannot_be_read_is_named(uri: str, said: str, tmp_path: Path) -> None:
    folder = tmp_path / "scene"
    folder.mkdir()
    Image.new("RGB", (2, 3)).save(tmp_path / "a b.png")
    (folder / "text.png").write_text("none")
    shown = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
    drawn = {"attributes": {"POSITION": 0}, "indices": 1, "material": 0}
    tree = scene([SQUARE, TRIANGLES], drawn, materials=[shown], textures=[{"source": 0}])
    path = saved(folder, tree | {"images": [{"uri": uri}]})
    with pytest.raises(InputError, match="^" + re.escape(said)):
        painting_of(path, np.arange(2), np.zeros((2, 3, 2)))
