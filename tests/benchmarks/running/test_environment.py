"""What a worker compares to know that it has the same version of the project."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import psutil
import pytest

from benchmarks.running import environment


@pytest.mark.parametrize("place", ["parapoint/a.py", "benchmarks/room/a.py", "baselines/x/y/a.py"])
def test_every_source_file_of_the_project_counts(tmp_path, monkeypatch, place):
    monkeypatch.setattr(environment, "ROOT", tmp_path)
    path = tmp_path / place
    path.parent.mkdir(parents=True)
    path.write_text("x = 1\n")
    first = environment.project.__wrapped__()
    assert environment.project.__wrapped__() == first
    path.write_text("x = 2\n")
    second = environment.project.__wrapped__()
    path.rename(path.with_name("b.py"))
    assert len({first, second, environment.project.__wrapped__()}) == 3


@pytest.mark.parametrize(
    ("variable", "jobs", "threads"),
    [("", 1, 6), ("", 4, 1), ("", 3, 2), ("", 9, 1), ("3", 4, 3), ("0", 3, 2), ("many", 3, 2)],
)
def test_cells_share_the_cores_unless_the_user_says_how_many_threads(
    monkeypatch, variable, jobs, threads
):
    monkeypatch.setattr(environment, "cores", lambda: 6)
    monkeypatch.setenv("OMP_NUM_THREADS", variable)
    assert environment.threads(jobs) == threads


@pytest.mark.parametrize(("limit", "memory"), [("max", 1000), ("400\n", 400), ("4000", 1000)])
def test_the_memory_of_a_container_is_its_limit(monkeypatch, limit, memory):
    monkeypatch.setattr(psutil, "virtual_memory", lambda: SimpleNamespace(total=1000))
    monkeypatch.setattr(Path, "read_text", lambda _: limit)
    assert environment.memory() == memory


def test_the_load_is_that_of_a_minute_over_the_processors(monkeypatch):
    monkeypatch.setattr(environment.os, "getloadavg", lambda: (6.0, 1.0, 1.0))
    monkeypatch.setattr(environment.os, "cpu_count", lambda: 4)
    assert environment.load() == 1.5


def test_a_system_that_does_not_tell_its_load_has_none(monkeypatch):
    monkeypatch.delattr(environment.os, "getloadavg")
    assert environment.load() is None


@pytest.mark.parametrize(
    ("cpuinfo", "known", "expected"),
    [("vendor: x\nmodel name\t: Fast 5\n", "", "Fast 5"), ("", "i386", "i386"), ("", "", "arm64")],
)
def test_the_processor_has_a_name_wherever_it_is_told(cpuinfo, known, expected, monkeypatch):
    monkeypatch.setattr(Path, "read_text", lambda _: cpuinfo)
    monkeypatch.setattr(environment.platform, "processor", lambda: known)
    monkeypatch.setattr(environment.platform, "machine", lambda: "arm64")
    assert environment.processor.__wrapped__() == expected


@pytest.mark.parametrize(("counted", "cores"), [(6, 6), (None, 1)])
def test_where_a_process_has_no_cores_of_its_own_all_count(
    counted: int | None, cores: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delattr(environment.os, "sched_getaffinity", raising=False)
    monkeypatch.setattr(environment.os, "cpu_count", lambda: counted)
    assert environment.cores() == cores


def test_packages_that_the_project_asks_for_have_their_versions() -> None:
    packages = environment._packages()
    assert packages["numpy"] == np.__version__
    assert packages["parapoint"]
    assert not any(set(name) & set("<>=[; ") for name in packages)
