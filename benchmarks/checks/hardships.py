"""What befalls commands from outside: kills, disks that are full or read-only, rows of others.

Each check runs commands as a user does, in processes of their own, and counts what is lost, left or
damaged. `benchmarks.checks.endurance all` repeats them.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import random
import resource
import secrets
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import psutil

from benchmarks.checks import bystanders, faulty

VICTIMS = ("run", "supervisor", "cell", "report")
"""What is killed, together with all that it has started."""
WRITING = {
    "parapoint fit {cloud} --out {folder}/made --points 120": "",
    "parapoint unwrap {mesh} --out {folder}/made.obj --texture 64": "made.obj",
    "parapoint bake {model} {cloud} --out {folder}/map.png --map position --texture 64": "map.png",
    "parapoint map {model} {cloud} --out {folder}/made.ply": "made.ply",
    "benchmarks publish {public} --out {folder}/made.zip": "made.zip",
}
"""Commands that write one output, and the file of it that has the same bytes each time."""
MANNERS = {
    "killed": (signal.SIGKILL,),
    "terminated": (signal.SIGTERM,),
    "hung up on": (signal.SIGHUP,),
    "interrupted": (signal.SIGINT,),
    "stopped and killed": (signal.SIGSTOP, signal.SIGKILL),
}
"""How a command is broken off, by the signals that it gets."""
DISKS = ("full", "read-only")
"""What is wrong with a disk."""
GONE_AFTER = 5.0
"""Seconds after a kill, by the end of which no process that it leaves behind may run."""
TAG = "PARAPOINT_ENDURANCE"
"""The environment variable by which processes are found again, whatever became of their parents."""
EVIL: tuple[Any, ...] = (
    *(math.nan, math.inf, -math.inf, 1e308, -1, 10**23, True, None, "", " ", [], {}, [[[]]]),
    *("../../../evil", "/etc/passwd", "a\x00b", "\ud800", "<script>", "=1+1", r"\input{x}", "$^{"),
    *("\x1b[31m", "n" * 5000, {"a": {"b": math.nan}}, ["x"] * 1000, "ok", "failed"),
)
"""What takes the place of a value in a row."""


@dataclass
class Hardship:
    """What came of some commands.

    Attributes:
        tried: the number of commands.
        faults: a line for each thing that was lost, left or damaged.
    """

    tried: int = 0
    faults: list[str] = field(default_factory=list)

    def add(self, other: Hardship) -> None:
        """Count those of another check, too."""
        self.tried += other.tried
        self.faults += other.faults


def kills(folder: Path, *, seed: int) -> Hardship:
    """Kill a run, its supervisor, its cell and a report in turn, and count what goes on.

    The method leaves daemons in sessions of their own. A report is killed at any instant; after it
    the same command must end well.
    """
    draw = random.Random(seed)  # noqa: S311  no secret
    found = Hardship()
    given = bystanders.inputs(folder / "inputs") | {"results": folder / "inputs" / "results"}
    for victim in VICTIMS:
        place = folder / victim
        place.mkdir()
        if victim == "report":
            command = ["-m", "reports", str(given["results"])]
        else:
            plugin = f"{faulty.__file__}:Faulty"
            command = ["-m", "benchmarks", "run", "--cases", str(given["mesh"]), "--out"]
            command += [str(place / "results"), "--plugin", plugin, "--methods", "faulty"]
            command[-1] += "(fault=scatter, seconds=600)"
        found.add(_killed(victim, command, place, draw))
    again = _run(["-m", "reports", str(given["results"])], folder)
    found.tried += 1
    if again.returncode:
        found.faults.append(f"a report after one that was killed: {_said(again)}")
    return found


def _killed(victim: str, command: list[str], folder: Path, draw: random.Random) -> Hardship:
    """Start a command, kill the victim among its processes, and see what is left."""
    tag = secrets.token_hex(8)
    process = subprocess.Popen(  # noqa: S603  our own commands
        [sys.executable, *command],
        cwd=folder,
        env=_environment() | {TAG: tag},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    chosen = process.pid
    if victim == "report":
        time.sleep(draw.uniform(1, 6))
    else:
        deadline = time.monotonic() + 60
        # Run, supervisor, cell and its two daemons.
        while len(_started(tag, folder)) < 5 and time.monotonic() < deadline:
            time.sleep(0.1)
        time.sleep(0.3)
        with contextlib.suppress(psutil.Error, IndexError):
            below = psutil.Process(process.pid)
            for _ in range({"run": 0, "supervisor": 1, "cell": 2}[victim]):
                below = below.children()[0]
            chosen = below.pid
    with contextlib.suppress(ProcessLookupError):
        os.kill(chosen, signal.SIGKILL)
    found = Hardship(1)
    try:
        process.wait(60)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
        found.faults.append(f"kill of a {victim}: the command never ended")
    left = _left(tag, folder)
    found.faults += [f"kill of a {victim}: process {pid} is left" for pid in left]
    return found


def broken_off(folder: Path, *, seed: int, count: int) -> Hardship:
    """Break off commands that write one output, in every manner and at any instant.

    The output is there whole or not at all, no other file changes, no process goes on, and the
    same command ends well afterwards.
    """
    draw = random.Random(seed)  # noqa: S311  no secret
    found = Hardship()
    given = bystanders.inputs(folder / "inputs") | {"results": folder / "inputs" / "results"}
    given["public"] = folder / "inputs" / "public"  # rows of a user's own files are left out
    run = "benchmarks run builtin --cases half_cylinder --methods tutte --out {public}"
    _run(bystanders.arguments(run.format(**given)), folder)
    whole: dict[str, tuple[float, dict[str, str]]] = {}
    for number in range(count):
        command, output = list(WRITING.items())[number % len(WRITING)]
        manner = draw.choice(list(MANNERS))
        place = folder / f"place{number}"
        (place / "mine").mkdir(parents=True)
        (place / "mine" / "model.json").write_text("mine")
        asked = bystanders.arguments(command.format(**given, folder=place / "mine"))
        before = dict(bystanders.hashes(folder / "inputs"))
        if command not in whole:
            began = time.monotonic()
            _run(asked, folder)
            made = {path.name: value for path, value in bystanders.hashes(place / "mine")}
            whole[command] = time.monotonic() - began, made
            shutil.rmtree(place / "mine")
            (place / "mine").mkdir()
            (place / "mine" / "model.json").write_text("mine")
        seconds, expected = whole[command]
        left = _broken_off(asked, place, MANNERS[manner], draw.uniform(0, seconds))
        found.tried += 1
        what = f"{command.split(' --')[0]} {manner}"
        found.faults += [f"{what}: process {pid} is left" for pid in left]
        now = {path.name: value for path, value in bystanders.hashes(place / "mine")}
        if output in now and now[output] != expected[output]:
            found.faults.append(f"{what}: {output} is there by halves")
        if (place / "mine" / "model.json").read_text() != "mine":
            found.faults.append(f"{what}: a file of the user's has changed")
        if dict(bystanders.hashes(folder / "inputs")) != before:
            found.faults.append(f"{what}: an input has changed")
        if (again := _run(asked, folder)).returncode:
            found.faults.append(f"{what}, and again: {_said(again)}")
    return found


def _broken_off(
    asked: list[str], place: Path, signals: tuple[signal.Signals, ...], delay: float
) -> list[int]:
    """Start Python with these arguments, break it off, and name the processes that are left."""
    tag = secrets.token_hex(8)
    process = subprocess.Popen(  # noqa: S603  our own commands
        [sys.executable, *asked],
        cwd=place,
        env=_environment() | {TAG: tag},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    time.sleep(delay)
    for one in signals:
        process.send_signal(one)
    process.wait(60)
    return _left(tag, place)


def _left(tag: str, folder: Path) -> list[int]:
    """The processes that still run GONE_AFTER seconds later. They are killed then."""
    deadline = time.monotonic() + GONE_AFTER
    while (left := _started(tag, folder)) and time.monotonic() < deadline:
        time.sleep(0.1)
    for pid in left:
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
    return left


def _started(tag: str, folder: Path) -> list[int]:
    """The processes that have a tag in their environment, or work below a folder."""
    found = []
    for process in psutil.process_iter():
        with contextlib.suppress(psutil.Error):
            ours = process.environ().get(TAG) == tag or process.cwd().startswith(str(folder))
            if ours and process.status() != psutil.STATUS_ZOMBIE:
                found.append(process.pid)
    return found


def disks(folder: Path, *, seed: int, count: int) -> Hardship:
    """Run random commands that write, on disks that are full or may only be read.

    They may end well only if they had nothing to write; else with status 2 and a line. No file may
    be there by halves, and none that was there may change. Where no file system can be mounted, a
    limit on the size of files stands for a full disk, and the read-only one is left out.
    """
    draw = random.Random(seed)  # noqa: S311  no secret
    found = Hardship()
    given = bystanders.inputs(folder / "inputs") | {"results": folder / "inputs" / "results"}
    writing = [command for command in bystanders.COMMANDS if " list " not in command]
    for number in range(count):
        disk = DISKS[number % len(DISKS)]
        command = draw.choice(writing)
        place = folder / f"disk{number}"
        place.mkdir()
        with _disk(place, disk, given["results"]) as limits:
            if limits is None:
                continue
            before = dict(bystanders.hashes(place))
            places = given | {"folder": place / "mine", "results": place / "results"}
            done = _run(bystanders.arguments(command.format(**places)), folder, limits)
            found.tried += 1
            what = f"{command} on a {disk} disk"
            if "Traceback" in done.stderr or done.returncode not in (0, 1, 2):
                found.faults.append(f"{what}: status {done.returncode}: {_said(done)}")
            if done.returncode == 2 and not done.stderr.strip().splitlines()[-1:]:
                found.faults.append(f"{what}: refused without a word")
            for path, content in bystanders.hashes(place):
                if path in before and before[path] != content:
                    found.faults.append(f"{what}: {path.name} has changed")
                elif path not in before and path.stat().st_size == 0 and path.suffix:
                    if path.name != ".made-by-parapoint":
                        found.faults.append(f"{what}: {path.name} is empty")
                elif path not in before and path.suffix == ".part":
                    found.faults.append(f"{what}: {path.name} is left")
    return found


@contextlib.contextmanager
def _disk(place: Path, state: str, results: Path) -> Iterator[Callable[[], None] | None]:
    """A place with folders `mine` and `results` on such a disk; what a process on it begins with.

    None where this system cannot make one.
    """

    def mount(*options: str) -> bool:
        command = ["mount", *options, str(place)]
        with contextlib.suppress(OSError):
            return not subprocess.run(command, capture_output=True, check=False).returncode  # noqa: S603
        return False

    mounted = mount("-t", "tmpfs", "-o", "size=1m", "none")
    try:
        (place / "mine").mkdir()
        shutil.copytree(results, place / "results", ignore=shutil.ignore_patterns("report"))
        if not mounted:
            yield _no_room if state == "full" else None
            return
        if state == "full":
            filling = os.open(place / "filling", os.O_CREAT | os.O_WRONLY)
            with contextlib.suppress(OSError):
                while True:
                    os.write(filling, bytes(4096))
            os.close(filling)
        elif not mount("-o", "remount,ro"):
            yield None
            return
        yield _as_it_is
    finally:
        if mounted:
            subprocess.run(["umount", "-l", str(place)], check=True)  # noqa: S603, S607


def _as_it_is() -> None:
    """Limit nothing."""


def _no_room() -> None:
    """Let no file of this process grow."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))


