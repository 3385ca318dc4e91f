"""`python -m benchmarks.checks.endurance`: what a run survives, and what the harness costs.

`kills` kills a run (kill -9) a thousand times at random instants and resumes it each time. No row
that was reported as done may be lost, no row may be damaged, and every finished run must have the
table of a run that was never killed.

`faults` runs methods that crash, hang, fork, print and eat memory among instant methods. Each may
cost its own cell alone, which gets a row with the reason; all other cells must have the maps of a
run in which nothing went wrong.

`scale` runs an instant method in many cells. It prints what the harness costs a cell, whether this
grows with the number of cells, how large the store becomes, and how long a finished run takes to
find that nothing is left to do.

`overhead` runs cells of every method, and prints what each costs beside the time of its method.

`all` repeats these until a time is over: kills, faults, commands among a user's files
(`benchmarks.checks.bystanders`); and kills of every kind of process, commands broken off by
signals, full and read-only disks, and rows with values that no run of ours writes
(`benchmarks.checks.hardships`).
"""

from __future__ import annotations

import dataclasses
import os
import random
import shutil
import signal
import statistics
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
import numpy as np
import psutil

from baselines import registry
from benchmarks.cases.suites import Suite
from benchmarks.checks import faulty, hardships, instant
from benchmarks.checks.bystanders import undisturbed
from benchmarks.running import planning, runner
from benchmarks.running.expectation import WHOLE_BUDGET
from benchmarks.store import measuring, verifying
from benchmarks.store.results import Store
from parapoint import console
from parapoint.testing import irregular_disk

PLUGIN = f"{instant.__file__}:Instant"
TIMING = ("seconds", "cpu_seconds", "load", "peak_memory_mb", "run")
"""The fields in which two rows of the same cell may differ."""
CASES = ("half_cylinder", "saddle@noise=0")
"""A mesh and a cloud, so that every method has a surface that it can take."""
BUDGETS = {
    **dict.fromkeys(WHOLE_BUDGET, "points=120, subset=100, iterations=2"),
    "computed": "points=500",
    "geometry_image": "side=17",
    "meshed": "reconstruction=ball_pivoting",
    "smith_schaefer": "iterations=60",
}
"""Parameters that make those methods short that would take minutes."""


def instant_suite(folder: Path, models: int, methods: int, seeds: int) -> Suite:
    """A suite of instant methods on small meshes. Writes the meshes into `folder`."""
    mesh = irregular_disk()
    cases = []
    folder.mkdir(parents=True, exist_ok=True)
    for n in range(models):
        path = folder / f"mesh{n}.off"
        with path.open("w") as stream:
            stream.write(f"OFF\n{len(mesh.vertices)} {len(mesh.faces)} 0\n")
            np.savetxt(stream, mesh.vertices * (1 + n / 100))
            np.savetxt(stream, np.insert(mesh.faces, 0, 3, axis=1), fmt="%d")
        cases.append(str(path))
    specs = tuple(f"instant(variant={n})" for n in range(methods))
    return Suite("endurance", "Instant methods", tuple(cases), specs, tuple(range(seeds)))


@dataclass
class Toll:
    """What the kills cost.

    Attributes:
        kills: how often a run was killed.
        tables: the number of runs that came to their end after their kills.
        reported: the number of rows that were reported as done before a kill.
        faults: how often something was lost, damaged or different.
    """

    kills: int = 0
    tables: int = 0
    reported: int = 0
    faults: int = 0

    def fault(self, text: str) -> None:
        """Count a fault and print it."""
        self.faults += 1
        print(text, flush=True)


def toll(suite: Suite, folder: Path, *, count: int, seed: int) -> Toll:
    """Kill runs of `suite` at `count` random instants within the time that a whole run takes.

    A run that is killed is resumed. When it comes to its end, its table is compared with the table
    of a run that was never killed, and another run begins in a new folder.
    """
    draw = random.Random(seed)  # noqa: S311  no secret
    found = Toll()
    whole = runner.run(suite, folder / "undisturbed", plugins=[PLUGIN]).seconds
    expected = _table(Store(folder / "undisturbed"))
    while found.kills < count:
        out = folder / f"run{found.tables}"
        reported: set[str] = set()
        while found.kills < count and _killed(suite, out, draw.uniform(0, whole), reported):
            found.kills += 1
            _check(Store(out), reported, found)
        runner.run(suite, out, plugins=[PLUGIN])
        found.reported += len(reported)
        found.tables += 1
        for fault in verifying.faults(Store(out)):
            found.fault(f"{out.name}: {fault}")
        if _table(Store(out)) != expected:
            found.fault(f"{out.name}: another table than that of the undisturbed run")
        print(found, flush=True)
        shutil.rmtree(out)
    return found


class _Report(runner.Progress):
    """Reports each finished row through a pipe: what was written to it survives a kill."""

    def __init__(self, pipe: int) -> None:
        self.pipe = pipe

    def ended(self, cell: planning.Cell, row: Any) -> None:  # noqa: ARG002  as its base
        """Send the id of the row in one write."""
        os.write(self.pipe, f"{row.id}\n".encode())


