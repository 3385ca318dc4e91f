"""What a supervisor makes of a child, and a child of a method."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import psutil
import pytest

from baselines import registry
from benchmarks.running import cell, limits, worker
from benchmarks.running.environment import ROOT
from benchmarks.running.tasks import Outcome, Prepared, Ready, RunJob, from_json, to_json
from benchmarks.store.archives import read_map, read_surface
from benchmarks.store.measuring import measured
from benchmarks.store.results import Store
from benchmarks.store.rows import MACHINE, SOURCE_CHANGED
from parapoint import sources
from parapoint.surfaces.parameterization import Parameterization, PointParameterization
from parapoint.surfaces.surface import Mesh, PointCloud
from parapoint.testing import sample_surfaces

TRIANGLE = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
CLOUD = PointCloud(TRIANGLE.vertices)
UV = TRIANGLE.vertices[:, :2]


@pytest.mark.parametrize(
    ("surface", "result", "says"),
    [
        (TRIANGLE, Parameterization(UV, [[0, 1, 2]]), ""),
        (TRIANGLE, Parameterization(UV, [[0, 1, 2]] * 2), "2 corner rows for 1 faces"),
        (TRIANGLE, PointParameterization(UV), "must be a Parameterization"),
        (TRIANGLE, None, "returned NoneType for a mesh"),
        (CLOUD, PointParameterization(UV), ""),
        (CLOUD, PointParameterization(UV[:2]), "2 uv rows for 3 points"),
        (CLOUD, UV, "must be a PointParameterization"),
    ],
)
def test_a_result_must_fit_its_surface(surface, result, says):
    fault = cell.fault(surface, result)
    assert says in fault
    assert bool(fault) == bool(says)


@pytest.mark.parametrize(
    ("status", "killed_by_system", "outcome"),
    [
        (signal.SIGKILL, True, ("out_of_memory", "killed by the system, which ran out of memory")),
        (signal.SIGKILL, False, ("failed", "killed by SIGKILL (killed)")),
        (signal.SIGBUS, True, ("failed", "killed by SIGBUS (bus error)")),
        (signal.SIGRTMIN + 1, False, ("failed", f"killed by signal {signal.SIGRTMIN + 1}")),
        (3 << 8, False, ("failed", "ended the process (exit status 3) with no result")),
    ],
)
def test_a_death_is_said_in_words(status, killed_by_system, outcome):
    said = worker._death(int(status), killed_by_system=killed_by_system)
    assert said.status == outcome[0]
    assert said.reason.startswith(outcome[1])


@pytest.mark.parametrize(
    ("error", "status", "reason"),
    [
        (MemoryError(), "out_of_memory", "MemoryError"),
        (RuntimeError("DefaultCPUAllocator: can't allocate memory: 8 TB"), "out_of_memory", None),
        (type("OutOfMemoryError", (RuntimeError,), {})("CUDA"), "out_of_memory", None),
        (ValueError("a\n  b"), "failed", "ValueError: a b"),
        (ValueError("x" * 10_000), "failed", "ValueError: " + "x" * 500),
        (KeyError("key"), "failed", "KeyError: 'key'"),
    ],
)
def test_an_error_is_one_line(error, status, reason):
    found = cell.failure(error)
    assert found[0] == status
    assert reason is None or found[1] == reason


def test_a_row_says_what_was_done_to_the_surface_before_and_in_which_component_it_failed(
    tmp_path, monkeypatch
):
    store = Store(tmp_path)
    with store.writing():
        surface = store.add_surface(sample_surfaces()["a defective mesh"])
    method = registry.method("tutte")[1]
    job = RunJob(
        spec="tutte",
        seed=0,
        source_hash=registry.source_hash(method),
        surface=store.surface_path(surface),
        folder=tmp_path,
        time_limit=60.0,
        memory_limit=1e9,
    )
    steps = (
        "dropped 1 face without area; dropped 1 duplicate face; split 1 non-manifold edge; split 2 "
        "non-manifold vertices; turned 20 faces; packed 2 components; "
        "automatic cut to a disk (1 of 2 components)"
    )
    receive, send = os.pipe()
    loads = iter([0.5, 2.0])  # before and after
    monkeypatch.setattr(cell, "load", lambda: next(loads, None))
    began, used = time.monotonic(), time.process_time()
    outcome = cell.run(job, send)
    assert 0 < outcome.seconds < time.monotonic() - began
    assert 0 <= outcome.cpu_seconds < time.process_time() - used + 0.05  # the system's grain
    assert outcome.load == 2.0
    assert worker._said(os.read(receive, 4096)) == (steps, None)
    assert (outcome.status, outcome.preprocessing) == ("ok", steps)
    mesh, result = read_surface(store.surface_path(surface)), read_map(tmp_path / "map.npz")
    values = measured(mesh, result)
    assert values["chart_count"] == 2
    assert values["degenerate_3d_count"] == 1
    assert values["degenerate_uv_count"] == 0
    # The copy lies on its face, whose rows it shares, the other way round.
    assert values["flipped_fraction"] == 1 / len(mesh.faces)
    assert values["overlap_pair_fraction"] == 0
    assert values["overlapped_fraction"] > 0
    assert values["bijective"] == 0

    def refusing(*_, **__):
        raise ValueError("no")

    monkeypatch.setattr(type(method), "parameterize", refusing)
    outcome = cell.run(job, send)
    os.close(receive)
    os.close(send)
    assert (outcome.status, outcome.preprocessing) == ("failed", steps)
    assert outcome.reason == "ValueError: no (component 1 of 2, 176 faces)"


def test_a_message_counts_only_if_it_is_whole():
    ended = Outcome("ok", preprocessing="cut")
    ahead, whole = to_json(Prepared("cut")), to_json(ended)
    assert worker._said(whole) == ("", ended)
    assert worker._said(ahead + whole) == ("cut", ended)
    for length in range(len(whole)):
        assert worker._said(ahead + whole[:length]) == ("cut", None)
    assert worker._said(b"[1]\n\xff\n3\n" + to_json(Ready()) + ahead) == ("cut", None)


@pytest.mark.parametrize("forks", [True, False])
def test_a_supervisor_does_one_cell_after_another(tmp_path, forks):
    """Where forking is not safe, a fresh interpreter does the same, without what is imported."""
    if forks and not worker.FORKS:
        pytest.skip("no forks on this system")
    with Store(tmp_path).writing():
        surface = Store(tmp_path).add_surface(TRIANGLE)
    name = f"Still{forks}"  # plugins stay for the process: each needs a name of its own
    (tmp_path / "plugin.py").write_text(
        "import sys\n"
        "from dataclasses import dataclass\n"
        "from typing import ClassVar\n"
        "from parapoint import Parameterization\n"
        "@dataclass(frozen=True)\n"
        f"class {name}:\n"
        "    requires: ClassVar[frozenset[str]] = frozenset()\n"
        "    def parameterize(self, surface, *, seed):\n"
        "        print('a fork:', 'benchmarks.running.worker' in sys.modules)\n"
        "        return Parameterization(surface.vertices[:, :2] + seed, surface.faces)\n"
    )
    plugin = f"{tmp_path}/plugin.py:{name}"
    spec = registry.register_plugin(plugin)
    source_hash = registry.source_hash(registry.method(spec)[1])
    receive, send = os.pipe()
    code = (
        "from benchmarks.running import limits, worker\n"
        f"limits.FORKS = worker.FORKS = {forks}\n"
        "worker.main()"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", code, str(send)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        pass_fds=[send],
        cwd=ROOT,
    )
    os.close(send)
    assert process.stdin is not None
    (tmp_path / "work").mkdir()
    with os.fdopen(receive, "rb") as replies:
        assert from_json(replies.readline(), Ready) == Ready()
        for seed in (3, 4):
            job = RunJob(
                spec=spec,
                plugins=(plugin,),
                seed=seed,
                source_hash=source_hash,
                surface=Store(tmp_path).surface_path(surface),
                folder=tmp_path,
                time_limit=60.0,
                memory_limit=1e9,
            )
            process.stdin.write(to_json(job))
            process.stdin.flush()
            outcome = from_json(replies.readline(), Outcome)
            assert outcome.status == "ok", outcome
            np.testing.assert_array_equal(read_map(tmp_path / "map.npz").uv, UV + seed)
    printed, _ = process.communicate(timeout=30)
    assert printed.decode() == f"a fork: {forks}\n" * 2
    assert process.returncode == 0


SLEEPER = """
import os, time
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

