"""Material libraries as other programs write them, and the colours and pictures that are meant."""

import gzip
from pathlib import Path
from typing import Literal
from unicodedata import normalize

import numpy as np
import pytest
from PIL import Image

from parapoint.commands.mesh_output import mesh_output
from parapoint.files.meshes.materials import materials_of, named_libraries
from parapoint.files.meshes.painting import painting_of
from parapoint.files.reading import Polygons, read_polygons
from parapoint.files.writing.obj_rewriting import write_library
from parapoint.surfaces.parameterization import Charted, Parameterization

RED, BLUE, WHITE = (255, 0, 0), (0, 0, 255), (255, 255, 255)
LIBRARY = "newmtl red\nKd 1 0 0\nnewmtl blue\nKd 0 0 1\n"
MODEL = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nusemtl red\nf 1 2 3\nusemtl blue\nf 1 3 4\n"
PLY = (
    "ply\nformat ascii 1.0\ncomment TextureFile old\\One.PNG\nelement vertex 3\n"
    "property float x\nproperty float y\nproperty float z\nproperty float u\nproperty float v\n"
    "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    "0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 1\n3 0 1 2\n"
)
"""A triangle that shows a picture."""


def model(folder: Path, libraries: str, text: str = MODEL) -> Path:
    path = folder / "a.obj"
    path.write_text(f"mtllib {libraries}\n{text}")
    return path


def polygons(path: Path) -> Polygons:
    found = read_polygons(path)
    assert isinstance(found, Polygons)
    return found


def colours(path: Path) -> list[tuple[int, int, int]]:
    """What each triangle shows; [] where all show the same."""
    given = polygons(path)
    painting = painting_of(path, given.polygon_of, given.uv)
    return [] if painting is None else [painting.materials[k].colour for k in painting.material_of]


def rewritten(path: Path, out: Path) -> Path:
    """The file with another map."""
    given = polygons(path)
    uv = np.random.default_rng(0).random((len(given.mesh.vertices), 2))
    placed = Charted(given.mesh, Parameterization(uv, given.mesh.faces))
    output = mesh_output(given, str(path), str(out), 8, 1)
    output.write(placed, output.picture(placed))
    return out


