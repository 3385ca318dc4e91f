"""Which cells a run needs, from what the results folder has already."""

from __future__ import annotations

import pytest

from baselines import registry
from benchmarks.cases import models
from benchmarks.cases.suites import Suite
from benchmarks.running import environment, environments, planning
from benchmarks.store.results import Store
from benchmarks.store.rows import ResultRow, identity
from parapoint.errors import InputError


@pytest.fixture
def without_sphere(monkeypatch):
    """A place where the sphere cannot be had."""
    load = models.load

    def loaded(case: str):
        if case == "sphere":
            raise models.MissingModelError("sphere is not at hand")
        return load(case)

    monkeypatch.setattr(models, "load", loaded)


@pytest.mark.usefixtures("without_sphere")
def test_a_run_is_refused_only_where_every_model_is_missing(tmp_path):
    planning.check_readable(["sphere", "cone"], Store(tmp_path))
    planning.check_readable([], Store(tmp_path))
    with pytest.raises(models.MissingModelError, match="sphere is not at hand"):
        planning.check_readable(["sphere"], Store(tmp_path))


def test_what_there_is_to_say_of_a_file_is_said_once(tmp_path, caplog):
    path = tmp_path / "a.off"
    path.write_text("OFF\n4 2 0\n0 0 0\n1 0 0\n0 1 0\n1 0 0\n3 0 1 2\n3 1 2 3\nspare\n")
    store = Store(tmp_path / "results")
    planning.check_readable([str(path)], store)
    with store.writing():
        planning.surfaces(store, [str(path)])
    assert caplog.messages == [
        f"{path}: lines behind the last face left out: 1",
        f"{path}: doubled vertices taken as one: 1",
    ]


@pytest.mark.usefixtures("without_sphere")
def test_a_missing_model_has_no_hash_and_a_reason(tmp_path):
    store = Store(tmp_path)
    with store.writing():
        hashes, missing = planning.surfaces(store, ["sphere", "cone"])
    assert missing == {"sphere": "sphere is not at hand"}
    assert hashes["sphere"] == ""
    assert store.surface_path(hashes["cone"]).exists()


@pytest.mark.parametrize(
    ("file", "text"),
    [
        ("a.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"),
        ("a.ply", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"),
    ],
)
def test_a_surface_is_known_again_by_content_ending_and_readers(tmp_path, file, text):
    path = tmp_path / file
    path.write_text(text)
    first = planning._origin(str(path), "readers")
    copy = path.with_name(f"b{path.suffix.upper()}")
    copy.write_text(text)
    assert planning._origin(str(copy), "readers") == first
    copy.write_text(text + "\n")
    other = tmp_path / "a.obj"
    other.write_text(text)
    others = [
        planning._origin(str(copy), "readers"),
        planning._origin(str(other), "readers"),
        planning._origin(str(path), "other readers"),
    ]
    assert len({first, *others}) == 4


def test_a_surface_that_no_one_file_decides_is_read_every_time(tmp_path):
    (tmp_path / "a.glTF").write_text("{}")
    for case in (str(tmp_path / "a.glTF"), "cone", "saddle@noise=0.005"):
        assert planning._origin(case, "readers") == ""


def test_a_file_that_is_gone_is_bad_input(tmp_path, monkeypatch):
    path = tmp_path / "a.off"
    monkeypatch.setattr(models, "info", lambda _: None)
    monkeypatch.setattr(models, "is_made_in_memory", lambda _: False)
    with pytest.raises(InputError, match=r"a\.off"):
        planning._origin(str(path), "readers")


SURFACE = "0123abcd"


def counted(threads: int | None, **given: object) -> ResultRow:
    fields = {"suite": "trial", "case": "c", "method": "fam", "params": {}, "seed": 0}
    fields |= {"source_hash": "abc", "surface_hash": SURFACE, "threads": threads}
    return ResultRow(id=identity(**fields), status="failed", **fields, **given)


def test_the_number_of_threads_is_part_of_a_cell_where_its_map_depends_on_it(tmp_path):
    store, here = Store(tmp_path), dict.fromkeys(environment.MACHINE, "here")
    runs = [here | {"threads": 2}]
    again = "other number of threads"
    assert planning.changed(counted(1), counted(2), store, runs, here) == again
    assert planning.changed(counted(2), counted(2), store, runs, here) == ""
    assert planning.changed(counted(1), counted(None), store, runs, here) == again  # an older row
    assert planning.changed(counted(2), counted(None), store, runs, here) == ""
    assert planning.changed(counted(None), counted(None), store, runs, here) == ""
    assert len({counted(threads).id for threads in (None, 1, 2)}) == 3


def test_methods_that_torch_computes_count_threads_and_say_so():
    for name in ("parapoint", "fam", "nuvo"):
        assert registry.depends_on_threads(registry.method(name)[1])
        assert registry.describe(name).deterministic.endswith("with as many threads")
    for name in ("computed", "slim", "tutte"):
        assert not registry.depends_on_threads(registry.method(name)[1])
        assert "threads" not in registry.describe(name).deterministic


@pytest.mark.parametrize(
    ("noted", "made", "reasons"),
    [
        ({"one>=1": {"one": "1"}}, {"one": "1"}, []),
        ({"one>=1": {"one": "1"}}, {"one": "2"}, ["libraries changed"]),
        ({"one>=1": {"one": "1"}}, None, []),  # no environment is there to tell
        ({}, {"one": "2"}, []),  # it was skipped, or is older than what a run notes
    ],
)
def test_a_cell_runs_again_once_its_own_environment_has_other_versions(
    tmp_path, monkeypatch, noted, made, reasons
):
    now = made and environments.Environment(tmp_path, made)
    monkeypatch.setattr(environments, "found", lambda _: now)
    trial = Suite("trial", "A trial", ("c",), ("fam",))
    method = planning.Chosen("fam", "fam", {}, "abc", (), environment=("one>=1",))
    here = dict.fromkeys(environment.MACHINE, "here") | {"threads": 1}
    store = Store(tmp_path)
    with store.writing():
        run = store.add_run(here | {"environments": noted})
        store.append(counted(None, run=run))
    planned, _ = planning.plan(trial, [method], {"c": SURFACE}, store, here)
    assert [cell.why for cell in planned] == reasons
    # Where the model is gone, what is known of it stays.
    assert planning.plan(trial, [method], {"c": ""}, store, here)[0] == []