def _killed(suite: Suite, out: Path, delay: float, reported: set[str]) -> bool:
    """Run `suite` in a process that is killed after `delay` s; False if it had ended by then.

    The process is a fork of this one, where all imports are done, so that the kill hits the run.
    Ids of rows that it reports are added to `reported`.
    """
    receive, send = os.pipe()
    child = os.fork()
    if not child:
        try:
            os.close(receive)
            runner.run(suite, out, plugins=[PLUGIN], progress=_Report(send))
            os._exit(0)
        finally:
            os._exit(1)
    os.close(send)
    time.sleep(delay)
    os.kill(child, signal.SIGKILL)
    _, status = os.waitpid(child, 0)
    with os.fdopen(receive) as stream:
        reported |= set(stream.read().split())
    if os.WIFEXITED(status) and os.WEXITSTATUS(status):
        raise RuntimeError(f"a run in {out} ended by itself with an error")
    return os.WIFSIGNALED(status)


def _check(store: Store, reported: set[str], found: Toll) -> None:
    """Check that every reported row is there and whole, and that at most the last line is torn."""
    missing = reported - {row.id for row in store.history()}
    if missing:
        found.fault(f"{store.folder.name}: {len(missing)} rows that were reported are gone")
    for fault in verifying.faults(store):
        found.fault(f"{store.folder.name}: {fault}")


def _table(store: Store) -> list[dict[str, Any]]:
    """The rows and metrics of a run in the order of their cells, without TIMING."""
    frame = measuring.metrics(store).set_index("id").drop(columns="metrics_key")
    metrics = {str(key): repr(value) for key, value in frame.to_dict("index").items()}
    rows = sorted(store.rows(), key=lambda row: row.cell)
    return [
        {key: value for key, value in vars(row).items() if key not in TIMING}
        | {"metrics": metrics[row.id]}
        for row in rows
    ]


def saved(models: Path, out: Path, seeds: int) -> Toll:
    """Run methods that go wrong among instant ones; each may cost its own cell alone."""
    instants = instant_suite(models, models=2, methods=2, seeds=seeds)
    wrong = tuple(f"faulty(fault={fault})" for fault in faulty.FAULTS)
    mixed = dataclasses.replace(instants, methods=(*wrong, *instants.methods))
    found = Toll()
    runner.run(instants, out / "alone", plugins=[PLUGIN])
    plugins = [PLUGIN, f"{faulty.__file__}:Faulty"]
    # One cell at a time, since some methods remove the folders of all cells that are running.
    runner.run(mixed, out / "mixed", plugins=plugins, timeout=8.0, memory=0.5)
    store = Store(out / "mixed")
    for fault in verifying.faults(store):
        found.fault(fault)
    rows = store.rows()
    for row in rows:
        if row.method == "faulty":
            expected = faulty.FAULTS[str(row.params["fault"])][1]
            if row.status != expected or (expected != "ok" and not row.reason):
                found.fault(f"{row.cell}: {row.status} ({row.reason}) in place of {expected}")
    well = {row.cell: row.uv_sha256 for row in rows if row.method == "instant"}
    if well != {row.cell: row.uv_sha256 for row in Store(out / "alone").rows()}:
        found.fault("other maps than those of a run in which nothing went wrong")
    found.reported = len(rows)
    elsewhere = out / "mixed" / faulty.ELSEWHERE
    if elsewhere.exists() and (elsewhere / "map.npz").read_text() != faulty.OTHERS:
        found.fault("a file outside the cell's folder was changed")
    for process in psutil.process_iter(["cwd"]):  # known by its folder: its parent may be gone
        if (process.info["cwd"] or "").startswith(str(out.resolve())):
            found.fault(f"process {process.pid} is left")
    return found


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
def main() -> None:
    """Kill runs, and measure what the harness costs."""


@main.command()
@click.option("--count", type=click.IntRange(1), default=1000, show_default=True)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
@click.pass_context
def kills(ctx: click.Context, count: int, seed: int) -> None:
    """Kill a run at random instants, and count what is lost."""
    with tempfile.TemporaryDirectory() as name:
        suite = instant_suite(Path(name) / "models", models=4, methods=2, seeds=4)
        began = time.monotonic()
        found = toll(suite, Path(name), count=count, seed=seed)
    print(
        f"{found.kills} kills in {time.monotonic() - began:.0f} s, {found.reported} rows had been "
        f"reported, {found.tables} runs came to their end: {found.faults or 'no'} faults"
    )
    if found.faults:
        ctx.exit(1)


