"""Results that travel: publish, verify, merge; and whatever is wrong with an archive is refused."""

from __future__ import annotations

import dataclasses
import hashlib
import io
import json
import zipfile
from pathlib import Path

import pytest

from benchmarks.cases.builtin import BUILTIN
from benchmarks.cases.suites import SUITES, Suite
from benchmarks.store import (
    measuring,
    merging,
    publishing,
    recomputing,
    sealing,
    verifying,
    versions,
)
from benchmarks.store.results import Store
from parapoint.errors import InputError
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import PointCloud

from .conftest import add


def flat(case="wavy_sheet", shear=0.0):
    """A map of a built-in surface: its first two coordinates."""
    mesh = BUILTIN[case]()
    x, y, _ = mesh.vertices.T
    uv = mesh.vertices[:, :2].copy()
    uv[:, 0] = x + shear * y
    return mesh, Parameterization(uv, mesh.faces)


def write(folder, *cases, shear=0.0, suite="builtin", run=True, **changes):
    store = Store(folder)
    with store.writing():
        if run:
            store.add_run({"commit": "abc"} | versions.noted(suite))
        for case in cases:
            mesh, result = flat(case, shear)
            add(store, result, mesh, suite=suite, case=case, **changes)
    return store


@pytest.fixture
def archive(tmp_path):
    write(tmp_path / "a", "wavy_sheet", "cone")
    path = tmp_path / "a.zip"
    publishing.publish(tmp_path / "a", path)
    return path


def test_a_row_without_a_surface_needs_none_and_one_that_is_there_stays(tmp_path):
    here = write(tmp_path / "a", "wavy_sheet")
    there = write(tmp_path / "b", "wavy_sheet")
    (row,) = here.rows()
    place = there.surface_path(row.surface_hash)
    place.write_bytes(b"what was there")
    bare = dataclasses.replace(row, case="missing", surface_hash="")
    assert publishing.supply_surfaces(here, there, [row, bare]) == {}
    assert place.read_bytes() == b"what was there"


def test_all_files_of_a_surface_come_with_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From the rows' own folder, byte by byte; where that lacks them, from the model."""
    here = write(tmp_path / "a", "wavy_sheet")
    (row,) = here.rows()
    mesh, result = flat()
    here.add_reference(row.surface_hash, result)
    here.add_exact(row.surface_hash, exact := PointCloud(mesh.vertices))
    there = Store(tmp_path / "b")
    assert publishing.supply_surfaces(here, there, [row]) == {}
    files = [[path.read_bytes() for path in of.paths_of(row.surface_hash)] for of in (here, there)]
    assert files[0] == files[1]

    nothing, made = Store(tmp_path / "c"), Store(tmp_path / "d")
    monkeypatch.setattr(publishing.models, "reference", lambda _: result)
    monkeypatch.setattr(publishing.models, "exact_points", lambda _: exact)
    private = dataclasses.replace(row, case="/home/me/sheet.obj")
    faults = publishing.supply_surfaces(nothing, made, [private])
    assert "is not the one that these rows were computed on" in faults[private.case]
    assert not any(path.exists() for path in made.paths_of(row.surface_hash))
    assert publishing.supply_surfaces(nothing, made, [row]) == {}
    assert [path.read_bytes() for path in made.paths_of(row.surface_hash)] == files[0]


@pytest.mark.parametrize("method", ["flat", "other"])
def test_a_reference_that_a_later_source_alone_has_is_merged(tmp_path: Path, method: str) -> None:
    write(tmp_path / "a", "wavy_sheet")
    later = write(tmp_path / "b", "wavy_sheet", method=method)
    (row,) = later.rows()
    later.add_reference(row.surface_hash, flat()[1])
    merging.merge([tmp_path / "a", tmp_path / "b"], tmp_path / "c")
    merged = Store(tmp_path / "c").reference_path(row.surface_hash)
    assert merged.read_bytes() == later.reference_path(row.surface_hash).read_bytes()


