"""The result store: nothing that was written is lost, nothing damaged is taken for a result."""

from __future__ import annotations

import dataclasses
import errno
import json
import os

import numpy as np
import pytest

from benchmarks.store import measuring, provenance, verifying
from benchmarks.store.archives import (
    arrays_hash,
    map_arrays,
    read_arrays,
    trace_arrays,
    write_arrays,
)
from benchmarks.store.records import plain
from benchmarks.store.results import Store
from benchmarks.store.rows import ResultRow, identity
from parapoint.errors import InputError
from parapoint.surfaces.parameterization import Parameterization, PointParameterization, TracePoint
from parapoint.surfaces.surface import Mesh, PointCloud

SQUARE = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
FLAT = Parameterization(SQUARE.vertices[:, :2], SQUARE.faces)


def add(store: Store, result=FLAT, surface=SQUARE, *, status="ok", **changes) -> ResultRow:
    """Stores a result as a run does."""
    cell = {
        "suite": "trial",
        "case": "square",
        "method": "flat",
        "params": {"sizes": (1, 2)},
        "seed": 0,
        "source_hash": "abc",
        "surface_hash": store.add_surface(surface),
    } | changes
    row_id = identity(**cell)
    row = ResultRow(id=row_id, status=status, **cell)
    if status == "ok":
        path = store.folder / "map.npz"
        write_arrays(path, map_arrays(result) | trace_arrays(result.trace))
        store.add_map(row_id, path)
        digest = arrays_hash(map_arrays(result))
        row = dataclasses.replace(
            row, uv_file=f"uv/{row_id}.npz", uv_sha256=digest, report=result.report
        )
    store.append(row)
    return row


@pytest.fixture
def store(tmp_path):
    store = Store(tmp_path / "results")
    with store.writing():
        yield store


def test_what_is_stored_comes_back(store):
    trace = (
        TracePoint(0, 0.0, {"energy": 4.0}, FLAT.uv * 2),
        TracePoint(9, 1.5, {"energy": 3.0, "flips": 1.0}),
    )
    row = add(store, Parameterization(FLAT.uv, FLAT.corners, trace, {"weights": [1, 2]}))
    (read,) = Store(store.folder).rows()
    assert dataclasses.asdict(read) == dataclasses.asdict(row) | {"params": {"sizes": [1, 2]}}
    surface, result = store.surface(read), store.result(read)
    assert isinstance(surface, Mesh)
    assert isinstance(result, Parameterization)
    np.testing.assert_array_equal(surface.vertices, SQUARE.vertices)
    np.testing.assert_array_equal(surface.faces, SQUARE.faces)
    np.testing.assert_array_equal(result.uv, FLAT.uv)
    np.testing.assert_array_equal(result.corners, FLAT.corners)
    assert [point[:3] for point in result.trace] == [point[:3] for point in trace]
    np.testing.assert_array_equal(result.trace[0].uv, FLAT.uv * 2)
    assert result.trace[1].uv is None
    assert result.report == {"weights": [1, 2]}


def test_point_clouds_come_back_with_and_without_normals(store):
    points = np.arange(12.0).reshape(4, 3)
    image = PointParameterization(points[:, :2])
    for normals in (None, points[::-1]):
        row = add(store, image, PointCloud(points, normals))
        surface, result = store.surface(row), store.result(row)
        assert isinstance(surface, PointCloud)
        assert isinstance(result, PointParameterization)
        np.testing.assert_array_equal(surface.points, points)
        assert (surface.normals is None) == (normals is None)
    assert len({row.surface_hash for row in store.history()}) == 2


def test_the_latest_row_of_a_cell_counts_and_none_is_lost(store):
    add(store, status="timeout")
    old = add(store)
    other = add(store, seed=1)
    new = add(store, source_hash="def")
    assert [row.id for row in store.rows()] == [new.id, other.id]
    assert [row.status for row in store.history()] == ["timeout", "ok", "ok", "ok"]
    assert store.result(old).uv.shape == (4, 2)


def test_the_identity_covers_every_part_and_no_order():
    cell = {
        "suite": "a",
        "case": "b",
        "method": "c",
        "params": {"x": 1, "y": (1, 2)},
        "seed": 0,
        "source_hash": "d",
        "surface_hash": "e",
    }
    first = identity(**cell)
    assert identity(**cell | {"params": {"y": [1, 2], "x": 1}}) == first
    others = [identity(**cell | {name: 7}) for name in cell]
    assert len({first, *others}) == 8


def test_a_map_has_the_same_hash_whatever_its_trace():
    traced = Parameterization(FLAT.uv, FLAT.corners, (TracePoint(1, 0.123, {}),))
    assert arrays_hash(map_arrays(traced)) == arrays_hash(map_arrays(FLAT))
    moved = Parameterization(FLAT.uv + 1e-15, FLAT.corners)
    assert arrays_hash(map_arrays(moved)) != arrays_hash(map_arrays(FLAT))


