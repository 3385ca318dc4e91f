"""Cells are isolated, limited and resumed; whatever a method does is a row."""

from __future__ import annotations

import dataclasses
import json
import os
import resource
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import numpy as np
import psutil
import pytest

from baselines import registry
from benchmarks.cases import models
from benchmarks.cases.suites import Suite
from benchmarks.checks import endurance
from benchmarks.metrics.evaluation import evaluate_points
from benchmarks.running import cell, environment, executors, planning, runner, scoring, scratch
from benchmarks.running.runner import Summary, run
from benchmarks.store import measuring, verifying
from benchmarks.store.results import Store
from benchmarks.store.rows import ResultRow
from parapoint.errors import InputError

METHOD = """
import ctypes, os, signal, subprocess, sys, time
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
from parapoint import Parameterization
from parapoint.method import UnsupportedError

FACES = frozenset({"faces"})


def flat(surface):
    report = {"energy": np.float64(2)}
    return Parameterization(surface.vertices[:, :2], surface.faces, report=report)
"""
FAULTS = {
    "segfault": "ctypes.string_at(0)",
    "quitter": "os._exit(0)",
    "exiter": "sys.exit('enough')",
    "suicide": "os.kill(os.getpid(), signal.SIGKILL)",
    "patricide": "os.kill(os.getppid(), signal.SIGKILL); time.sleep(60)",
    "eater": """
        hoard = []
        while True:
            hoard.append(np.ones(1 << 21))
            time.sleep(0.005)
        """,
    "family": """
        for _ in range(3):  # each below the limit, all together above it
            if not os.fork():
                hoard = np.ones(1 << 23)
                time.sleep(60)
        time.sleep(60)
        """,
    "refused": "raise MemoryError",
    "sleeper": """
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
            signal.signal(number, signal.SIG_IGN)
        print("going to sleep")
        while True:
            time.sleep(60)
        """,
    "forker": """
        noted, note = os.pipe()
        for _ in range(2):  # a daemon: its own session, its parent gone
            if os.fork():
                os.read(noted, 1)  # it would be stopped before it told its number
                return flat(surface)
            os.setsid()
        Path(os.environ["NOTES"], "daemon").write_text(str(os.getpid()))
        os.write(note, b"..")
        time.sleep(60)
        """,
    "printer": """
        for _ in range(20000):
            print("x" * 1000)
        print("the last words")
        raise ValueError("two\\nlines")
        """,
    "blank": "return Parameterization(surface.vertices[:, :2] * np.nan, surface.faces)",
    "short": "return Parameterization(surface.vertices[:, :2], surface.faces[1:])",
    "untyped": "return surface.vertices[:, :2]",
    "picky": "raise UnsupportedError('not on a Sunday')",
    "writer": """
        Path("litter").write_text("litter")
        Path(os.environ["NOTES"], "cwd").write_text(os.getcwd())
        return flat(surface)
        """,
    "verbose": """
        return Parameterization(surface.vertices[:, :2], surface.faces, report={"x": "y" * 2**21})
        """,
    "random": """
        uv = np.random.random((len(surface.vertices), 2))  # unseeded, all the same
        return Parameterization(uv, surface.faces)
        """,
}
CASE = "half_cylinder"
LIMITS = {"timeout": 3.0, "memory": 0.2}


def write_plugin(path: Path, bodies: dict[str, str]) -> list[str]:
    """Writes a file of methods; the plugins in it, named as the keys."""
    text = METHOD
    for name, body in bodies.items():
        lines = textwrap.indent(f"print('in {name}')\n" + textwrap.dedent(body), " " * 8)
        text += (
            f"\n@dataclass(frozen=True)\nclass {name.title()}:\n"
            f"    requires: ClassVar[frozenset[str]] = FACES\n"
            f"    step: int = 1\n"
            f"    def parameterize(self, surface, *, seed):\n{lines}\n"
        )
    path.write_text(text)
    return [f"{path}:{name.title()}" for name in bodies]


