"""What is known at each point beside its place: read by type, kept in order, written back."""

import struct

import laspy
import numpy as np
import pytest

from parapoint import InputError, PointCloud
from parapoint.files.pieces import point_pieces
from parapoint.files.reading import read_polygons, read_surface
from parapoint.files.writing.point_writers import write_points

POINTS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
RGB = np.array([[255, 0, 0], [0, 128, 0], [1, 2, 3], [9, 8, 7]], dtype=np.uint8)


def read(path, content: bytes | str) -> PointCloud:
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    surface = read_surface(path)
    assert isinstance(surface, PointCloud)
    return surface


def lines(*columns) -> str:
    return "".join(" ".join(map(repr, row)) + "\n" for row in np.hstack(columns).tolist())


@pytest.mark.parametrize("text", [True, False])
def test_ply_colours_and_scalars_keep_their_types(text, tmp_path) -> None:
    header = "ply\nformat {} 1.0\nelement vertex 4\n" + "".join(
        f"property {kind} {name}\n"
        for kind, name in [
            *(("float", axis) for axis in "xyz"),
            *(("uchar", name) for name in ("red", "green", "blue")),
            ("short", "scalar_Intensity"),
            ("float", "quality"),
        ]
    )
    kind = np.dtype([("p", "<f4", 3), ("c", "u1", 3), ("i", "<i2"), ("q", "<f4")])
    table = np.zeros(4, kind)
    table["p"], table["c"], table["i"], table["q"] = POINTS, RGB, [-5, 6, 7, 8], 0.5
    if text:
        body = "".join(
            f"{x} {y} {z} {r} {g} {b} {i} {q}\n" for (x, y, z), (r, g, b), i, q in table.tolist()
        )
        cloud = read(tmp_path / "a.ply", header.format("ascii") + "end_header\n" + body)
    else:
        head = header.format("binary_little_endian") + "end_header\n"
        cloud = read(tmp_path / "a.ply", head.encode() + table.tobytes())
    assert np.array_equal(cloud.points, POINTS)
    assert list(cloud.attributes) == ["colours", "intensity", "quality"]
    assert cloud.attributes["colours"].dtype == np.uint8
    assert np.array_equal(cloud.attributes["colours"], RGB)
    assert cloud.attributes["intensity"].dtype == np.int16
    assert cloud.attributes["intensity"].tolist() == [-5, 6, 7, 8]
    assert cloud.attributes["quality"].dtype == np.float32


@pytest.mark.parametrize("alpha", [0, 254])
@pytest.mark.parametrize("packed", ["F", "U", "I", "F as whole numbers", "I beyond its range"])
@pytest.mark.parametrize("encoding", ["ascii", "binary"])
def test_pcd_colours_are_unpacked(packed, encoding, alpha, tmp_path) -> None:
    code = (RGB.astype(np.uint32) << np.array([16, 8, 0], dtype=np.uint32)).sum(axis=1)
    code = code.astype(np.uint32) + np.uint32(alpha << 24)
    written = {"F": code.view(np.float32), "I": code.view(np.int32)}.get(packed, code)
    header = (
        f"VERSION 0.7\nFIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F {packed[0]}\nCOUNT 1 1 1 1\n"
        f"WIDTH 4\nHEIGHT 1\nPOINTS 4\nDATA {encoding}\n"
    )
    if encoding == "ascii":
        body = "".join(
            f"{x} {y} {z} {value}\n"
            for (x, y, z), value in zip(POINTS, map(str, written), strict=True)
        ).encode()
    else:
        pairs = zip(POINTS.astype("<f4"), code, strict=True)
        body = b"".join(place.tobytes() + struct.pack("<I", value) for place, value in pairs)
    cloud = read(tmp_path / "a.pcd", header.encode() + body)
    assert np.array_equal(cloud.attributes["colours"], RGB)


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ("x y z x", "the field 'x' twice"),
        ("x y z rgb rgb", "the field 'rgb' twice"),
        ("x y z _ _", ""),
    ],
)
@pytest.mark.parametrize("encoding", ["ascii", "binary"])
def test_pcd_fields_have_names_of_their_own(fields, says, encoding, tmp_path) -> None:
    count = len(fields.split())
    header = f"FIELDS {fields}\nSIZE{' 4' * count}\nTYPE{' F' * count}\nPOINTS 1\nDATA {encoding}\n"
    row = np.arange(count, dtype="<f4")
    body = row.tobytes() if encoding == "binary" else " ".join(map(str, row.tolist())).encode()
    if says:
        with pytest.raises(InputError, match=says):
            read(tmp_path / "a.pcd", header.encode() + body)
    else:
        assert read(tmp_path / "a.pcd", header.encode() + body).points.tolist() == [[0, 1, 2]]


