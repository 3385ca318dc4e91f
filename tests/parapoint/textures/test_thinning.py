"""Clouds read in pieces, and thinned to what a texture can show."""

import laspy
import numpy as np
import pytest

from parapoint import Mesh, Parameterization, PointCloud
from parapoint.errors import InputError
from parapoint.files import pieces
from parapoint.files.pieces import point_pieces
from parapoint.files.point_writers import write_points
from parapoint.files.reading import read_surface
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
    for path, message in (
        (mesh, "mesh.ply: is a mesh; a cloud of points is baked"),
        (torn, "torn.ply: ends early: 200 vertices are announced"),
        (noise, "noise.las: has no point that is neither noise nor withheld"),
        (tmp_path / "none.las", "none.las: no such file"),
        (tmp_path / "none.odd", "none.odd: no such file"),
    ):
        with pytest.raises(InputError, match=message):
            list(point_pieces(path))


def some_colours(count: int) -> dict[str, np.ndarray]:
    return {
        "colours": np.full((count, 3), 300, dtype=np.uint16),
        "intensity": np.ones(count, dtype=np.uint16),
    }


def test_pieces_without_a_finite_point_are_left_out(tmp_path, monkeypatch) -> None:
    points = np.concatenate([np.full((4, 3), np.nan), CORNERS, np.full((4, 3), np.nan)])
    header = "ply\nformat binary_little_endian 1.0\nelement vertex 12\n"
    header += "".join(f"property double {axis}\n" for axis in "xyz") + "end_header\n"
    path = tmp_path / "gaps.ply"
    path.write_bytes(header.encode() + points.tobytes())
    monkeypatch.setattr(pieces, "PIECE", 4)
    (piece,) = point_pieces(path)
    np.testing.assert_array_equal(piece.points, CORNERS)
    path.write_bytes(header.encode() + np.full((12, 3), np.nan).tobytes())
    with pytest.raises(InputError, match="has no point with finite coordinates"):
        thinned(point_pieces(path), "position", SQUARE, 8)