def suite(*methods: str, seeds: tuple[int, ...] = (0,)) -> Suite:
    return Suite("trial", "A trial", (CASE,), methods, seeds)


@pytest.fixture(scope="module")
def notes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("notes")


@pytest.fixture(scope="module")
def others() -> set[psutil.Process]:
    """The children that tests of other files left, such as the tracker of a pool of processes."""
    return set(psutil.Process().children(recursive=True))


@pytest.fixture(scope="module")
def faulty(
    tmp_path_factory: pytest.TempPathFactory,
    notes: Path,
    others: set[psutil.Process],  # noqa: ARG001 (they are counted before the run)
) -> tuple[Summary, Store]:
    """One run of all that a method can do wrong."""
    folder = tmp_path_factory.mktemp("faulty")
    os.environ["NOTES"] = str(notes)
    plugins = write_plugin(folder / "faults.py", FAULTS)
    summary = run(
        suite(), folder / "out", plugins=plugins, methods=[*FAULTS, "tutte"], jobs=2, **LIMITS
    )
    return summary, Store(folder / "out")


@pytest.fixture
def unmeasured(monkeypatch: pytest.MonkeyPatch) -> None:
    """Saves the second that the metrics take where they are beside the point."""
    monkeypatch.setattr(runner, "_measure", lambda *_: None)


class InProcess(executors.Local):
    """Does cells where it stands: for what is not about processes."""

    def run(self, tasks, _):
        for task in tasks:
            task.began()
            path = self.folder.with_name("map.npz")
            with Path(os.devnull).open("wb") as ahead:
                job = dataclasses.replace(task.job, folder=path.parent)
                outcome = cell.run(job, ahead.fileno())
            task.ended(outcome, path)


@pytest.fixture
def in_process(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runner, "_measure", lambda *_: None)
    monkeypatch.setattr(executors, "Local", InProcess)


def row_of(faulty: tuple[Summary, Store], method: str) -> ResultRow:
    return next(row for row in faulty[1].rows() if row.method == method)


@pytest.mark.parametrize(
    ("method", "status", "reason"),
    [
        ("segfault", "failed", "killed by SIGSEGV (segmentation fault)"),
        ("quitter", "failed", "ended the process (exit status 0) with no result"),
        ("exiter", "failed", "SystemExit: enough"),
        ("suicide", "failed", "killed by SIGKILL (killed)"),
        ("patricide", "failed", "the process that watched over it was killed"),
        ("refused", "out_of_memory", "MemoryError"),
        ("sleeper", "timeout", "not done within the limit of 3 s"),
        ("printer", "failed", "ValueError: two lines"),
        ("short", "failed", "returned 1151 corner rows for 1152 faces"),
        ("untyped", "failed", "returned ndarray for a mesh; it must be a Parameterization"),
        ("picky", "skipped", "not on a Sunday"),
    ],
)
def test_a_fault_is_a_row_with_its_reason(faulty, method, status, reason):
    row = row_of(faulty, method)
    assert (row.status, row.reason) == (status, reason)
    assert row.uv_file == row.uv_sha256 == ""


def test_nan_names_the_first_bad_row(faulty):
    assert row_of(faulty, "blank").reason == "the map has no place for anything: every uv is NaN"


def test_a_row_that_is_not_ok_has_the_last_lines_of_the_output(faulty):
    for row in faulty[1].rows():
        if row.status != "ok" and row.method != "printer":
            assert f"in {row.method}" in row.output, row.method


@pytest.mark.parametrize("method", ["eater", "family"])
def test_the_memory_limit_holds_for_all_processes_of_a_cell_together(faulty, method):
    row = row_of(faulty, method)
    assert row.status == "out_of_memory"
    assert row.reason.endswith("MB of memory; the limit is 200 MB")
    assert 200 < row.peak_memory_mb < 1500


def test_a_large_report_costs_the_cell_only(faulty):
    row = row_of(faulty, "verbose")
    assert row.status == "failed"
    assert "report is too large" in row.reason