@pytest.mark.parametrize(
    "words",
    [
        "my colours.mtl",
        "my colours.mtl  # of 2020",
        '"my colours.mtl"',
        "'my colours.mtl'",
        ".\\my colours.mtl",
        "C:\\models\\my colours.mtl",
        "My Colours.MTL",
        "other.mtl my colours.mtl",
        "my colours.mtl other.mtl # both",
        '"other.mtl" "my colours.mtl"',
        "other.mtl\nmtllib my colours.mtl",
    ],
)
def test_libraries_are_found(words: str, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Also by a file that is rewritten in another folder."""
    (tmp_path / "my colours.mtl").write_text(LIBRARY)
    (tmp_path / "other.mtl").write_text("newmtl green\nKd 0 1 0\n")
    path = model(tmp_path, words)
    assert colours(path) == [RED, BLUE]
    (tmp_path / "deep").mkdir()
    assert colours(rewritten(path, tmp_path / "deep" / "b.obj")) == [RED, BLUE]
    assert not caplog.text


def test_a_library_lies_in_a_folder_of_another_case(tmp_path: Path) -> None:
    """Unless there are two."""
    (tmp_path / "Lib").mkdir()
    (tmp_path / "Lib" / "A.mtl").write_text(LIBRARY)
    assert named_libraries(tmp_path, rb"LIB\a.MTL") == [tmp_path / "Lib" / "A.mtl"]
    (tmp_path / "Lib" / "a.mtl").write_text(LIBRARY)
    assert named_libraries(tmp_path, rb"LIB\a.MTL") == [tmp_path / "LIB" / "a.MTL"]
    assert named_libraries(tmp_path, b"a" * 300) == [tmp_path / ("a" * 300)]


@pytest.mark.parametrize(
    "library",
    [
        LIBRARY.replace(" ", "\t"),
        LIBRARY.replace("\n", "\r\n"),
        LIBRARY.replace("\n", "\r"),
        LIBRARY.replace("newmtl", "\t Newmtl").replace("Kd", "  KD "),
        LIBRARY.replace("red", "red  # warm").replace("1\n", "1 # cold\n"),
        LIBRARY.replace("red", '"red"').replace("blue", "'blue'"),
        LIBRARY.replace("1 0 0", "1,0 0,0 0,0"),
        LIBRARY.replace("Kd 0", "Kd \\\n 0"),
        "# from C:\\old\\\n" + LIBRARY,
        "\ufeff" + LIBRARY,
        LIBRARY.replace("newmtl blue", "newmtl grey\nKd 0.2\nnewmtl blue"),
    ],
)
def test_libraries_of_other_writers(library: str, tmp_path: Path) -> None:
    (tmp_path / "a.mtl").write_bytes(library.encode())
    assert colours(model(tmp_path, "a.mtl")) == [RED, BLUE]


def test_names_of_materials_may_hold_what_begins_a_comment(tmp_path: Path) -> None:
    library = LIBRARY.replace("red", "Material #1").replace("blue", "Material #2")
    (tmp_path / "a.mtl").write_text(library)
    named = MODEL.replace("red", "Material #1").replace("blue", "Material #2")
    assert colours(model(tmp_path, "a.mtl", named)) == [RED, BLUE]
    (tmp_path / "a.mtl").write_text("newmtl grey\nKd 0.2\n" + LIBRARY)
    named = MODEL.replace("red", "red # warm").replace("blue", '"blue"')
    assert colours(model(tmp_path, "a.mtl", named)) == [RED, BLUE]
    assert materials_of([tmp_path / "a.mtl"])["grey"].colour == (51, 51, 51)


@pytest.mark.parametrize(
    ("data", "fault"),
    [
        (None, "is not found"),
        (b"", "is empty"),
        (b" \n", "is empty"),
        (gzip.compress(LIBRARY.encode(), mtime=0), "is packed by gzip; unpack it first"),
    ],
)
def test_a_library_that_cannot_be_read_is_named(
    data: bytes | None, fault: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """The model is read, and so are its other libraries."""
    if data is not None:
        (tmp_path / "b.mtl").write_bytes(data)
    path = model(tmp_path, "b.mtl\nmtllib b.mtl")
    assert colours(path) == []
    said = f"{tmp_path / 'b.mtl'}: its materials are not known: it {fault}"
    assert caplog.messages == [said]
    rewritten(path, tmp_path / "c.obj")
    (tmp_path / "a.mtl").write_text(LIBRARY)
    assert colours(model(tmp_path, "b.mtl a.mtl")) == [RED, BLUE]
    assert caplog.messages == 3 * [said]


def test_a_folder_is_no_library(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    (tmp_path / "b.mtl").mkdir()
    assert colours(model(tmp_path, "b.mtl")) == []
    assert "it is not found" in caplog.text


def test_materials_that_no_library_holds_are_named(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "a.mtl").write_text(LIBRARY.replace("blue", "azure"))
    path = model(tmp_path, "a.mtl")
    assert colours(path) == [RED, WHITE]
    assert caplog.messages == [f"{path}: no library holds its materials blue"]


@pytest.mark.parametrize(
    "words",
    [
        "old one.png",
        "-s 1 1 1 -clamp on\told one.png",
        '"old one.png" # scanned',
        "Old One.PNG",
        "D:\\pictures\\old one.png",
        "/nowhere/old one.png",
    ],
)
@pytest.mark.parametrize("key", ["map_Kd ", "\tMAP_KD\t"])
def test_pictures_are_found(words: str, key: str, tmp_path: Path) -> None:
    Image.new("RGB", (2, 3), RED).save(tmp_path / "old one.png")
    library = tmp_path / "a.mtl"
    library.write_text(f"newmtl red\n{key}{words}\n")
    picture = materials_of([library])["red"].picture
    assert picture is not None
    assert picture.shape == (3, 2, 3)


@pytest.mark.parametrize(
    ("options", "uv", "wraps"),
    [
        ("-s 2 3 1", (0.5, 1.5), ("repeat", "repeat")),
        ("-s 2", (0.5, 0.5), ("repeat", "repeat")),
        ("-o .25 -0.1 0", (0.5, 0.4), ("repeat", "repeat")),
        ("-o 5e-1", (0.75, 0.5), ("repeat", "repeat")),
        ("-clamp on -o 1 1 -s 4 1", (2, 1.5), ("clamp", "clamp")),
        ("-clamp off -mm 0 1 -t 1 1 1", (0.25, 0.5), ("repeat", "repeat")),
    ],
)
def test_options_place_a_picture(
    options: str, uv: tuple[float, float], wraps: tuple[str, str], tmp_path: Path
) -> None:
    """Where u is 1/4 and v is 1/2; those of map_d do not count beside map_Kd."""
    Image.new("RGB", (2, 3), RED).save(tmp_path / "old 1.png")
    mask = "map_d -s 7 7 7 -clamp on old 1.png\n"
    (tmp_path / "a.mtl").write_text(
        f"newmtl red\n{mask}map_Kd {options} old 1.png\nKd 0 0 0\n{mask}"
    )
    corners = "vt 0.25 0.5\n" + MODEL.replace("f 1 2 3", "f 1/1 2/1 3/1")
    given = polygons(path := model(tmp_path, "a.mtl", corners))
    painting = painting_of(path, given.polygon_of, given.uv)
    assert painting is not None
    np.testing.assert_allclose(painting.uv[0], [uv] * 3)
    assert painting.materials[1].wraps == wraps


@pytest.mark.parametrize(
    ("lines", "seen"),
    [
        ("map_d alpha.png\nmap_Kd alpha.png", (9, 9, 9, 51)),
        ("map_Kd red.png\nmap_d -imfchan m grey.png", (*RED, 102)),
        ("map_Kd red.png\nmap_d alpha.png", (*RED, 51)),
        ("map_Kd alpha.png\nmap_d grey.png", (9, 9, 9, 102)),
        ("map_d grey.png\nKd 0 0 1", (*BLUE, 102)),
        ("map_Kd red.png\nmap_d red.png", RED),
    ],
)
def test_a_picture_lets_be_seen_what_another_shows(
    lines: str, seen: tuple[int, ...], tmp_path: Path
) -> None:
    """Also one of another size."""
    Image.new("RGBA", (2, 3), (9, 9, 9, 51)).save(tmp_path / "alpha.png")
    Image.new("RGB", (2, 3), RED).save(tmp_path / "red.png")
    Image.new("L", (5, 4), 102).save(tmp_path / "grey.png")
    (tmp_path / "a.mtl").write_text(f"newmtl a\n{lines}\n")
    picture = materials_of([tmp_path / "a.mtl"])["a"].picture
    assert picture is not None
    assert np.unique(picture.reshape(-1, len(seen)), axis=0).tolist() == [list(seen)]


def test_a_picture_that_is_missing_is_named(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    library = tmp_path / "a.mtl"
    library.write_text(LIBRARY + "map_Kd gone.png\nnewmtl grey\nmap_Kd -bm 1 gone.png\n")
    assert colours(model(tmp_path, "a.mtl")) == [RED, BLUE]
    assert caplog.messages == [f"{library}: pictures that are not found are left out: gone.png"]


@pytest.mark.parametrize("encoding", ["utf-8", "cp1252"])
@pytest.mark.parametrize("form", ["NFC", "NFD"])
@pytest.mark.parametrize("ending", [".obj", ".ply"])
def test_names_of_any_encoding_are_found(
    encoding: str, form: Literal["NFC", "NFD"], ending: str, tmp_path: Path
) -> None:
    """Whatever the file system makes of accents; a euro sign is not in Latin-1."""
    Image.new("RGB", (2, 3), RED).save(tmp_path / normalize(form, "grün €.png"))
    library = tmp_path / normalize(form, "kästchen.mtl")
    library.write_bytes("newmtl grün\nmap_Kd Grün €.png\n".encode(encoding))
    text = "mtllib kästchen.mtl\nvt 0 0\n" + MODEL.replace("1 2 3", "1/1 2/1 3/1")
    text = text.replace("red", "grün").replace("usemtl blue\n", "")
    if ending == ".ply":
        text = PLY.replace("old\\One.PNG", "Grün €.png")
    path = tmp_path / f"a{ending}"
    path.write_bytes(text.encode(encoding))
    sides = []
    for file in (path, rewritten(path, tmp_path / f"€{ending}")):
        given = polygons(file)
        painting = painting_of(file, given.polygon_of, given.uv)
        sides.append(0 if painting is None else painting.largest)
    assert sides == [3, 8]


@pytest.mark.parametrize("encoding", ["utf-8", "cp1252"])
def test_names_of_any_encoding_are_readable(
    encoding: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    text = MODEL.replace("red", "grün").encode(encoding)
    for name in ("kästchen.mtl", "a.mtl"):
        (tmp_path / "a.obj").write_bytes(f"mtllib {name}\n".encode(encoding) + text)
        colours(tmp_path / "a.obj")
        (tmp_path / "a.mtl").write_bytes("newmtl blue\nmap_Kd €.png\n".encode(encoding))
    (tmp_path / "a.ply").write_bytes(PLY.replace("old\\One.PNG", "ö.png").encode(encoding))
    colours(tmp_path / "a.ply")
    assert caplog.messages == [
        f"{tmp_path / 'kästchen.mtl'}: its materials are not known: it is not found",
        f"{tmp_path / 'a.mtl'}: pictures that are not found are left out: €.png",
        f"{tmp_path / 'a.obj'}: no library holds its materials grün",
        f"{tmp_path / 'a.ply'}: the picture ö.png is not found",
    ]


def test_a_name_of_a_material_is_one_in_two_encodings(tmp_path: Path) -> None:
    (tmp_path / "a.mtl").write_bytes(LIBRARY.replace("red", "grün").encode("cp1252"))
    assert colours(model(tmp_path, "a.mtl", MODEL.replace("red", "grün"))) == [RED, BLUE]


def test_names_that_are_no_utf8_stay(tmp_path: Path) -> None:
    """A library of a Windows program, written anew."""
    library = tmp_path / "a.mtl"
    library.write_bytes("newmtl grün\nKd 0 1 0\nmap_bump b.png\n".encode("latin-1"))
    write_library(tmp_path / "b.obj", None, [library])
    assert (tmp_path / "b.mtl").read_bytes().startswith(b"newmtl gr\xfcn\nKd 0 1 0\n# ")


@pytest.mark.parametrize(
    "text",
    [
        "# from C:\\models\\\n" + MODEL,
        MODEL.replace("f 1 2 3", "# C:\\temp\\\nf 1 2 3"),
        MODEL.replace("f 1 2 3", "g C:\\temp\\\nf 1 \\\n2 3"),
        MODEL.replace("f 1 2 3", "f\nf # none\nf 1 2 3 # one \\"),
        MODEL.replace("usemtl red", "usemtl red \\"),
    ],
)
def test_reader_painter_and_writer_join_the_same_lines(text: str, tmp_path: Path) -> None:
    """A vertex or a face more or less would shift all that follow."""
    (tmp_path / "a.mtl").write_text(LIBRARY)
    path = model(tmp_path, "a.mtl", text)
    assert colours(path) == [RED, BLUE]
    out = rewritten(path, tmp_path / "b.obj")
    assert colours(out) == [RED, BLUE]
    assert np.array_equal(polygons(out).mesh.faces, polygons(path).mesh.faces)
    assert np.array_equal(polygons(out).mesh.vertices, polygons(path).mesh.vertices)
    assert "f " not in out.read_text().splitlines()


def test_pictures_of_ply_are_found_alike(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = tmp_path / "a.ply"
    path.write_text(PLY)
    given = polygons(path)
    assert painting_of(path, given.polygon_of, given.uv) is None
    assert caplog.messages == [f"{path}: the picture old\\One.PNG is not found"]
    Image.new("RGB", (2, 3), RED).save(tmp_path / "one.png")
    painting = painting_of(path, given.polygon_of, given.uv)
    assert painting is not None
    assert painting.largest == 3


@pytest.mark.parametrize(
    "uses", [["foo"], ["foo", "bar # of old", "map"], ["two words", "foo", "foo"], ["K\u00f6rper"]]
)
@pytest.mark.parametrize("encoding", ["utf-8", "latin-1"])
def test_materials_that_no_library_holds_show_the_new_texture(
    uses: list[str], encoding: str, tmp_path: Path
) -> None:
    """A strip of triangles, the first of them without a material."""
    count = len(uses) + 1
    points = np.array([[k / count, k % 2, 0.0] for k in range(count + 2)])
    lines = [f"v {x} {y} {z}" for x, y, z in points]
    for k in range(count):
        lines += [f"usemtl {uses[k - 1]}"] * (k > 0) + [f"f {k + 1} {k + 2} {k + 3}"]
    source, out = tmp_path / "a.obj", tmp_path / "new.obj"
    source.write_text("\n".join(lines) + "\n", encoding=encoding)
    given = polygons(source)
    placed = Charted(given.mesh, Parameterization(points[:, :2] / 2, given.mesh.faces))
    output = mesh_output(given, str(source), str(out), 64, 4)
    output.write(placed, output.picture(placed))
    new = [line for line in out.read_bytes().splitlines() if line.startswith((b"usemtl", b"mtl"))]
    kept = [f"usemtl {of}".encode(encoding) for of in uses]
    assert new == [b"mtllib new.mtl", b"usemtl map", *kept]
    painting = painting_of(out, np.arange(count), np.zeros((count, 3, 2)))
    assert painting is not None
    used = [painting.materials[k] for k in np.unique(painting.material_of)]
    assert len(used) == len({"map", *uses})
    assert all(one.picture is not None and one.picture.shape == (64, 64, 3) for one in used)