def scores(store, rows):
    return {row.id: measuring.row_metrics(store, row) for row in rows}, {}


def test_publishing_twice_changes_no_byte_and_time_none(tmp_path, archive):
    before = archive.read_bytes()
    for path in (tmp_path / "a").rglob("*"):
        path.touch()
    found = publishing.publish(tmp_path / "a", archive)
    assert found == publishing.Published(2, 2, 0)
    assert archive.read_bytes() == before


def test_an_archive_holds_rows_maps_metrics_environment_and_hashes(archive):
    with zipfile.ZipFile(archive) as content:
        names = content.namelist()
        assert {info.external_attr >> 16 for info in content.infolist()} == {0o644}
        manifest = json.loads(content.read("manifest.json"))
        for name, digest in manifest["sha256"].items():
            assert hashlib.sha256(content.read(name)).hexdigest() == digest
    assert set(manifest["sha256"]) | {"manifest.json"} == set(names)
    kinds = {name.partition("/")[0] for name in names}
    wanted = {"rows.jsonl", "metrics.jsonl", "environment.json", "manifest.json", "uv"}
    assert kinds == wanted
    suite = SUITES["builtin"]
    assert manifest["suites"] == {"builtin": {f"{suite.version} ({suite.digest})": 2}}
    assert set(manifest["models"]) == {"wavy_sheet", "cone"}
    assert list(manifest) == sorted(manifest)  # by name, in whatever order they are made
    with publishing.opened(archive) as store:
        surfaces = {row.case: row.surface_hash for row in store.rows()}
    assert manifest["models"]["cone"] == {
        "surfaces": [surfaces["cone"]],
        "sha256": "",
        "licence": "made in memory",
    }


def test_a_published_archive_is_verified(archive):
    found = recomputing.verify(archive, scores)
    assert (found.rows, found.maps, found.faults) == (2, 2, [])
    assert found.values > 80


def test_a_metric_that_no_map_gives_is_named(archive):
    members = unsealed(archive)
    lines = [json.loads(line) for line in members["metrics.jsonl"].splitlines()]
    lines[0]["metrics"]["area_discrepancy_total"] *= 0.9
    members["metrics.jsonl"] = b"".join(json.dumps(line).encode() + b"\n" for line in lines)
    forge(archive, members)
    found = recomputing.verify(archive, scores)
    (fault,) = found.faults
    assert "area_discrepancy_total is " in fault
    assert "from the map" in fault


def test_a_map_in_place_of_another_is_named(archive):
    """An archive whose every hash is right, and whose map is not the one that the row speaks of."""
    with publishing.opened(archive) as store:
        first, second = (store.uv_path(row.id).read_bytes() for row in store.rows())
        names = [f"uv/{row.id}.npz" for row in store.rows()]
    members = unsealed(archive) | {names[0]: second, names[1]: first}
    forge(archive, members)
    found = recomputing.verify(archive, scores)
    assert sum("is not the map that was written" in fault for fault in found.faults) == 2


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"format": publishing.FORMAT + 1}, "was written by a newer version"),
        ({"format": "new"}, "has no manifest that can be read"),
        ({"format": publishing.FORMAT}, None),
    ],
)
def test_an_archive_of_a_newer_version_is_refused(
    change: dict[str, object], said: str | None, archive: Path
) -> None:
    members = unsealed(archive)
    manifest = json.loads(members["manifest.json"]) | change
    forge(archive, members | {"manifest.json": json.dumps(manifest).encode()})
    if said is None:
        assert recomputing.verify(archive, scores).faults == []
        return
    with pytest.raises(InputError, match=said):
        recomputing.verify(archive, scores)


def unsealed(archive):
    with zipfile.ZipFile(archive) as content:
        return {name: content.read(name) for name in content.namelist()}