def rows(folder: Path, *, seed: int, count: int) -> Hardship:
    """Write reports and check folders whose rows have values that no run of ours writes.

    They may refuse with status 2, and the check may find faults with status 1. They may change
    nothing outside the folder.
    """
    draw = random.Random(seed)  # noqa: S311  no secret
    found = Hardship()
    given = bystanders.inputs(folder / "inputs") | {"results": folder / "inputs" / "results"}
    outside = folder / "evil"
    outside.write_text(faulty.OTHERS)
    lines = (given["results"] / "runs.jsonl").read_text().splitlines()
    for number in range(count):
        results = folder / "deep" / "er" / f"rows{number}"
        shutil.copytree(given["results"], results, ignore=shutil.ignore_patterns("report"))
        made = [*lines]
        for line in lines * 5:
            row = json.loads(line)
            for name in draw.sample(sorted(row), draw.randrange(1, 4)):
                row[name] = draw.choice(EVIL)
            made.insert(draw.randrange(len(made) + 1), json.dumps(row))
        (results / "runs.jsonl").write_text("\n".join(made) + "\n")
        (results / "metrics.parquet").unlink(missing_ok=True)
        for command in (["-m", "benchmarks", "check"], ["-m", "reports"]):
            done = _run([*command, str(results)], folder)
            found.tried += 1
            if "Traceback" in done.stderr or done.returncode not in (0, 1, 2):
                kept = Path(f"{results}.jsonl")
                shutil.copy(results / "runs.jsonl", kept)
                found.faults.append(f"{command[1]} on {kept}: {_said(done)}")
        if outside.read_text() != faulty.OTHERS:
            found.faults.append("a file outside the folder was changed")
    return found


def _environment() -> dict[str, str]:
    """The environment of our commands."""
    return os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])}


def _run(
    arguments: list[str], folder: Path, limits: Callable[[], None] | None = None
) -> subprocess.CompletedProcess[str]:
    """Run Python with arguments in a folder, to its end."""
    return subprocess.run(  # noqa: S603  our own commands
        [sys.executable, *arguments],
        cwd=folder,
        env=_environment(),
        preexec_fn=limits,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        errors="replace",
        check=False,
    )


def _said(done: subprocess.CompletedProcess[str]) -> str:
    """The last line of what a command said."""
    return (done.stderr.strip().splitlines() or ["nothing"])[-1][:300]
