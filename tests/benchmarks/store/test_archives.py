"""Arrays in npz files: written whole or not at all, never unpickled, and known by their hash."""

from __future__ import annotations

import errno
import os
import zipfile
from pathlib import Path

import numpy as np
import pytest

from benchmarks.store import archives
from benchmarks.store.archives import (
    arrays_hash,
    map_arrays,
    read_arrays,
    read_map,
    read_surface,
    surface_arrays,
    trace_arrays,
    write_arrays,
)
from parapoint.errors import InputError
from parapoint.files.decoding import allow
from parapoint.surfaces.parameterization import (
    Parameterization,
    PointParameterization,
    TracePoint,
)
from parapoint.surfaces.surface import PointCloud

from .conftest import FLAT


def test_a_map_has_the_same_hash_whatever_its_trace():
    traced = Parameterization(FLAT.uv, FLAT.corners, (TracePoint(1, 0.123, {}),))
    assert arrays_hash(map_arrays(traced)) == arrays_hash(map_arrays(FLAT))
    moved = Parameterization(FLAT.uv + 1e-15, FLAT.corners)
    assert arrays_hash(map_arrays(moved)) != arrays_hash(map_arrays(FLAT))


def test_a_trace_comes_back_with_its_values_and_maps_where_it_has_them(tmp_path: Path) -> None:
    trace = (
        TracePoint(0, 0.5, {"energy": 3.0}, FLAT.uv + 1),
        TracePoint(2, 1.5, {"energy": 2.0, "flips": 0.0}),
    )
    path = tmp_path / "map.npz"
    write_arrays(path, map_arrays(FLAT) | trace_arrays(trace))
    found = read_map(path, {"a": 1})
    assert found.report == {"a": 1}
    assert [point[:3] for point in found.trace] == [point[:3] for point in trace]
    np.testing.assert_array_equal(found.trace[0].uv, FLAT.uv + 1)
    assert found.trace[1].uv is None


def test_clouds_and_their_maps_come_back_with_all_that_they_have(tmp_path: Path) -> None:
    points, colours = np.eye(3), np.arange(9, dtype=np.uint8).reshape(3, 3)
    for normals, attributes in ((None, {}), (points[::-1], {"colours": colours})):
        cloud = PointCloud(points, normals, attributes=attributes)
        write_arrays(tmp_path / "cloud.npz", surface_arrays(cloud))
        found = read_surface(tmp_path / "cloud.npz")
        assert isinstance(found, PointCloud)
        assert (found.normals is None) == (normals is None)
        assert found.normals is None or (found.normals == points[::-1]).all()
        assert {name: value.tolist() for name, value in found.attributes.items()} == {
            name: value.tolist() for name, value in attributes.items()
        }
    image = PointParameterization(points[:, :2], report={"a": 1})
    write_arrays(tmp_path / "map.npz", map_arrays(image))
    again = read_map(tmp_path / "map.npz", image.report)
    assert isinstance(again, PointParameterization)
    assert again.report == {"a": 1}
    assert read_map(tmp_path / "map.npz").report == {}


def test_a_pickle_is_never_opened(tmp_path):
    path = tmp_path / "evil.npz"
    np.savez(path, uv=np.array([object()], dtype=object))
    with pytest.raises(InputError, match="damaged"):
        read_arrays(path)


def test_a_write_that_fails_leaves_what_was_there(tmp_path):
    path = tmp_path / "a.npz"
    write_arrays(path, {"a": np.arange(3)})
    with pytest.raises(ValueError, match="pickle"):
        write_arrays(path, {"a": np.array([object()])})
    assert [file.name for file in tmp_path.iterdir()] == ["a.npz"]
    np.testing.assert_array_equal(read_arrays(path)["a"], [0, 1, 2])


def test_what_is_no_array_is_damage(tmp_path):
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("a.npy", b"words")
    with pytest.raises(InputError, match=r"a\.npz: damaged \(it holds what is no array\)"):
        read_arrays(tmp_path / "a.npz")