def forge(archive, members):
    """Write an archive with right hashes and a right seal, whatever its members say."""
    manifest = json.loads(members["manifest.json"])
    manifest["sha256"] = {
        name: hashlib.sha256(data).hexdigest()
        for name, data in members.items()
        if name != "manifest.json"
    }
    sealing.write(archive, members | {"manifest.json": json.dumps(manifest).encode()})


def test_one_changed_byte_anywhere_is_refused(archive, tmp_path):
    content = archive.read_bytes()
    places = {*range(0, len(content), len(content) // 97), *range(len(content) - 100, len(content))}
    for place in sorted(places):
        changed = bytearray(content)
        changed[place] ^= 1
        archive.write_bytes(changed)
        with pytest.raises(InputError, match="seal"):
            recomputing.verify(archive, scores)
    archive.write_bytes(content[:-1])
    with pytest.raises(InputError, match="seal"):
        merging.merge([archive], tmp_path / "c")
    assert not (tmp_path / "c").exists()


@pytest.mark.parametrize(
    "name", ["../outside.npz", "/etc/outside", "uv/../../x.npz", "uv\\x.npz", "uv/x.npz", "lock"]
)
def test_names_outside_are_refused_and_write_nothing(archive, tmp_path, name):
    forge(archive, unsealed(archive) | {name: b"x"})
    before = sorted(path.name for path in tmp_path.iterdir())
    with pytest.raises(InputError, match="no name that a member may have"):
        merging.merge([archive], tmp_path / "c")
    assert sorted(path.name for path in tmp_path.iterdir()) == before


def zipped(compression):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", compression) as content:
        content.writestr("rows.jsonl", bytes(1_000_000))
    return stream.getvalue()


def test_what_is_no_archive_is_refused(tmp_path, archive):
    for data in (b"", b"PK", b"no zip" * 100, zipped(zipfile.ZIP_DEFLATED)):
        archive.write_bytes(data)
        with pytest.raises(InputError, match="it has no seal"):
            recomputing.verify(archive, scores)
    packed = zipped(zipfile.ZIP_DEFLATED)
    packed = packed[:-2] + sealing.SEAL_LENGTH.to_bytes(2, "little")
    seal = sealing.SEAL + hashlib.sha256(packed).hexdigest().encode()
    archive.write_bytes(packed + seal)
    with pytest.raises(InputError, match="is packed"):
        recomputing.verify(archive, scores)
    with pytest.raises(InputError, match="no such archive"):
        recomputing.verify(tmp_path / "none.zip", scores)
    with pytest.raises(InputError, match="is a folder"):
        recomputing.verify(tmp_path, scores)


@pytest.mark.parametrize(
    ("name", "data", "said"),
    [
        ("rows.jsonl", b"{}\n", "no row"),
        ("rows.jsonl", None, "rows.jsonl is missing"),
        ("metrics.jsonl", b"[1]\n", "metrics.jsonl: a line of it cannot be read"),
        ("metrics.jsonl", b'{"id": 1, "metrics": {"a": "x"}}\n', "cannot be read"),
        ("environment.json", b"[]", "damaged"),
    ],
)
def test_members_that_say_nothing_are_named(archive, name, data, said):
    members = unsealed(archive)
    del members[name]
    forge(archive, members if data is None else members | {name: data})
    with pytest.raises(InputError, match=said):
        recomputing.verify(archive, scores)


def test_a_row_without_its_map_is_refused(archive):
    members = unsealed(archive)
    del members[next(name for name in members if name.startswith("uv/"))]
    forge(archive, members)
    with pytest.raises(InputError, match="without its map"):
        recomputing.verify(archive, scores)


def test_own_files_are_left_out_and_counted(tmp_path):
    write(tmp_path / "a", "cone")
    store = Store(tmp_path / "a")
    with store.writing():
        add(store, case="/home/me/secret.obj")
    assert publishing.publish(tmp_path / "a", tmp_path / "a.zip").own == 1
    assert b"secret" not in (tmp_path / "a.zip").read_bytes()
    write(tmp_path / "b")
    with pytest.raises(InputError, match="nothing to publish"):
        publishing.publish(tmp_path / "b", tmp_path / "b.zip")


def test_a_file_of_the_user_s_is_not_overwritten(tmp_path):
    write(tmp_path / "a", "cone")
    (tmp_path / "a.zip").write_bytes(b"mine")
    with pytest.raises(InputError, match="in the way"):
        publishing.publish(tmp_path / "a", tmp_path / "a.zip")
    assert (tmp_path / "a.zip").read_bytes() == b"mine"


def test_folders_and_archives_are_merged_and_the_first_answer_stays(tmp_path, archive):
    write(tmp_path / "b", "cone", "saddle", shear=0.5)  # cone has another map here
    write(tmp_path / "d", "wavy_sheet")  # as in the archive
    found = merging.merge([archive, tmp_path / "b", tmp_path / "d"], tmp_path / "c")
    assert (found.rows, found.same) == (3, 1)
    assert found.contested == [f"cone, flat, seed 0: {tmp_path / 'b'}"]
    store = Store(tmp_path / "c")
    assert [row.case for row in store.rows()] == ["wavy_sheet", "cone", "saddle"]
    assert [row.run for row in store.rows()] == [0, 0, 1]
    assert len(store.environment()["runs"]) == 3
    with publishing.opened(archive) as first:
        there = {row.case: row.uv_sha256 for row in first.rows()}
    assert {row.case: row.uv_sha256 for row in store.rows()[:2]} == there
    assert not list(verifying.faults(store))
    assert all(store.surface(row) for row in store.rows())
    assert measuring.metrics(store)["area_discrepancy_total"].notna().all()
    assert not [path for path in tmp_path.iterdir() if path.name.endswith(".part")]


def test_rows_of_two_versions_are_not_mixed(tmp_path, monkeypatch):
    write(tmp_path / "a", "cone")
    write(tmp_path / "old", "saddle", run=False)
    newer = dataclasses.replace(SUITES["builtin"], version=2)
    monkeypatch.setitem(SUITES, "builtin", newer)
    write(tmp_path / "b", "wavy_sheet")
    with pytest.raises(InputError, match=r"different versions of builtin.*version 1 .*version 2 "):
        merging.merge([tmp_path / "a", tmp_path / "b"], tmp_path / "c")
    assert not (tmp_path / "c").exists()
    assert merging.merge([tmp_path / "a", tmp_path / "old"], tmp_path / "c").unversioned == {
        "builtin": 1
    }


def test_a_suite_s_digest_is_that_of_what_makes_results_comparable():
    suite = Suite("x", "x", ("cone", "hand_1_i_f5000"), ("slim",))
    same = dataclasses.replace(suite, title="y", methods=("tutte",))
    assert same.digest == suite.digest
    for change in ({"cases": ("cone",)}, {"seeds": (0, 1)}, {"version": 2}, {"name": "z"}):
        assert dataclasses.replace(suite, **change).digest != suite.digest


def test_what_is_merged_must_exist_and_its_place_must_be_free(tmp_path, archive):
    with pytest.raises(InputError, match="is there already"):
        merging.merge([archive], tmp_path / "a")
    with pytest.raises(InputError, match="no such archive"):
        merging.merge([tmp_path / "none"], tmp_path / "c")
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="no results folder"):
        merging.merge([tmp_path / "empty"], tmp_path / "c")
    assert not (tmp_path / "c").exists()


def test_another_model_under_the_same_name_is_said(archive, monkeypatch, tmp_path):
    monkeypatch.setitem(BUILTIN, "cone", BUILTIN["saddle"])
    found = recomputing.verify(archive, scores)
    (fault,) = found.faults
    assert fault.startswith("cone: cannot be checked: the model is not the one")
    with pytest.raises(InputError, match="cone: the model is not the one"):
        merging.merge([archive], tmp_path / "c")
    assert not (tmp_path / "c").exists()