@pytest.mark.usefixtures("unmeasured")
def test_a_cell_that_does_not_end_says_what_was_done_to_its_surface(tmp_path):
    bodies = {name: FAULTS[name] for name in ("sleeper", "segfault", "eater")}
    plugins = write_plugin(tmp_path / "cut.py", {f"cut{name}": bodies[name] for name in bodies})
    text = (tmp_path / "cut.py").read_text()
    (tmp_path / "cut.py").write_text(text.replace('{"faces"}', '{"disk_after_cut"}'))
    sphere = dataclasses.replace(suite(), cases=("sphere",))
    ran = run(sphere, tmp_path / "out", plugins=plugins, **LIMITS).ran
    assert [row.status for row in ran] == ["timeout", "failed", "out_of_memory"]
    assert {row.preprocessing for row in ran} == {"automatic cut to a disk"}


def test_modules_that_end_a_supervisor_are_left_to_the_cells(tmp_path, monkeypatch):
    (tmp_path / "harmful.py").write_text("import os\nos._exit(3)\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setattr(planning, "SLOW", ("harmful",))
    monkeypatch.setattr(registry, "imports", lambda *_: True)
    monkeypatch.setattr(runner, "_measure", lambda *_: None)
    ran = run(suite("tutte", seeds=(0, 1)), tmp_path / "out").ran
    assert [row.status for row in ran] == ["ok", "ok"]


def test_all_other_cells_are_untouched(faulty):
    summary, store = faulty
    assert len(store.rows()) == len(FAULTS) + 1
    assert row_of(faulty, "tutte").status == "ok"
    assert row_of(faulty, "random").status == "ok"
    assert not list(verifying.faults(store))
    assert {row.id for row in summary.ran} == {row.id for row in store.rows()}


def test_the_last_lines_printed_are_kept_and_no_more(faulty):
    printed = row_of(faulty, "printer").output
    assert "the last words" in printed
    assert len(printed) <= 4000
    assert "going to sleep" in row_of(faulty, "sleeper").output
    assert "Segmentation fault" in row_of(faulty, "segfault").output


def test_no_process_outlives_its_cell(faulty, notes, others):
    assert row_of(faulty, "forker").status == "ok"
    assert not psutil.pid_exists(int((notes / "daemon").read_text()))
    assert set(psutil.Process().children(recursive=True)) <= others


def test_a_method_writes_into_a_folder_that_goes_away(faulty, notes):
    assert row_of(faulty, "writer").status == "ok"
    assert not Path((notes / "cwd").read_text()).exists()
    assert not (faulty[1].folder / scratch.NAME).exists()
    assert not Path("litter").exists()


def test_every_cell_has_its_resources_and_an_ok_one_its_map(faulty):
    row, store = row_of(faulty, "forker"), faulty[1]
    assert row.report == {"energy": 2.0}
    assert row.params == {"step": 1}
    assert 0 <= row.seconds < 5
    assert 0 <= row.cpu_seconds < 5
    assert 0 <= row.load < 1000
    assert 20 < row.peak_memory_mb < 200
    surface, result = store.surface(row), store.result(row)
    assert (result.uv == surface.vertices[:, :2]).all()
    assert (result.corners == surface.faces).all()


def test_the_environment_of_a_run_is_written(faulty):
    (entry,) = faulty[1].environment()["runs"]
    assert {"commit", "python", "packages", "cpu", "threads", "date"} <= entry.keys()
    assert (entry["jobs"], entry["time_limit"], entry["memory_limit"]) == (2, 3.0, 2e8)


def test_metrics_of_all_cells_are_there_after_a_run(faulty):
    frame = measuring.metrics(faulty[1])
    assert list(frame.columns[:6]) == ["suite", "case", "method", "params", "seed", "status"]
    assert len(frame) == len(FAULTS) + 1
    values = frame.set_index("method")["angle_difference_mean"]
    assert values.notna().to_dict() == {row.method: row.status == "ok" for row in faulty[1].rows()}


@pytest.mark.usefixtures("in_process")
def test_a_method_that_needs_a_disk_is_skipped_on_a_sphere(tmp_path):
    plugins = write_plugin(tmp_path / "plugin.py", {"strict": "return flat(surface)"})
    text = (tmp_path / "plugin.py").read_text()
    (tmp_path / "plugin.py").write_text(text.replace('{"faces"}', '{"disk"}'))
    summary = run(suite(), tmp_path / "out", plugins=plugins, methods=["strict"], cases=["sphere"])
    (row,) = summary.ran
    assert (row.status, row.reason) == ("skipped", "needs a disk; the surface is sphere")


@pytest.mark.usefixtures("unmeasured")
def test_the_same_cell_gives_the_same_map(tmp_path, faulty):
    # The plugin is known to this process, not to the new run's workers.
    plugins = [f"{faulty[1].folder.parent}/faults.py:Random"]
    again = run(suite(), tmp_path, plugins=plugins, methods=["random", "tutte"], seeds=[0, 1])
    hashes = {(row.method, row.seed): row.uv_sha256 for row in again.ran}
    assert hashes["tutte", 0] == row_of(faulty, "tutte").uv_sha256
    assert hashes["random", 0] == row_of(faulty, "random").uv_sha256
    assert hashes["random", 0] != hashes["random", 1]


@pytest.mark.usefixtures("in_process")
def test_only_what_is_missing_or_changed_runs_again(tmp_path):
    out = tmp_path / "out"
    mesh = tmp_path / "mesh.off"
    mesh.write_text("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")
    bodies = {"one": "return flat(surface)", "two": "return flat(surface)"}
    (one,) = write_plugin(tmp_path / "first.py", {"one": bodies["one"]})
    (two,) = write_plugin(tmp_path / "second.py", {"two": bodies["two"]})

    def reasons(**options) -> dict[str, int]:
        options = {"plugins": [one, two], "methods": ["one", "two"], "cases": [str(mesh)]} | options
        return dict(run(suite(), out, **options).reasons)

    assert reasons() == {"new": 2}
    before = {row.id for row in Store(out).rows()}
    assert reasons() == {}
    assert reasons(methods=["one", "two(step=2)"]) == {"new": 1}
    with (tmp_path / "second.py").open("a") as stream:
        stream.write("\n# a change\n")
    assert reasons() == {"method changed": 1}
    mesh.write_text("OFF\n3 1 0\n0 0 0\n2 0 0\n0 1 0\n3 0 1 2\n")
    assert reasons() == {"model changed": 2}
    assert not before & {row.id for row in Store(out).rows()}
    assert before <= {row.id for row in Store(out).history()}
    assert len(Store(out).rows()) == 3
    next((out / "uv").glob(Store(out).rows()[0].id + "*")).unlink()
    assert reasons() == {"map missing": 1}


@pytest.mark.usefixtures("unmeasured")
def test_a_timeout_runs_again_only_under_a_higher_limit(tmp_path):
    plugins = write_plugin(tmp_path / "plugin.py", {"slow": "time.sleep(1); return flat(surface)"})
    options = {"plugins": plugins, "methods": ["slow"]}
    statuses = [
        [row.status for row in run(suite(), tmp_path / "out", timeout=limit, **options).ran]
        for limit in (0.3, 0.3, 30)
    ]
    assert statuses == [["timeout"], [], ["ok"]]


def test_what_was_not_installed_is_tried_again_and_loaded_before_the_clock(tmp_path):
    file = tmp_path / "plugin.py"
    file.write_text(f"""{METHOD}
from parapoint.method import MissingError

@dataclass(frozen=True)
class Guest:
    requires: ClassVar[frozenset[str]] = FACES

    def preload(self):
        if not Path({str(tmp_path / "installed")!r}).exists():
            raise MissingError("needs the package guest")
        time.sleep(0.3)

    def parameterize(self, surface, *, seed):
        return flat(surface)
""")
    found = []
    for _ in range(3):
        done = run(suite(), tmp_path / "out", plugins=[f"{file}:Guest"], methods=["guest"])
        found.append((dict(done.reasons), [(row.status, row.reason) for row in done.ran]))
        (tmp_path / "installed").touch()
    assert found == [
        ({"new": 1}, [("skipped", "not installed: needs the package guest")]),
        ({"may be installed now": 1}, [("ok", "")]),
        ({}, []),
    ]
    assert Store(tmp_path / "out").rows()[0].seconds < 0.3


@pytest.mark.usefixtures("in_process")
def test_a_missing_model_is_a_skipped_row_and_the_rest_runs(tmp_path, monkeypatch):
    load = models.load

    def without_sphere(case: str):
        if case == "sphere":
            raise models.MissingModelError("sphere is not at hand: draw one")
        return load(case)

    both = Suite("trial", "A trial", (CASE, "sphere"), ("tutte",), (0,))
    with monkeypatch.context() as patch:
        patch.setattr(models, "load", without_sphere)
        summary = run(both, tmp_path)
        assert summary.missing == {"sphere": "sphere is not at hand: draw one"}
        assert {row.case: row.status for row in summary.ran} == {CASE: "ok", "sphere": "skipped"}
        assert run(both, tmp_path).ran == []
        with pytest.raises(models.MissingModelError):
            run(both, tmp_path / "asked", cases=["sphere"])
        assert not (tmp_path / "asked").exists()
    assert dict(run(both, tmp_path).reasons) == {"model was missing": 1}
    with monkeypatch.context() as patch:  # gone again: its result stays
        patch.setattr(models, "load", without_sphere)
        summary = run(both, tmp_path)
        assert summary.ran == []
        assert {row.case: row.status for row in summary.kept} == {CASE: "ok", "sphere": "ok"}


def test_a_model_is_read_once_and_its_own_map_is_the_reference(tmp_path, monkeypatch):
    try:
        models.load("fish_control_mesh")
    except models.MissingModelError as error:
        pytest.skip(str(error))
    fish = Suite("trial", "A trial", ("fish_control_mesh",), ("lscm",), (0,))
    run(fish, tmp_path)
    assert measuring.metrics(Store(tmp_path))["artist_correlation"].notna().all()
    monkeypatch.setattr(models, "load", lambda case: pytest.fail(f"{case} is read again"))
    assert run(fish, tmp_path).ran == []


@pytest.mark.parametrize(
    "options",
    [
        {"methods": ["nonsense"]},
        {"methods": ["slim(nonsense=1)"]},
        {"cases": ["nonsense"]},
        {"cases": ["missing.obj"]},
        {"plugins": ["missing.py:Class"]},
    ],
)
def test_an_unknown_name_is_an_input_error_and_nothing_is_written(tmp_path, options):
    with pytest.raises(InputError):
        run(suite("tutte"), tmp_path / "out", **options)
    assert not (tmp_path / "out").exists()


def test_a_malformed_file_stops_the_run_before_it_begins(tmp_path):
    (tmp_path / "bad.off").write_text("OFF\n1 1 0\n0 0 nan\n3 0 0 9\n")
    with pytest.raises(InputError, match=r"bad\.off"):
        run(suite("tutte"), tmp_path / "out", cases=[CASE, str(tmp_path / "bad.off")])
    assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("in_process")
def test_a_disk_that_fills_up_ends_the_run_and_keeps_what_is_there(tmp_path, monkeypatch):
    run(suite("tutte"), tmp_path)
    before = (tmp_path / "runs.jsonl").read_bytes()
    real = os.write

    def full(descriptor: int, content: bytes) -> int:
        return real(descriptor, content[:10] if content.startswith(b'{"id"') else content)

    monkeypatch.setattr(os, "write", full)
    with pytest.raises(InputError, match=r"no space left .* earlier results are intact"):
        run(suite("lscm"), tmp_path)
    monkeypatch.undo()
    assert (tmp_path / "runs.jsonl").read_bytes() == before
    assert [row.status for row in run(suite("lscm"), tmp_path).ran] == ["ok"]


@pytest.mark.usefixtures("unmeasured")
@pytest.mark.usefixtures("in_process")
def test_a_file_that_may_not_grow_ends_the_run_and_keeps_what_is_there(tmp_path):
    """The system itself refuses the write, half-way through a row."""
    mesh, out = tmp_path / "mesh.off", tmp_path / "out"
    mesh.write_text("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")

    def seeds(count: int) -> list[int]:
        wanted = {"cases": [str(mesh)], "seeds": range(count)}
        return [row.seed for row in run(suite("tutte"), out, **wanted).ran]

    assert len(seeds(8)) == 8
    size = (out / "runs.jsonl").stat().st_size
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size + 3 * size // 16, hard))
    try:
        with pytest.raises(InputError, match=r"(too large|no space).*; earlier results are intact"):
            seeds(12)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert [row.seed for row in Store(out).rows()] == list(range(9))
    assert not list(verifying.faults(Store(out)))
    assert seeds(12) == [9, 10, 11]


ALIKE = {"atlasnet", "diffsr", "elestruc", "gtif", "tearingnet", "reggeonet"}
"""Networks that come into a cell as foldingnet or flattening_net do, by the same classes; the
conformance suite holds that each repeats its map."""


@pytest.mark.long
def test_every_method_gives_the_same_map_in_two_cells_or_says_that_it_does_not(
    tmp_path, monkeypatch
):
    monkeypatch.setattr(runner, "_measure", lambda *_: None)
    names = [name for name in registry.METHODS if name not in {"external", *ALIKE}]
    specs = {name: f"{name}({endurance.BUDGETS.get(name, '')})" for name in names}
    made = {name: registry.method(spec)[1] for name, spec in specs.items()}
    names = [name for name in names if not registry.environment(made[name])]
    promised = [name for name in names if getattr(made[name], "deterministic", True)]
    (mesh,), cloud = endurance.instant_suite(tmp_path, 1, 0, 0).cases, endurance.CASES[1]
    hashes: list[dict[str, str]] = []
    for folder in "one", "two":
        asked = [specs[name] for name in promised if name not in {"meshed", "textured"}]
        rows = run(suite(*asked), tmp_path / folder, cases=[mesh]).ran
        rows += run(suite(specs["meshed"]), tmp_path / folder, cases=[cloud]).ran
        hashes.append({row.method: row.uv_sha256 for row in rows})
    assert hashes[0] == hashes[1]
    mapped = {row.method for row in rows if row.status == "ok"}
    absent = {row.method for row in rows if row.reason.startswith("not installed")}
    # What needs seams is held to it by the conformance suite: only registered models bring any.
    # What needs colours is held to it by tests/baselines/test_textured.py; Blender, which runs in
    # an environment of its own, by tests/baselines/tools/test_blender.py.
    assert mapped | absent | {"artist+slim", "textured"} == set(promised)
    for spec in ("parapoint(time_budget=9, device=cpu)", "nuvo(time_budget=9)", "uvatlas"):
        assert not registry.method(spec)[1].deterministic
    assert registry.method("parapoint(device=cpu)")[1].deterministic
    assert not registry.method("external(command='{input} {output}')")[1].deterministic


def test_the_methods_that_learn_end_well_in_a_cell(tmp_path, monkeypatch):
    monkeypatch.setattr(runner, "_measure", lambda *_: None)
    budget = "points=120, subset=100, iterations=2"
    specs = [f"parapoint(preset=paper, {budget})", f"fam({budget})", f"nuvo({budget})"]
    ran = run(suite(*specs), tmp_path / "out").ran
    assert [(row.status, row.reason) for row in ran] == [("ok", "")] * 3


def test_a_killed_run_loses_only_the_cell_in_flight(tmp_path):
    body = f"""
        Path({str(tmp_path)!r}, str(seed)).write_text(str(os.getpid()))
        time.sleep(0.3 if seed < 2 else 60)
        return flat(surface)
        """
    (plugin,) = write_plugin(tmp_path / "plugin.py", {"late": body})
    command = ["-m", "benchmarks", "run", "--cases", CASE, "--methods", "late", "--seeds", "0,1,2"]
    process = subprocess.Popen(
        [sys.executable, *command, "--plugin", plugin, "--out", tmp_path / "out"],
        cwd=runner.environment.ROOT,
        stdout=subprocess.DEVNULL,
    )
    wait_until(lambda: (tmp_path / "2").is_file() and (tmp_path / "2").read_text())
    with pytest.raises(InputError, match="in use by another run"):
        run(suite("tutte"), tmp_path / "out")
    process.send_signal(signal.SIGKILL)
    process.wait()
    number = int((tmp_path / "2").read_text())
    wait_until(lambda: not psutil.pid_exists(number))
    with (tmp_path / "out" / "runs.jsonl").open("a") as stream:
        stream.write('{"id": "a torn li')
    done = Store(tmp_path / "out").rows()
    assert [(row.seed, row.status) for row in done] == [(0, "ok"), (1, "ok")]
    custom = Suite("custom", "Again", (CASE,), ("late",), (0, 1, 2))
    summary = run(custom, tmp_path / "out", plugins=[plugin], timeout=0.5)
    assert [(row.seed, row.status) for row in summary.ran] == [(2, "timeout")]
    assert summary.kept == done
    assert not list(verifying.faults(Store(tmp_path / "out")))
    assert "a torn li" in (tmp_path / "out" / "runs.torn").read_text()
    assert len(Store(tmp_path / "out").environment()["runs"]) == 2


def wait_until(condition, seconds: float = 30) -> None:
    """Waits for a condition to hold."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.02)


def test_a_wild_map_has_no_metrics_but_its_run_ends(tmp_path, monkeypatch):
    body = """
        uv = np.random.default_rng(seed).random((len(surface.vertices), 2))
        return Parameterization(uv * 1e300, surface.faces)
        """
    plugins = write_plugin(tmp_path / "plugin.py", {"wild": body})
    monkeypatch.setattr(scoring, "METRICS_TIME_LIMIT", 0.01)
    summary = run(suite(), tmp_path / "out", plugins=plugins, methods=["wild"])
    (row,) = summary.ran
    assert row.status == "ok"
    assert row.id in summary.unmeasured
    assert measuring.metrics(Store(tmp_path / "out"))["angle_difference_mean"].isna().all()
    assert json.loads((tmp_path / "out" / "runs.jsonl").read_text())["status"] == "ok"


PROJECTION = """
from dataclasses import dataclass
from typing import ClassVar
from parapoint import Parameterization, PointParameterization

@dataclass(frozen=True)
class Projection:
    requires: ClassVar[frozenset[str]] = frozenset()
    def parameterize(self, surface, *, seed):
        return PointParameterization(surface.points[:, :2])

@dataclass(frozen=True)
class Seams:
    requires: ClassVar[frozenset[str]] = frozenset({"seams"})
    def parameterize(self, surface, *, seed):
        report = {"seams": len(surface.seams)}
        return Parameterization(surface.vertices[:, :2], surface.faces, report=report)

@dataclass(frozen=True)
class Blind:
    requires: ClassVar[frozenset[str]] = frozenset({"faces"})
    def parameterize(self, surface, *, seed):
        report = {"seams": surface.seams is not None}
        return Parameterization(surface.vertices[:, :2], surface.faces, report=report)
"""


def test_a_noisy_cloud_is_mapped_and_its_points_without_noise_are_scored(tmp_path):
    plugin = tmp_path / "projection.py"
    plugin.write_text(PROJECTION)
    case = "saddle@noise=0.005"
    trial = Suite("trial", "A trial", (case,), (), (0,))
    out = tmp_path / "out"
    run(trial, out, methods=["projection"], plugins=[f"{plugin}:Projection"])
    store = Store(out)
    (row,) = store.rows()
    cloud, exact = store.surface(row), models.exact_points(case)
    assert np.array_equal(cloud.points, models.load(case).points)
    values = measuring.metrics(store).iloc[0]
    truth, other = (evaluate_points(points, store.result(row)) for points in (exact, cloud))
    name = "local_quasi_conformal_mean"
    assert values[name] == pytest.approx(truth[name])
    assert truth[name] != pytest.approx(other[name], rel=1e-3)
    assert list(verifying.faults(store)) == []


def test_the_seams_of_a_model_s_own_map_reach_the_methods_that_require_them_alone(tmp_path):
    plugin = tmp_path / "projection.py"
    plugin.write_text(PROJECTION)
    try:
        models.load("fish_control_mesh")
    except models.MissingModelError as error:
        pytest.skip(str(error))
    trial = Suite("trial", "A trial", ("fish_control_mesh", "saddle"), (), (0,))
    plugins = [f"{plugin}:Seams", f"{plugin}:Blind"]
    run(trial, tmp_path / "out", methods=["seams", "blind"], plugins=plugins)
    store = Store(tmp_path / "out")
    found = {(row.case, row.method): row for row in store.rows()}
    assert found["saddle", "seams"].status == "skipped"
    assert "came with a UV map" in found["saddle", "seams"].reason
    row = found["fish_control_mesh", "seams"]
    assert row.report == {"seams": len(store.reference(row).seams(store.surface(row)))}
    assert found["fish_control_mesh", "blind"].report == {"seams": False}


@pytest.mark.usefixtures("in_process")
def test_a_cell_that_is_asked_for_twice_runs_once(tmp_path):
    twice = dataclasses.replace(suite("tutte", "tutte", seeds=(0, 0)), cases=(CASE, CASE))
    assert dict(run(twice, tmp_path).reasons) == {"new": 1}
    assert len(list(Store(tmp_path).history())) == 1
    again = run(twice, tmp_path)
    assert (again.ran, len(again.kept)) == ([], 1)


HERE = {"time_limit": 10.0, "memory_limit": 1e9} | dict.fromkeys(environment.MACHINE, "as here")


@pytest.mark.parametrize(
    ("status", "there", "why"),
    [
        ("failed", {}, ""),
        *(
            ("failed", {name: "other"}, "failed in another environment")
            for name in environment.MACHINE
        ),
        ("timeout", {"time_limit": 10.0}, ""),
        ("timeout", {"time_limit": 9.0}, "limit raised"),
        ("timeout", {"time_limit": 20.0}, ""),  # it would end no sooner now
        ("timeout", {"memory_limit": 1.0}, ""),  # it was not memory that it lacked
        ("out_of_memory", {"memory_limit": 0.995e9}, ""),  # the total of a machine varies a little
        ("out_of_memory", {"memory_limit": 0.9e9}, "limit raised"),
        ("out_of_memory", {"memory_limit": 2e9}, ""),
        ("out_of_memory", {"time_limit": 1.0}, ""),
    ],
)
def test_what_did_not_end_well_runs_again_only_where_it_may_end_better(
    tmp_path, status, there, why
):
    row = ResultRow("id", "trial", CASE, "slow", {}, 0, "source", "surface", status)
    assert planning.changed(row, row, Store(tmp_path), [HERE | there], HERE) == why


@pytest.mark.parametrize("number", [-1, 1, 2])
def test_a_row_of_a_run_that_nobody_knows_was_made_elsewhere(tmp_path: Path, number: int) -> None:
    row = ResultRow("id", "trial", CASE, "slow", {}, 0, "source", "surface", "failed", run=number)
    why = planning.changed(row, row, Store(tmp_path), [HERE], HERE)
    assert why == "failed in another environment"


def test_a_limit_of_memory_holds_for_metrics_on_other_machines_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Here a map may need more to be measured than the limit that its method had to keep."""
    limits: list[float | None] = []
    monkeypatch.setattr(runner, "_measure", lambda _, __, memory, *___: limits.append(memory))
    monkeypatch.setattr(planning, "plan", lambda *_: ([], []))
    monkeypatch.setattr(
        executors, "executor", lambda _, folder, *, tick, **__: executors.Local(folder, 1, tick)
    )
    suite = Suite("trial", "A trial", ("cone",), ("tutte",))
    for name in ("local", "dask://somewhere:1"):
        run(suite, tmp_path, executor=name, memory=1.5)
    assert limits == [None, 1.5]
