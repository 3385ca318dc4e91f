"""Clouds read in pieces, and thinned to what a texture can show."""

import gzip

import laspy
import numpy as np
import pytest

from parapoint import Mesh, Parameterization, PointCloud
from parapoint.errors import InputError
from parapoint.files import pieces
from parapoint.files.pieces import point_pieces
from parapoint.files.reading import read_surface
from parapoint.files.writing.point_writers import write_points
from parapoint.surfaces.parameterization import Charted
from parapoint.textures.thinning import thinned

CORNERS = np.array([[0, 0, 0], [8, 0, 0], [8, 8, 0], [0, 8, 0.0]])
FACES = np.array([[0, 1, 2], [0, 2, 3]])
SQUARE = Charted(Mesh(CORNERS, FACES), Parameterization(CORNERS[:, :2] / 8, FACES))
"""A square of side 8 that fills the unit square: of 8 texels a side each is 1 wide, a cube 0.5."""


def cloud(count: int = 200, dark: int = 100) -> PointCloud:
    """Points of the square with 16-bit colours, the first ones dark."""
    rng = np.random.default_rng(0)
    points = np.round(rng.uniform(0, 8, (count, 3)) * [1, 1, 0], 3)
    colours = rng.integers(256, 65536, (count, 3), dtype=np.uint16)
    colours[:dark] //= 256
    normals = np.tile([0, 0, 1.0], (count, 1))
    intensity = rng.integers(0, 9, count, dtype=np.uint16)
    return PointCloud(points, normals, attributes={"colours": colours, "intensity": intensity})


def write_las(path, of: PointCloud, dark: int = 0) -> None:
    header = laspy.LasHeader(version="1.2", point_format=2)
    header.scales = np.full(3, 1e-3)
    las = laspy.LasData(header)
    las.xyz = of.points
    colours = of.attributes["colours"].copy()
    colours[:dark] = 0
    las.red, las.green, las.blue = colours.T
    las.intensity = of.attributes["intensity"]
    las.classification = np.where(np.arange(len(of.points)) % 10 == 7, 7, 2)
    las.write(path)


@pytest.fixture(params=["ply", "las", "laz"])
def scan(request, tmp_path):
    path = tmp_path / f"scan.{request.param}"
    if request.param == "ply":
        write_points(path, cloud(), cloud().points[:, :2])
    else:
        write_las(path, cloud(), dark=70)
    return path


@pytest.mark.parametrize("kind", ["colour", "intensity"])
@pytest.mark.parametrize("size", [7, 60, 1000])
def test_a_cloud_is_the_same_in_pieces_of_any_size(size, kind, scan, monkeypatch, caplog) -> None:
    whole, count = thinned([read_surface(scan)], kind, SQUARE, 8)
    said = [record.message for record in caplog.records]
    caplog.clear()
    monkeypatch.setattr(pieces, "PIECE", size)
    found = list(point_pieces(scan))
    assert max(len(piece.points) for piece in found) <= size
    made, read = thinned(found, kind, SQUARE, 8)
    assert read == count == (200 if scan.suffix == ".ply" else 180)
    np.testing.assert_array_equal(made.points, whole.points)
    assert made.attributes.keys() == whole.attributes.keys()
    for name, values in whole.attributes.items():
        assert made.attributes[name].dtype == values.dtype
        np.testing.assert_array_equal(made.attributes[name], values)
    assert [record.message for record in caplog.records] == said


def test_the_first_point_of_a_cube_stays() -> None:
    points = np.array([[0.1, 0.1, 0], [0.4, 0.4, 0.2], [0.6, 0.1, 0], [0.1, 0.1, -0.1], [99, 0, 0]])
    made, count = thinned([PointCloud(points)], "position", SQUARE, 8)
    assert count == 5
    np.testing.assert_array_equal(made.points, points[[0, 2, 3, 4]])
    few, _ = thinned([PointCloud(points)], "position", SQUARE, 1)  # a cube is 4 wide
    np.testing.assert_array_equal(few.points, points[[0, 3, 4]])


def test_the_cubes_at_the_rim_of_space_are_as_good_as_others() -> None:
    """The space around the square begins at -8; these are in its first cubes."""
    points = np.array([[-9.0, -9, -9], [-7.3, -9, -9], [-6.8, -9, -9], [-9, -7.3, -9], [1, 1, 0]])
    made, _ = thinned([PointCloud(points)], "position", SQUARE, 8)
    np.testing.assert_array_equal(made.points, points)


