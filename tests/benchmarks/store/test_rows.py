"""Rows: nothing that was written is lost, and nothing damaged is taken for a row."""

from __future__ import annotations

import dataclasses
import errno
import hashlib
import json
import os

import pytest

from benchmarks.store import verifying
from benchmarks.store.records import fields_of, plain
from benchmarks.store.results import Store
from benchmarks.store.rows import ResultRow, identity, row_of
from parapoint.errors import InputError

from .conftest import add


def test_the_latest_row_of_a_cell_counts_and_none_is_lost(store):
    add(store, status="timeout")
    old = add(store)
    other = add(store, seed=1)
    new = add(store, source_hash="def")
    assert [row.id for row in store.rows()] == [new.id, other.id]
    assert [row.status for row in store.history()] == ["timeout", "ok", "ok", "ok"]
    assert store.result(old).uv.shape == (4, 2)


def test_an_id_is_of_one_cell_and_the_first_keeps_it(store):
    """A line that somebody changed may claim the id of another cell."""
    first = add(store)
    store.append(dataclasses.replace(first, case="claims"))
    last = add(store, case="other")
    assert [(row.id, row.case) for row in store.rows()] == [
        (first.id, "square"),
        (last.id, "other"),
    ]
    assert len(store.history()) == 3


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
    rows = [
        ResultRow(first, status="ok", **cell | {"params": params})
        for params in ({"x": 1, "y": (1, 2)}, {"y": [1, 2], "x": 1})
    ]
    assert rows[0].cell == rows[1].cell


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


def test_no_row_is_a_program(store):
    add(store)
    assert not store.row_file.path.stat().st_mode & 0o111


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


CELL = {"suite": "a", "case": "b", "method": "c", "params": {"x": 1}, "seed": 0}


@pytest.mark.parametrize(
    "change", [{"suite": "z"}, {"case": "z"}, {"method": "z"}, {"params": {"x": 2}}, {"seed": 1}]
)
def test_rows_of_different_questions_do_not_replace_each_other(change):
    versions = {"source_hash": "d", "surface_hash": "e", "status": "ok"}
    row, other = (ResultRow("1", **cell, **versions) for cell in (CELL, CELL | change))
    assert row.cell != other.cell


def test_rows_of_one_question_replace_each_other_whatever_the_versions():
    old = ResultRow("1", **CELL, source_hash="d", surface_hash="e", status="ok")
    new = ResultRow("2", **CELL, source_hash="f", surface_hash="g", status="failed", run=7)
    assert old.cell == new.cell


@pytest.mark.parametrize("name", ["id", "surface_hash"])
@pytest.mark.parametrize("value", ["0" * 32 + "/../../x", "0" * 7, "0" * 65, "G" * 32, "", "0" * 8])
def test_names_of_files_are_hashes_and_nothing_else(name, value):
    row = ResultRow("1" * 32, **CELL, source_hash="d", surface_hash="2" * 32, status="ok")
    line = json.dumps(fields_of(row) | {name: value}).encode()
    is_fine = value == "0" * 8 or (name, value) == ("surface_hash", "")  # "": there is no surface
    assert (row_of(line) is not None) == is_fine


def test_a_row_is_on_the_disk_before_append_returns(store, monkeypatch):
    calls = []
    write, sync = os.write, os.fsync
    monkeypatch.setattr(os, "write", lambda *a: calls.append("write") or write(*a))
    monkeypatch.setattr(os, "fsync", lambda *a: calls.append("sync") or sync(*a))
    add(store, status="failed")
    assert calls[-2:] == ["write", "sync"]


def test_a_row_is_appended_inside_writing_alone(tmp_path):
    store = Store(tmp_path)
    with store.writing():
        add(store, status="failed")
    with pytest.raises(RuntimeError, match="inside appending"):
        add(store, status="failed", seed=1)
    assert len(store.rows()) == 1


def test_an_identity_is_what_it_was_so_that_published_rows_are_found_again():
    cell = {"suite": "a", "case": "b", "method": "c", "params": {"x": 1, "y": 2.5}, "seed": 0}
    known = identity(**cell, source_hash="d", surface_hash="e")
    text = '["a","b","c",{"x":1,"y":2.5},0,"d","e"]'
    assert known == hashlib.sha256(text.encode()).hexdigest()[:32]
    threaded = hashlib.sha256((text[:-1] + ",4]").encode()).hexdigest()[:32]
    assert identity(**cell, source_hash="d", surface_hash="e", threads=4) == threaded


@pytest.mark.parametrize(
    ("given", "is_row"),
    [
        ({}, True),
        ({"seed": 2**63 - 1}, True),
        ({"seed": 2**63}, False),
        ({"seed": -1}, False),
        ({"id": "no hash"}, False),
        ({"surface_hash": ""}, True),
        ({"surface_hash": "../x"}, False),
    ],
)
def test_only_lines_with_names_and_seeds_that_can_be_are_rows(store, given, is_row):
    row = dataclasses.replace(add(store), params={}, **given)
    found = row_of(json.dumps(fields_of(row)).encode())
    assert found == (row if is_row else None)