@pytest.mark.parametrize(
    ("rows", "says"),
    [
        (["0 0 0 1", "1 0 0 1 9"], "holds 5 numbers in row 1 .* the header announces 4"),
        (["0 0 0", "1 0 0 1"], "holds 3 numbers in row 0"),
        (["0 0 0 1 1 0 0 1"], "holds 8 numbers in row 0"),
        (["0 0 0 1"], "ends early: 2 points are announced, 1 follow"),
        (["0 0 0 1", "1 0 0 1", "2 0 0 1"], "2 points are announced, 3 follow"),
    ],
)
def test_pcd_text_is_held_to_its_header(rows, says, tmp_path) -> None:
    header = "FIELDS x y z i\nSIZE 4 4 4 4\nTYPE F F F F\nPOINTS 2\nDATA ascii\n"
    with pytest.raises(InputError, match=says):
        read(tmp_path / "a.pcd", header + "\n".join(rows))


def test_pcd_packed_colours_are_whole_numbers(tmp_path) -> None:
    header = "FIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F U\nPOINTS 1\nDATA ascii\n"
    for word in ("0.5", "nan", "1e12"):
        with pytest.raises(InputError, match="packed colour that is no whole number of 32 bits"):
            read(tmp_path / "a.pcd", f"{header}0 0 0 {word}\n")


@pytest.mark.parametrize(("scale", "kind"), [(1, np.uint8), (257, np.uint16)])
def test_las_colours_are_of_8_or_16_bits(scale, kind, tmp_path) -> None:
    file = laspy.create(point_format=2, file_version="1.2")
    file.x, file.y, file.z = POINTS.T
    file.red, file.green, file.blue = (RGB.astype(np.uint16) * scale).T
    file.intensity = [1, 2, 3, 400]
    file.write(tmp_path / "a.las")
    cloud = read_surface(tmp_path / "a.las")
    assert cloud.attributes["colours"].dtype == kind
    assert np.array_equal(cloud.attributes["colours"], RGB.astype(kind) * kind(scale))
    assert cloud.attributes["intensity"].tolist() == [1, 2, 3, 400]


NAMES = [("red", "green", "blue"), ("Red", "Green", "Blue"), ("R", "G", "B"), ("r", "g", "b")]


def ply_of(kind: str, names, values) -> str:
    properties = [*(("float", axis) for axis in "xyz"), *((kind, name) for name in names)]
    header = "".join(f"property {of} {name}\n" for of, name in properties)
    return f"ply\nformat ascii 1.0\nelement vertex 4\n{header}end_header\n" + lines(POINTS, values)


@pytest.mark.parametrize("names", [*NAMES, ("Diffuse_Red", "diffuse_green", "diffuse_blue")])
def test_ply_names_of_colours_may_be_in_capitals(names, tmp_path) -> None:
    cloud = read(tmp_path / "a.ply", ply_of("uchar", names, RGB))
    assert list(cloud.attributes) == ["colours"]
    assert np.array_equal(cloud.attributes["colours"], RGB)


@pytest.mark.parametrize("kind", ["float", "double"])
@pytest.mark.parametrize("shift", [0, 0.25, 0.5, -0.25])
def test_floats_up_to_255_are_colours_under_their_name(kind, shift, tmp_path, caplog) -> None:
    values = np.clip(RGB + shift, 0, 255)
    cloud = read(tmp_path / "a.ply", ply_of(kind, NAMES[0], values))
    assert cloud.attributes["colours"].dtype == np.uint8
    assert np.array_equal(cloud.attributes["colours"], np.rint(values))
    assert not caplog.text