def test_where_the_map_is_large_more_points_stay() -> None:
    """The left half of the square fills four fifths of the texture."""
    middle = np.array([[4, 0, 0], [4, 8, 0.0]])
    faces = [[0, 4, 5], [0, 5, 3], [4, 1, 2], [4, 2, 5]]
    corners = np.concatenate([CORNERS, middle])
    uv = corners[:, :2] / 8
    uv[4:, 0] = 0.95
    uneven = Charted(Mesh(corners, faces), Parameterization(uv, faces))
    rng = np.random.default_rng(2)
    made, _ = thinned(
        [PointCloud(rng.uniform(0, 8, (60_000, 3)) * [1, 1, 0])], "position", uneven, 8
    )
    left = made.points[:, 0] < 3.8
    assert left.sum() > 2 * (made.points[:, 0] > 4.2).sum()


def test_faces_without_area_in_the_map_or_in_space_decide_nothing() -> None:
    corners = np.concatenate([CORNERS, [[4, 4, 8], [4, 4, 0]]])
    uv = np.concatenate([SQUARE.map.uv, [[0.5, 0.5], [0.6, 0.4]]])
    faces = [*FACES.tolist(), [0, 4, 2], [0, 5, 2]]
    more = Charted(Mesh(corners, faces), Parameterization(uv, faces))
    points = np.random.default_rng(3).uniform(0, 8, (2000, 3))
    made, alone = (
        thinned([PointCloud(points)], "position", of, 8)[0].points for of in (more, SQUARE)
    )
    np.testing.assert_array_equal(made, alone)


@pytest.mark.parametrize("far", [9.0, -9.0, 1e30, -1e30, 1.7e308])
def test_points_far_away_on_any_side_are_few(far) -> None:
    points = np.random.default_rng(3).uniform(0, 8, (20_000, 3)) * [1, 1, 0]
    points[::2] += [0, far, 0]
    made, _ = thinned([PointCloud(points)], "position", SQUARE, 8)
    assert 250 < len(made.points) <= 2 * 256 + 40


def test_more_points_than_a_texture_shows_take_no_more_room() -> None:
    rng = np.random.default_rng(1)
    parts = [PointCloud(rng.uniform(0, 8, (5000, 3)) * [1, 1, 0]) for _ in range(8)]
    made, count = thinned(parts, "position", SQUARE, 8)
    assert count == 40_000
    assert len(made.points) == 16 * 16  # four cubes a texel, and all are full


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        ("colour", "has no colours to bake; the attributes of its points: heat"),
        ("normal", "has no normals to bake"),
    ],
)
def test_what_no_point_has_cannot_be_baked(kind, message) -> None:
    bare = PointCloud(CORNERS, attributes={"heat": np.arange(4)})
    with pytest.raises(InputError, match=message):
        thinned([bare, bare], kind, SQUARE, 8)
    some = PointCloud(CORNERS + 1, np.tile([0, 0, 1.0], (4, 1)))
    if kind == "normal":
        assert thinned([some], kind, SQUARE, 8)[0].normals is not None
        with pytest.raises(InputError, match=message):
            thinned([some, bare], kind, SQUARE, 8)


@pytest.mark.parametrize(
    ("kind", "name", "message"),
    [
        ("colour", "colours", "no colours to bake: all of its points are black"),
        ("intensity", "intensity", "no intensity to bake: it is 0 at all of its points"),
    ],
)
def test_what_is_0_at_all_points_was_never_taken(kind: str, name: str, message: str) -> None:
    """Scanners leave room for it; one point that has some is enough."""
    zeros = np.zeros((4, 3), np.uint8) if kind == "colour" else np.zeros(4, np.uint16)
    if kind == "colour":  # that they are opaque shows nothing
        opaque = np.column_stack([zeros, np.full(4, 255, np.uint8)])
        with pytest.raises(InputError, match=message):
            thinned([PointCloud(CORNERS, attributes={name: opaque})], kind, SQUARE, 8)
    none = PointCloud(CORNERS, attributes={name: zeros})
    with pytest.raises(InputError, match=message):
        thinned([none, none], kind, SQUARE, 8)
    unknown = np.where(np.arange(4)[:, None] == 1, np.nan, zeros.reshape(4, -1)).reshape(
        zeros.shape
    )
    with pytest.raises(InputError, match=message):
        thinned([PointCloud(CORNERS, attributes={name: unknown})], kind, SQUARE, 8)
    some = zeros.copy()
    some[3] = 1
    thinned([none, PointCloud(CORNERS, attributes={name: some})], kind, SQUARE, 8)