def test_an_archive_that_decodes_to_far_more_is_refused_before_it_is_read(tmp_path):
    allow(0)  # a command with --memory may have lifted the bound in this process
    path = tmp_path / "bomb.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in "abc":
            archive.writestr(f"{name}.npy", bytes(24 * 2**20))
    with pytest.raises(InputError, match=r"bomb\.npz: has .* bytes that decode to 75,497,472"):
        read_arrays(path)


def test_large_indices_keep_their_values(tmp_path):
    values = np.array([2**40, -(2**63)])
    write_arrays(tmp_path / "a.npz", {"a": values})
    np.testing.assert_array_equal(read_arrays(tmp_path / "a.npz")["a"], values)


def test_a_hash_covers_names_types_shapes_and_values_and_no_order():
    zeros = np.zeros(6)
    first = arrays_hash({"a": zeros, "b": zeros[:3]})
    assert arrays_hash({"b": zeros[:3], "a": zeros}) == first
    others = [
        {"a": zeros, "c": zeros[:3]},
        {"a": zeros[:3], "b": zeros},
        {"a": zeros.reshape(2, 3), "b": zeros[:3]},
        {"a": zeros.view(np.int64), "b": zeros[:3]},
        {"a": zeros + 1e-300, "b": zeros[:3]},
        {"a": zeros},
    ]
    assert len({first, *map(arrays_hash, others)}) == 7


@pytest.mark.parametrize("value", [2**31, -(2**31), 2**31 - 1, -(2**31) + 1])
def test_indices_are_stored_small_only_where_they_fit(tmp_path, value):
    for values in ([value], [value, 0], [0, value, -1]):
        write_arrays(tmp_path / "a.npz", {"a": np.array(values)})
        read = read_arrays(tmp_path / "a.npz")["a"]
        assert read.dtype == np.int64
        assert read.tolist() == values
    with np.load(tmp_path / "a.npz") as stored:
        assert stored["a"].dtype == (np.int32 if abs(value) < 2**31 else np.int64)


def test_two_processes_that_write_one_file_do_not_meet(tmp_path):
    receive, send = os.pipe()
    with archives.replacing(tmp_path / "a") as stream:
        stream.write(b"ours")
        child = os.fork()
        if not child:
            with archives.replacing(tmp_path / "a") as other:
                other.write(b"another's")
            os.write(send, b"1" if (tmp_path / "a").read_bytes() == b"another's" else b"0")
            os._exit(0)
        os.waitpid(child, 0)
    assert os.read(receive, 1) == b"1"
    assert (tmp_path / "a").read_bytes() == b"ours"
    assert [path.name for path in tmp_path.iterdir()] == ["a"]
    os.close(receive)
    os.close(send)


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EDQUOT, errno.EFBIG])
def test_a_disk_that_takes_no_more_is_one_line(tmp_path, number):
    said = r"^the file: .*earlier results are intact"
    with pytest.raises(InputError, match=said), archives.disk_said(Path("the file")):
        raise OSError(number, "no")
    with pytest.raises(OSError, match="no") as error, archives.disk_said(tmp_path):
        raise OSError(errno.EIO, "no")
    assert not isinstance(error.value, InputError)


@pytest.mark.parametrize(
    "arrays",
    [
        {"vertices": np.zeros((3, 3))},
        {"vertices": np.zeros((3, 3)), "faces": np.array([[0, 1, 9]])},
        {"points": np.full((3, 3), np.nan)},
        {"points": np.zeros((3, 3)), "normals": np.zeros((2, 3))},
    ],
)
def test_a_surface_that_is_damaged_inside_is_bad_input(tmp_path, arrays):
    write_arrays(tmp_path / "a.npz", arrays)
    with pytest.raises(InputError, match=r"a\.npz: damaged"):
        archives.read_surface(tmp_path / "a.npz")


@pytest.mark.parametrize(
    "arrays",
    [
        {"corners": np.array([[0, 1, 2]])},
        {"uv": np.zeros((3, 2)), "corners": np.array([[0, 1, 9]])},
        {"uv": np.zeros((3, 2)), "trace_iteration": np.array([1])},
    ],
)
def test_a_map_that_is_damaged_inside_is_bad_input(tmp_path, arrays):
    write_arrays(tmp_path / "a.npz", arrays)
    with pytest.raises(InputError, match=r"a\.npz: damaged"):
        archives.read_map(tmp_path / "a.npz")
