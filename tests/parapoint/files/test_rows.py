"""Rows that are named, and rows of outputs, are those of the file or array that was given."""

import json
import logging
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from parapoint import PointCloud, cli, console
from parapoint.files.reading import read_surface
from parapoint.files.writing.point_writers import write_points
from parapoint.surfaces.components import components
from parapoint.surfaces.strays import fitted_rows
from parapoint.surfaces.surface import FloatArray

LEFT_OUT = [0, 1, 2, 40, 304]
"""Rows without data, before, among and after those of the scan."""
STRAY = 200
"""A row far from all others."""
KEPT = np.setdiff1d(np.arange(305), LEFT_OUT)


def scan() -> FloatArray:
    """(305, 3) points of a bowl, but for rows without data and a stray one."""
    points = np.random.default_rng(0).uniform(-1, 1, (305, 3))
    points[:, 2] = 0.3 * (points[:, :2] ** 2).sum(axis=1)
    points[STRAY] = 1000
    points[LEFT_OUT] = np.nan
    return points


def xyz(path: Path) -> None:
    np.savetxt(path, scan(), header="x y z")


def npz(path: Path) -> None:
    np.savez(path, points=scan())


def ply(path: Path) -> None:
    header = "ply\nformat binary_little_endian 1.0\nelement vertex 305\n"
    header += "property double x\nproperty double y\nproperty double z\nend_header\n"
    path.write_bytes(header.encode() + scan().astype("<f8").tobytes())


def pcd(path: Path) -> None:
    header = "VERSION .7\nFIELDS x y z\nSIZE 8 8 8\nTYPE F F F\nCOUNT 1 1 1\n"
    header += "WIDTH 61\nHEIGHT 5\nPOINTS 305\nDATA binary\n"
    path.write_bytes(header.encode() + scan().astype("<f8").tobytes())


def las(path: Path) -> None:
    """Rows left out are noise or withheld here, since LAS has no NaN."""
    laspy = pytest.importorskip("laspy")
    cloud = laspy.LasData(laspy.LasHeader(point_format=6, version="1.4"))
    cloud.header.scales = [1e-6] * 3
    cloud.xyz = np.nan_to_num(scan())
    cloud.classification = np.where(np.isin(np.arange(305), LEFT_OUT[:3]), 7, 2).astype(np.uint8)
    cloud.withheld = np.isin(np.arange(305), LEFT_OUT[3:]).astype(np.uint8)
    cloud.write(path)


@pytest.mark.parametrize("write", [xyz, npz, ply, pcd, las])
def test_rows_are_those_of_the_file(
    write: Callable[[Path], None], tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Of every format that can have rows without a point."""
    path = tmp_path / f"a.{write.__name__}"
    write(path)
    cloud = read_surface(path)
    assert isinstance(cloud, PointCloud)
    assert cloud.rows is not None
    assert_array_equal(cloud.rows, KEPT)
    left, facts = fitted_rows(cloud)
    assert facts["stray_rows"] == [STRAY]
    assert f"mapped nowhere: row {STRAY}" in caplog.text
    assert isinstance(left, PointCloud)
    assert left.rows is not None
    assert_array_equal(left.rows, np.setdiff1d(KEPT, [STRAY]))


def test_rows_are_those_of_the_array() -> None:
    _, facts = fitted_rows(scan())
    assert (facts["dropped_not_finite"], facts["stray_rows"]) == (len(LEFT_OUT), [STRAY])


def test_rows_of_a_component_are_those_of_the_whole() -> None:
    points = np.nan_to_num(scan())
    points[::3] += [0, 0, 50]
    upper = components(PointCloud(points))[1]
    assert isinstance(upper, PointCloud)
    assert upper.rows is not None
    assert_array_equal(upper.points, points[upper.rows])


@pytest.mark.parametrize("ending", [".npz", ".ply"])
def test_a_written_point_tells_its_row(tmp_path: Path, ending: str) -> None:
    """Where some were left out, and only there."""
    rows = np.array([2, 5, 4_000_000_000])
    for given in (rows, None):
        cloud = PointCloud(np.eye(3), rows=given)
        write_points(tmp_path / f"a{ending}", cloud, np.zeros((3, 2)))
        again = read_surface(tmp_path / f"a{ending}")
        assert isinstance(again, PointCloud)
        assert again.rows is None
        assert ("file_row" in again.attributes) is (given is not None)
        if given is not None:
            assert_array_equal(again.attributes["file_row"], rows)


@pytest.mark.parametrize("command", ["unwrap", "map"])
def test_commands_name_rows_of_the_file(
    command: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
) -> None:
    """In what they say, and in what they write."""
    given, out = tmp_path / "a.xyz", tmp_path / "out.npz"
    xyz(given)
    commands = [["unwrap", str(given)]]
    if command == "map":
        model = str(tmp_path / "model")
        commands = [["fit", str(given), "--out", model], ["map", model, str(given)]]
    with caplog.at_level(logging.WARNING):
        for arguments in commands:
            if arguments[0] != "fit":
                arguments += ["--out", str(out)]
            with pytest.raises(SystemExit):
                console.run(cli.parapoint, [*arguments, "--json"])
    assert f"mapped nowhere: row {STRAY}" in caplog.text
    assert json.loads(capsys.readouterr().out.splitlines()[-1])["unmapped_rows"] == [STRAY]
    with np.load(out) as written:
        assert_array_equal(written["file_row"], KEPT)
        assert_array_equal(written["file_row"][np.isnan(written["uv"][:, 0])], [STRAY])