def test_the_type_of_colours_goes_by_all_points() -> None:
    """Those that say that a colour has 16 bits may be ones that are left out."""
    first = np.array([[1.0, 1, 0]])
    same = np.repeat(first, 3, axis=0)
    dark = np.array([[9, 8, 7], [60_000, 0, 0], [0, 0, 0]], dtype=np.uint16)
    whole = PointCloud(same, attributes={"colours": dark})
    for parts in (
        [whole],
        [PointCloud(first, attributes={"colours": dark[:1].astype(np.uint8)}), whole],
    ):
        made, _ = thinned(parts, "colour", SQUARE, 8)
        assert made.attributes["colours"].dtype == np.uint16
        np.testing.assert_array_equal(made.attributes["colours"], dark[:1])
    bright, dim = ({"colours": np.full((1, 3), value)} for value in (1.0, 0.5))
    whole_numbers = {"colours": np.full((1, 3), 200, dtype=np.uint8)}
    for other, is_good in ((bright, True), (dim, False)):
        pair = [
            PointCloud(first, attributes=whole_numbers),
            PointCloud(first + 4, attributes=other),
        ]
        if is_good:
            made, _ = thinned(pair, "colour", SQUARE, 8)
            assert made.attributes["colours"].tolist() == [[200] * 3, [1] * 3]
            assert made.attributes["colours"].dtype == np.uint8
        else:
            with pytest.raises(InputError, match="some are fractions"):
                thinned(pair, "colour", SQUARE, 8)


def test_what_a_piece_lacks_all_lack() -> None:
    """A column with a number that is no colour holds none; nor do normals that are not finite."""
    good = PointCloud(CORNERS, CORNERS + 1, attributes={"colours": np.full((4, 3), 9, np.uint8)})
    for bare, kind in ((PointCloud(CORNERS), "colour"), (PointCloud(CORNERS), "normal")):
        with pytest.raises(InputError, match="to bake"):
            thinned([good, bare], kind, SQUARE, 8)


def test_a_comment_that_looks_like_the_element_is_a_comment(tmp_path, monkeypatch) -> None:
    path = tmp_path / "comment.ply"
    write_points(path, cloud(), cloud().points[:, :2])
    data = path.read_bytes().replace(
        b"element vertex", b"comment element vertex 7\nelement vertex", 1
    )
    path.write_bytes(data)
    monkeypatch.setattr(pieces, "PIECE", 60)
    assert sum(len(piece.points) for piece in point_pieces(path)) == 200


def test_what_is_no_cloud_is_refused_in_one_line(tmp_path) -> None:
    mesh = tmp_path / "mesh.ply"
    mesh.write_text(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
        "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
        "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    )
    torn = tmp_path / "torn.ply"
    write_points(torn, cloud(), cloud().points[:, :2])
    torn.write_bytes(torn.read_bytes()[:-1])
    noise = tmp_path / "noise.las"
    write_las(noise, PointCloud(CORNERS, attributes=some_colours(4)))
    file = laspy.read(noise)
    file.classification[:] = 7
    file.write(noise)
    packed = tmp_path / "packed.las"
    packed.write_bytes(gzip.compress(noise.read_bytes(), mtime=0))
    for path, message in (
        (mesh, "mesh.ply: is a mesh; a cloud of points is baked"),
        (torn, "torn.ply: ends early: 200 vertices are announced"),
        (noise, "noise.las: has no point that is neither noise nor withheld"),
        (packed, "packed.las: is packed by gzip; unpack it first"),
        (tmp_path / "none.las", "none.las: no such file"),
        (tmp_path / "none.odd", "none.odd: no such file"),
    ):
        with pytest.raises(InputError, match=message):
            list(point_pieces(path))


def test_a_file_that_ends_early_is_refused_before_it_is_read(tmp_path, monkeypatch) -> None:
    torn = tmp_path / "torn.ply"
    write_points(torn, cloud(), cloud().points[:, :2])
    torn.write_bytes(torn.read_bytes()[:-1])
    monkeypatch.setattr(pieces, "read_surface", None)
    with pytest.raises(InputError, match="ends early: 200 vertices"):
        list(point_pieces(torn))


def some_colours(count: int) -> dict[str, np.ndarray]:
    return {
        "colours": np.full((count, 3), 300, dtype=np.uint16),
        "intensity": np.ones(count, dtype=np.uint16),
    }


def test_pieces_without_a_finite_point_are_left_out(tmp_path, monkeypatch, caplog) -> None:
    points = np.concatenate([np.full((4, 3), np.nan), CORNERS, np.full((4, 3), np.nan)])
    header = "ply\nformat binary_little_endian 1.0\nelement vertex 12\n"
    header += "".join(f"property double {axis}\n" for axis in "xyz") + "end_header\n"
    path = tmp_path / "gaps.ply"
    path.write_bytes(header.encode() + points.tobytes())
    monkeypatch.setattr(pieces, "PIECE", 4)
    (piece,) = point_pieces(path)
    np.testing.assert_array_equal(piece.points, CORNERS)
    (said,) = caplog.records
    assert said.getMessage().endswith(
        "gaps.ply: 8 of 12 points dropped: their coordinates are not finite"
    )
    path.write_bytes(header.encode() + np.full((12, 3), np.nan).tobytes())
    with pytest.raises(InputError, match="has no point with finite coordinates"):
        thinned(point_pieces(path), "position", SQUARE, 8)