def test_a_report_is_written_whatever_is_in_it():
    report = {1: np.float64("inf"), "a": np.arange(2), "b": {3, 2}, "c": (None, True), "d": object}
    written = plain(report)
    assert json.loads(json.dumps(written, allow_nan=False)) == {
        "1": "inf",
        "a": [0, 1],
        "b": [2, 3],
        "c": [None, True],
        "d": str(object),
    }


@pytest.mark.parametrize("tail", [b'{"id": "1', b"\0" * 40, b"\0\0\n", b"[]\n", b"null\n{}\n"])
def test_a_torn_end_is_set_aside_and_said(tmp_path, caplog, tail):
    store = Store(tmp_path)
    with store.writing():
        row = add(store)
    whole = (tmp_path / "runs.jsonl").read_bytes()
    (tmp_path / "runs.jsonl").write_bytes(whole + tail)
    assert [read.id for read in store.rows()] == [row.id]
    caplog.clear()
    with store.writing():
        add(store, seed=1)
    assert "torn" in caplog.text
    assert (tmp_path / "runs.torn").read_bytes() == tail + b"\n"
    assert (tmp_path / "runs.jsonl").read_bytes().startswith(whole)
    assert [read.seed for read in store.rows()] == [0, 1]
    assert not list(verifying.faults(store))


def test_torn_ends_gather_one_after_another(tmp_path):
    store = Store(tmp_path)
    for seed, tail in enumerate((b"first", b"second")):
        with store.writing():
            add(store, seed=seed)
        with (tmp_path / "runs.jsonl").open("ab") as stream:
            stream.write(tail)
    with store.writing():
        pass
    assert (tmp_path / "runs.torn").read_bytes() == b"first\nsecond\n"


def test_every_torn_prefix_keeps_the_rows_before_it(tmp_path):
    store = Store(tmp_path)
    with store.writing():
        add(store)
        whole = (tmp_path / "runs.jsonl").read_bytes()
        add(store, seed=1)
    both = (tmp_path / "runs.jsonl").read_bytes()
    for length in range(len(whole), len(both)):
        (tmp_path / "runs.jsonl").write_bytes(both[:length])
        assert [row.seed for row in store.rows()] == [0]


def test_a_damaged_line_in_the_middle_is_left_out_and_found_by_check(tmp_path, caplog):
    store = Store(tmp_path)
    with store.writing():
        add(store)
        add(store, seed=1)
    lines = (tmp_path / "runs.jsonl").read_bytes().splitlines(keepends=True)
    (tmp_path / "runs.jsonl").write_bytes(b"".join([lines[0], b"rubbish\n", lines[1]]))
    assert [row.seed for row in store.rows()] == [0, 1]
    assert "1 damaged line" in caplog.text
    assert list(verifying.faults(store)) == ["runs.jsonl, line 2: no whole row"]


@pytest.mark.parametrize(
    "change",
    [
        {"id": "../../etc/passwd"},
        {"surface_hash": "../../../tmp/x"},
        {"status": "fine"},
        {"seed": "0"},
        {"params": []},
        {"unknown": 1},
    ],
)
def test_a_row_that_no_run_wrote_is_no_row(store, change):
    row = add(store)
    record = plain(dataclasses.asdict(row)) | change
    with (store.folder / "runs.jsonl").open("a") as stream:
        stream.write(json.dumps(record) + "\n")
    assert [read.id for read in store.rows()] == [row.id]


def test_one_writer_at_a_time(store):
    with pytest.raises(InputError, match="in use by another run"), Store(store.folder).writing():
        pass


def test_the_lock_ends_with_its_process(tmp_path):
    store = Store(tmp_path)
    child = os.fork()
    if child == 0:
        store.writing().__enter__()
        os._exit(9)  # without any clean-up, as after kill -9
    os.waitpid(child, 0)
    with store.writing():
        add(store)


@pytest.mark.parametrize("kept", [0, 10])
def test_a_full_disk_takes_no_row_and_leaves_those_before(store, monkeypatch, kept):
    row = add(store)
    real = os.write

    def full(descriptor, content):
        real(descriptor, content[:kept])
        if kept:
            return kept
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "write", full)
    with pytest.raises(InputError, match="no space left"):
        add(store, status="failed", seed=1)
    monkeypatch.undo()
    assert [read.id for read in store.rows()] == [row.id]
    add(store, seed=2)
    assert [read.seed for read in store.rows()] == [0, 2]


def test_a_folder_of_a_newer_version_is_left_alone(tmp_path):
    (tmp_path / "environment.json").write_text(f'{{"format": {provenance.FORMAT + 1}, "runs": []}}')
    with pytest.raises(InputError, match="newer version"):
        Store(tmp_path)


def test_a_file_is_no_folder(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="is a file"):
        Store(tmp_path / "file")


def test_every_run_has_its_own_entry(store):
    assert store.add_run({"python": "3.11"}) == 0
    assert store.add_run({"python": "3.12"}) == 1
    assert [run["python"] for run in store.environment()["runs"]] == ["3.11", "3.12"]


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