@pytest.mark.parametrize(
    ("kind", "values", "says"),
    [
        ("float", RGB / 100, "they go from 0 to 2.55, but not"),
        ("float", RGB + 0.5, "they go from 0 to 255.5, but not"),
        ("int", RGB.astype(int) * 300, "they go from 0 to 76500, but not"),
        ("float", RGB - 3.0, "they go from -3 to 252, but not"),
        ("float", np.full((4, 3), np.nan), "none of them is a number"),
    ],
)
def test_colours_of_no_known_range_are_told_and_kept_apart(
    kind, values, says, tmp_path, caplog
) -> None:
    cloud = read(tmp_path / "a.ply", ply_of(kind, NAMES[0], values))
    assert list(cloud.attributes) == list(NAMES[0])
    assert len(caplog.records) == 1
    assert f"colours left out: {says}" in caplog.text


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        (RGB, RGB),
        (RGB.astype(np.int64), RGB),
        (RGB / 255, RGB / 255),
        (RGB.astype(np.float32) * 0.99, np.rint(RGB * 0.99)),
        (np.hstack([RGB, RGB[:, :1]]), np.hstack([RGB, RGB[:, :1]])),
        (RGB.astype(np.uint16) * 257, RGB.astype(np.uint16) * 257),
    ],
)
def test_npz_colours_go_by_either_spelling(values, expected, tmp_path) -> None:
    for name in ("colors", "colours"):
        np.savez(tmp_path / "a.npz", points=POINTS, **{name: values})
        attributes = read_surface(tmp_path / "a.npz").attributes
        assert list(attributes) == ["colours"]
        assert np.array_equal(attributes["colours"], expected)
    for name in ("colors", "colours"):
        arrays = {"vertices": POINTS, "faces": [[0, 1, 2]], name: values}
        np.savez(tmp_path / "b.npz", **arrays)
        mesh = read_polygons(tmp_path / "b.npz")
        assert np.array_equal(mesh.colours, expected)


def test_npz_arrays_that_are_no_numbers_of_points_are_left_out(tmp_path, caplog) -> None:
    others = {
        "labels": np.array(list("abcd")),
        "days": np.array(["2026-01-01"] * 4, dtype="datetime64[D]"),
        "frames": np.zeros((4, 3, 3)),
        "waves": np.zeros(4, dtype=complex),
    }
    np.savez(tmp_path / "a.npz", points=POINTS, height=POINTS[:, 2], **others)
    assert list(read_surface(tmp_path / "a.npz").attributes) == ["height"]
    for name in others:
        assert f"the array '{name}' left out: it has no numbers" in caplog.text


def test_npz_colours_that_are_none_keep_their_name(tmp_path, caplog) -> None:
    np.savez(tmp_path / "a.npz", points=POINTS, colors=RGB / 50)
    assert list(read_surface(tmp_path / "a.npz").attributes) == ["colors"]
    assert "colours left out: they go from 0 to 5.1" in caplog.text


@pytest.mark.parametrize(
    "names", [("nx", "ny", "nz"), ("NX", "NY", "NZ"), ("NormalX", "NormalY", "NormalZ")]
)
def test_normals_of_las_stand_in_extra_dimensions(names, tmp_path) -> None:
    header = laspy.LasHeader(point_format=3, version="1.2")
    for name in names:
        header.add_extra_dim(laspy.ExtraBytesParams(name, np.float32))
    file = laspy.LasData(header)
    file.x, file.y, file.z = POINTS.T
    for name, values in zip(names, np.roll(POINTS, 1, axis=0).T, strict=True):
        file[name] = values
    file.write(tmp_path / "a.las")
    cloud = read_surface(tmp_path / "a.las")
    assert np.array_equal(cloud.normals, np.roll(POINTS, 1, axis=0))
    assert not set(names) & set(cloud.attributes)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("scale", [0.0, np.nan, np.inf])
def test_las_without_a_scale_is_refused(axis, scale, tmp_path) -> None:
    file = laspy.create(point_format=2, file_version="1.2")
    file.x, file.y, file.z = POINTS.T
    file.write(tmp_path / "a.las")
    data = bytearray((tmp_path / "a.las").read_bytes())
    struct.pack_into("<d", data, 131 + 8 * axis, scale)
    (tmp_path / "a.las").write_bytes(data)
    for read_all in read_surface, lambda path: list(point_pieces(path)):
        with pytest.raises(InputError, match=f"has the scale {scale:g} for {'xyz'[axis]}"):
            read_all(tmp_path / "a.las")