@dataclass(frozen=True)
class Lingerer:
    requires: ClassVar[frozenset[str]] = frozenset()

    def parameterize(self, surface, *, seed):
        Path(__file__).with_name("cell").write_text(f"{os.getpid()} ")
        time.sleep(60)
"""


@pytest.mark.skipif(not limits.FORKS, reason="a fork is told of it, another process is not")
def test_a_supervisor_ends_with_its_cell_once_the_run_is_gone(tmp_path: Path) -> None:
    with Store(tmp_path).writing():
        surface = Store(tmp_path).add_surface(TRIANGLE)
    (tmp_path / "plugin.py").write_text(SLEEPER)
    plugin = f"{tmp_path}/plugin.py:Lingerer"
    spec = registry.register_plugin(plugin)
    (tmp_path / "work").mkdir()
    job = RunJob(
        spec=spec,
        plugins=(plugin,),
        seed=0,
        source_hash=registry.source_hash(registry.method(spec)[1]),
        surface=Store(tmp_path).surface_path(surface),
        folder=tmp_path,
        time_limit=60.0,
        memory_limit=1e9,
    )
    receive, send = os.pipe()
    command = [sys.executable, "-m", "benchmarks.running.worker", str(send)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, pass_fds=[send], cwd=ROOT) as process:
        os.close(send)
        with os.fdopen(receive, "rb") as replies:
            assert from_json(replies.readline(), Ready) == Ready()
            assert process.stdin is not None
            process.stdin.write(to_json(job))
            process.stdin.flush()
            end = time.monotonic() + 20
            while not (note := tmp_path / "cell").exists() or not note.read_text().endswith(" "):
                assert time.monotonic() < end, "the cell has not begun"
                time.sleep(0.01)
            process.stdin.close()
            assert process.wait(10) == 1
    assert not psutil.pid_exists(int(note.read_text()))


def test_a_map_that_cannot_be_written_is_the_machine_s_fault(tmp_path, monkeypatch):
    store = Store(tmp_path)
    with store.writing():
        surface = store.add_surface(TRIANGLE)
    job = RunJob(
        spec="tutte",
        seed=0,
        source_hash=registry.source_hash(registry.method("tutte")[1]),
        surface=store.surface_path(surface),
        folder=tmp_path,
        time_limit=60.0,
        memory_limit=1e9,
    )

    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(cell, "write_arrays", full)
    with Path(os.devnull).open("wb") as ahead:
        outcome = cell.run(job, ahead.fileno())
    assert outcome.status == "failed"
    assert outcome.reason == f"{MACHINE}OSError: [Errno 28] No space left on device"


def test_a_cell_whose_method_has_changed_is_told_so(tmp_path):
    store = Store(tmp_path)
    with store.writing():
        surface = store.add_surface(TRIANGLE)
    job = RunJob(
        spec="tutte",
        seed=0,
        source_hash="another",
        surface=store.surface_path(surface),
        time_limit=60.0,
        memory_limit=1e9,
    )
    assert cell.run(job, -1) == Outcome("failed", SOURCE_CHANGED)


@pytest.mark.parametrize("spec", ["tutte", "slim(iterations=5)"])
def test_a_supervisor_parses_the_sources_of_a_method_for_all_its_cells(spec):
    sources.imported.cache_clear()
    worker._parse.__wrapped__(spec, ())
    parsed = sources.imported.cache_info().misses
    registry.source_hash(registry.method(spec)[1])
    assert sources.imported.cache_info().misses == parsed > 0


def test_a_supervisor_parses_a_plugin_and_does_not_run_it(tmp_path):
    file = tmp_path / "plugin.py"
    file.write_text("import json\nraise SystemExit('a supervisor runs no plugin')\n")
    sources.imported.cache_clear()
    worker._parse.__wrapped__("mine(step=1)", (f"{file}:Mine",))
    parsed = sources.imported.cache_info().misses
    assert sources.imported(file.read_text(), "") == ("json",)
    assert sources.imported.cache_info().misses == parsed


@pytest.mark.parametrize("spec", ["mine(step=1)", "no spec (", "tutte"])
def test_a_supervisor_leaves_faults_of_a_spec_or_a_plugin_to_the_cell(spec):
    worker._parse.__wrapped__(spec, ("missing.py:Mine",))


@pytest.mark.skipif(not limits.FORKS, reason="no such thing on this system")
def test_a_process_ends_with_its_parent_even_where_that_is_killed() -> None:
    code = (
        "import os, time; from benchmarks.running.limits import end_with\n"
        "parent = os.getpid()\n"
        "if not os.fork():\n"
        "    end_with(parent); print(os.getpid(), flush=True)\n"
        "time.sleep(60)"
    )
    command = [sys.executable, "-c", code]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout is not None
        child = psutil.Process(int(parent.stdout.readline()))
        parent.kill()
    end = time.monotonic() + 5
    while child.is_running() and child.status() != psutil.STATUS_ZOMBIE:
        assert time.monotonic() < end, "it goes on"
        time.sleep(0.01)


@pytest.mark.skipif(not limits.FORKS, reason="no such thing on this system")
def test_a_process_whose_parent_has_ended_before_ends_at_once() -> None:
    code = "from benchmarks.running.limits import end_with; end_with(-1); print('goes on')"
    ended = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, check=False)
    assert (ended.returncode, ended.stdout) == (1, b"")