def test_large_indices_keep_their_values(tmp_path):
    values = np.array([2**40, -(2**63)])
    write_arrays(tmp_path / "a.npz", {"a": values})
    np.testing.assert_array_equal(read_arrays(tmp_path / "a.npz")["a"], values)


def damaged_map(store, row):
    path = store.uv_path(row.id)
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])


def exchanged_map(store, row):
    write_arrays(store.uv_path(row.id), map_arrays(Parameterization(FLAT.uv * 2, FLAT.corners)))


def shortened_map(store, row):
    short = Parameterization(FLAT.uv, FLAT.corners[:1])
    write_arrays(store.uv_path(row.id), map_arrays(short))


def infinite_map(store, row):
    write_arrays(store.uv_path(row.id), map_arrays(FLAT) | {"uv": FLAT.uv + np.inf})


def missing_map(store, row):
    store.uv_path(row.id).unlink()


def exchanged_surface(store, row):
    arrays = {"vertices": SQUARE.vertices * 2, "faces": SQUARE.faces}
    write_arrays(store.surface_path(row.surface_hash), arrays)


@pytest.mark.parametrize(
    ("damage", "says"),
    [
        (damaged_map, "damaged"),
        (exchanged_map, "is not the map that was written"),
        (shortened_map, "has 1 rows for 2 faces"),
        (infinite_map, "must be finite"),
        (missing_map, "missing"),
        (exchanged_surface, "does not fit its name"),
    ],
)
def test_check_finds_what_is_wrong_with_a_file(store, damage, says):
    row = add(store)
    assert not list(verifying.faults(store))
    damage(store, row)
    assert any(says in fault for fault in verifying.faults(store))


def test_check_finds_a_row_that_was_edited(store):
    add(store)
    path = store.folder / "runs.jsonl"
    path.write_text(path.read_text().replace('"seed": 0', '"seed": 1'))
    (fault,) = verifying.faults(store)
    assert "its id is not that of its contents" in fault


def test_metrics_are_computed_once_for_each_map(store, monkeypatch):
    row = add(store)
    add(store, status="failed", seed=1)
    frame = measuring.metrics(store)
    assert list(frame.columns[:6]) == list(measuring.IDENTITY_COLUMNS)
    assert frame["status"].tolist() == ["ok", "failed"]
    assert json.loads(frame["params"][0]) == {"sizes": [1, 2]}
    # A square onto itself: an isometry.
    assert frame["symmetric_dirichlet"][0] == pytest.approx(4)
    assert np.isnan(frame["symmetric_dirichlet"][1])
    assert frame["id"][0] == row.id
    monkeypatch.setattr(measuring, "measured", lambda *_: pytest.fail("computed again"))
    again = measuring.metrics(Store(store.folder))
    assert again.equals(frame)
    assert not measuring.unmeasured(store)


def test_metrics_follow_the_map_and_their_own_source(store, monkeypatch):
    add(store, status="failed")
    measuring.metrics(store)
    stretched = Parameterization(FLAT.uv * [2, 1], FLAT.corners)
    row = add(store, stretched)
    assert [found.id for found in measuring.unmeasured(store)] == [row.id]
    assert measuring.metrics(store)["quasi_conformal_mean"][0] == pytest.approx(2)
    monkeypatch.setattr(measuring, "source_hash", lambda _: "another")
    assert [found.id for found in measuring.unmeasured(store)] == [row.id]


def test_metrics_that_were_computed_elsewhere_are_taken_and_kept(store):
    rows = [add(store), add(store, seed=1)]
    frame = measuring.metrics(store, {rows[0].id: {"symmetric_dirichlet": 7.0}, rows[1].id: {}})
    assert frame["symmetric_dirichlet"][0] == 7
    assert frame["symmetric_dirichlet"].isna()[1]
    assert not measuring.unmeasured(store)
    faults = list(verifying.faults(store))
    assert any("symmetric_dirichlet is 7.0 in metrics.parquet" in fault for fault in faults)


def test_a_reference_joins_the_metrics_and_asks_for_them_anew(store):
    row = add(store, Parameterization(FLAT.uv * [2, 1], FLAT.corners))
    assert measuring.metrics(store)["artist_correlation"].isna().all()
    store.add_reference(row.surface_hash, FLAT)
    assert [found.id for found in measuring.unmeasured(store)] == [row.id]
    # log sigma varies over the stretched map and not over the reference: no correlation.
    assert measuring.metrics(store)["artist_correlation"].tolist() == [1]


def test_surfaces_are_known_by_what_they_were_read_from_while_they_are_there(store):
    name = store.add_surface(SQUARE)
    store.note_surfaces({"file": name, "gone": "0" * 32, "evil": "../../x"})
    assert Store(store.folder).surface_hashes() == {"file": name}
    (store.folder / "surfaces.json").write_text("rubbish")
    assert store.surface_hashes() == {}


def test_a_damaged_table_is_made_anew(store, caplog):
    add(store)
    frame = measuring.metrics(store)
    (store.folder / "metrics.parquet").write_bytes(b"PAR1 rubbish")
    assert measuring.metrics(store).equals(frame)
    assert "damaged" in caplog.text