@pytest.mark.parametrize(("announced", "is_said"), [(4, False), (3, True)])
def test_las_with_more_points_than_announced_says_so(announced, is_said, tmp_path, caplog) -> None:
    file = laspy.create(point_format=2, file_version="1.2")
    file.x, file.y, file.z = POINTS.T
    file.write(tmp_path / "a.las")
    data = bytearray((tmp_path / "a.las").read_bytes())
    struct.pack_into("<I", data, 107, announced)
    (tmp_path / "a.las").write_bytes(data)
    assert len(read_surface(tmp_path / "a.las").points) == announced
    said = "points announced: 3; the file has room for 4" in caplog.text
    assert said is is_said


def test_las_without_colours_has_none(tmp_path) -> None:
    file = laspy.create(point_format=2, file_version="1.2")
    file.x, file.y, file.z = POINTS.T
    file.write(tmp_path / "a.las")
    assert "colours" not in read_surface(tmp_path / "a.las").attributes


def test_columns_of_text_are_told_apart(tmp_path) -> None:
    strength = np.array([[0.5], [7.25], [-3.0], [1e3]])
    unit = POINTS[[1, 2, 3, 1]]
    cloud = read(tmp_path / "a.pts", "4\n" + lines(POINTS, strength, RGB))
    assert cloud.normals is None
    assert np.array_equal(cloud.attributes["intensity"], strength[:, 0])
    assert np.array_equal(cloud.attributes["colours"], RGB)
    assert cloud.attributes["colours"].dtype == np.uint8
    cloud = read(tmp_path / "a.xyz", lines(POINTS, RGB, unit))
    assert np.array_equal(cloud.normals, unit)
    assert np.array_equal(cloud.attributes["colours"], RGB)
    cloud = read(tmp_path / "b.xyz", lines(POINTS, unit, RGB / 255))
    assert np.array_equal(cloud.normals, unit)
    assert np.array_equal(cloud.attributes["colours"], RGB / 255)
    cloud = read(tmp_path / "c.xyz", lines(POINTS, 500.5 + POINTS))
    assert cloud.normals is None
    assert list(cloud.attributes) == ["column4", "column5", "column6"]


def test_columns_that_are_no_numbers_are_left(tmp_path) -> None:
    cloud = read(tmp_path / "a.xyz", "0 0 0 tree\n1 0 0 stone\n")
    assert cloud.points.tolist() == [[0, 0, 0], [1, 0, 0]]
    assert not cloud.attributes


def test_dropped_points_take_their_attributes_along(tmp_path) -> None:
    cloud = read(tmp_path / "a.xyz", "0 0 0 1\nnan 0 0 2\n1 0 0 3\n")
    assert cloud.attributes["intensity"].tolist() == [1, 3]


@pytest.mark.parametrize("ending", [".ply", ".npz", ".obj"])
def test_attributes_are_written_beside_the_uv(ending, tmp_path) -> None:
    attributes = {"colours": RGB, "intensity": np.arange(4, dtype=np.uint16), "flow": POINTS[:, :2]}
    path = tmp_path / f"a{ending}"
    write_points(path, PointCloud(POINTS, attributes=attributes), POINTS[:, :2])
    if ending == ".obj":
        assert path.read_text().splitlines()[0] == "v 0.0 0.0 0.0 1.0 0.0 0.0"
    elif ending == ".npz":
        with np.load(path) as written:
            assert all(np.array_equal(written[name], of) for name, of in attributes.items())
    else:
        cloud = read_surface(path)
        assert np.array_equal(cloud.attributes["colours"], RGB)
        assert cloud.attributes["intensity"].dtype == np.uint16
        assert np.array_equal(cloud.attributes["flow_1"], POINTS[:, 1])
        assert np.array_equal(cloud.attributes["u"], POINTS[:, 0])


@pytest.mark.parametrize(
    ("name", "values", "message"),
    [
        ("colours", RGB[:3], "3 colours for 4 points"),
        ("colours", RGB[:, :2], "colours must have shape"),
        ("colours", RGB.astype(np.int64), "colours must be uint8, uint16 or floats"),
        ("colours", RGB / 200, "must lie between 0 and 1"),
        ("intensity", np.zeros(5), "5 intensity for 4 points"),
        ("label", np.array(["a"] * 4), "label must be numbers"),
    ],
)
def test_attributes_that_do_not_fit_are_refused(name, values, message) -> None:
    with pytest.raises(InputError, match=message.replace("(", r"\(")):
        PointCloud(POINTS, attributes={name: values})