@main.command("all")
@click.option("--minutes", type=click.FloatRange(0, min_open=True), default=15, show_default=True)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
@click.pass_context
def all_(ctx: click.Context, minutes: float, seed: int) -> None:
    """Kill runs, let methods go wrong, run commands among a user's files, until time is over."""
    end = time.monotonic() + 60 * minutes
    rounds = total = 0
    while time.monotonic() < end:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            suite = instant_suite(folder / "models", models=4, methods=2, seeds=4)
            killed = toll(suite, folder, count=20, seed=seed + rounds)
            wrong = saved(folder / "faulty", folder / "wrong", 1)
            found = undisturbed(folder / "bystanders", count=10, seed=seed + rounds)
            ended = hardships.kills(folder / "kills", seed=seed + rounds)
            broken = hardships.broken_off(folder / "broken", seed=seed + rounds, count=5)
            disks = hardships.disks(folder / "disks", seed=seed + rounds, count=8)
            rows = hardships.rows(folder / "rows", seed=seed + rounds, count=2)
        said = [*found.faults, *ended.faults, *broken.faults, *disks.faults, *rows.faults]
        for fault in said:
            print(fault)
        rounds += 1
        total += killed.faults + wrong.faults + len(said)
        print(
            f"round {rounds}: {killed.kills} kills after {killed.reported} rows, "
            f"{wrong.reported} cells of which {2 * len(faulty.FAULTS)} went wrong, "
            f"{found.runs} commands ({found.refused} refused) among {found.files} files, "
            f"{ended.tried} kills of {', '.join(hardships.VICTIMS)} and what they had started, "
            f"{broken.tried} commands broken off by signals, "
            f"{disks.tried} commands on full or read-only disks, "
            f"{rows.tried} commands on evil rows; faults so far: {total}",
            flush=True,
        )
    if total:
        ctx.exit(1)


@main.command()
@click.option("--seeds", type=click.IntRange(1), default=20, show_default=True)
@click.pass_context
def faults(ctx: click.Context, seeds: int) -> None:
    """Let methods crash, hang, fork and eat memory, and count what that costs other cells."""
    with tempfile.TemporaryDirectory() as name:
        found = saved(Path(name) / "models", Path(name), seeds)
    print(f"{found.reported} cells: {found.faults or 'no'} faults")
    if found.faults:
        ctx.exit(1)


@main.command()
@click.option("--models", type=click.IntRange(1), default=1000, show_default=True)
@click.option("--methods", type=click.IntRange(1), default=12, show_default=True)
@click.option("--seeds", type=click.IntRange(1), default=3, show_default=True)
@click.option("--jobs", type=click.IntRange(1), default=2, show_default=True)
@click.option("--out", type=click.Path(path_type=Path), default=Path("results/scale"))
def scale(models: int, methods: int, seeds: int, jobs: int, out: Path) -> None:
    """Run instant methods, and print what the harness costs; a stopped run is resumed."""
    suite = instant_suite(out / "models", models, methods, seeds)
    store = out / "store"
    for title in ("run", "run again"):
        began, used = time.monotonic(), _processor_seconds()
        summary = runner.run(suite, store, plugins=[PLUGIN], jobs=jobs)
        seconds, used = time.monotonic() - began, _processor_seconds() - used
        print(
            f"{title}: {len(summary.ran)} cells after {len(summary.kept)}: {seconds:.1f} s, "
            f"{used:.1f} s of processor time"
        )
        if summary.ran:
            print(f"  a cell: {seconds / len(summary.ran):.4f} s, {used / len(summary.ran):.4f} s")
    cells = len(summary.kept)
    size = sum(path.stat().st_size for path in store.rglob("*") if path.is_file())
    print(f"store: {size / 1e6:.1f} MB, {size / cells:.0f} bytes a cell")


@main.command()
@click.option("--cells", type=click.IntRange(1), default=5, show_default=True)
def overhead(cells: int) -> None:
    """Run CELLS cells of every method on a mesh and a cloud, and print what the harness adds."""
    clock = _Clock()
    specs = [f"{name}({BUDGETS.get(name, '')})" for name in registry.METHODS if name != "external"]
    suite = Suite("overhead", "Small cells of every method", CASES, (*specs,), (*range(cells),))
    with tempfile.TemporaryDirectory() as name:
        runner.run(suite, name, progress=clock)
    for method, seconds in sorted(clock.added.items()):
        median, longest = statistics.median(seconds), max(seconds)
        print(f"{method:16} {len(seconds):3} cells  {median:.3f} s, at most {longest:.3f} s")


class _Clock(runner.Progress):
    """By method, the seconds that each cell with a map took beside its method."""

    def __init__(self) -> None:
        self.began = 0.0
        self.added: dict[str, list[float]] = {}

    def started(self, cell: planning.Cell) -> None:  # noqa: ARG002  as its base
        """Start the clock."""
        self.began = time.monotonic()

    def ended(self, cell: planning.Cell, row: Any) -> None:  # noqa: ARG002  as its base
        """Note the time since then, without that of the method."""
        if row.status == "ok":
            added = time.monotonic() - self.began - row.seconds
            self.added.setdefault(row.method, []).append(added)


def _processor_seconds() -> float:
    """Processor seconds of this process and of the children that it has waited for."""
    return sum(os.times()[:4])


if __name__ == "__main__":
    console.run(main)
