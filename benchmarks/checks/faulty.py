"""A method that goes wrong in a chosen way, to see what the harness saves of the run."""

from __future__ import annotations

import contextlib
import ctypes
import errno
import json
import os
import resource
import shutil
import signal
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Never

import numpy as np

from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import Mesh, Surface

ELSEWHERE, OTHERS = "elsewhere", "a user's file"
"""A folder that belongs to no cell, and the content of the file map.npz in it."""


def _eat() -> Never:
    hoard = []
    while True:
        hoard.append(np.ones(1 << 21))
        time.sleep(0.005)


def _sleep() -> Never:
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    while True:
        time.sleep(60)


def _breed() -> None:
    for _ in range(3):
        if not os.fork():
            time.sleep(600)
    os.kill(os.getpid(), signal.SIGKILL)


def _kill_the_supervisor() -> None:
    os.kill(os.getppid(), signal.SIGKILL)
    time.sleep(60)


def _babble() -> None:
    for _ in range(20_000):
        print("x" * 1000)
    raise ValueError("enough is said")


def _scatter() -> None:
    """Leave two daemons in sessions of their own: this program, and one without its environment."""
    for program in (False, True):
        if os.fork():
            continue
        os.setsid()
        if os.fork():
            os._exit(0)
        if program:
            os.execve("/bin/sleep", ["sleep", "600"], {})  # noqa: S606  fixed
        time.sleep(600)
    time.sleep(0.2)


def _scatter_and_kill_the_supervisor() -> None:
    _scatter()
    _kill_the_supervisor()


def _leak_descriptors() -> None:
    with contextlib.suppress(OSError):
        while True:
            os.dup(1)


def _small_files() -> None:
    resource.setrlimit(resource.RLIMIT_FSIZE, (64, 64))


def _few_descriptors() -> None:
    resource.setrlimit(resource.RLIMIT_NOFILE, (3, 3))


def _at_the_end(harm: Callable[[Path], object]) -> None:
    """Harm the folder of the cell once its map is written and its outcome is reported."""
    end, folder = os._exit, Path.cwd().parent

    def ended(status: int) -> Never:
        harm(folder)
        end(status)

    os._exit = ended


def _file_in_place_of(folder: Path) -> None:
    shutil.rmtree(folder)
    folder.write_text("a file")


def _link_to_elsewhere(folder: Path) -> None:
    elsewhere = folder.parent.parent / ELSEWHERE
    elsewhere.mkdir(exist_ok=True)
    (elsewhere / "map.npz").write_text(OTHERS)
    shutil.rmtree(folder)
    folder.symlink_to(elsewhere)


def _folder_for_a_map(folder: Path) -> None:
    (folder / "map.npz").unlink()
    (folder / "map.npz").mkdir()


def _pipes(of: int) -> list[Path]:
    """The pipes that a process has open."""
    held = []
    for path in Path(f"/proc/{of}/fd").iterdir():
        with contextlib.suppress(OSError):  # the listing has a descriptor that is gone by now
            if str(path.readlink()).startswith("pipe:"):
                held.append(path)
    return held


def _say(line: bytes, of: int) -> None:
    """Write a line into every pipe of a process that takes it without waiting."""
    for path in _pipes(of):
        with contextlib.suppress(OSError):
            writing = os.open(path, os.O_WRONLY | os.O_NONBLOCK)
            os.write(writing, line)
            os.close(writing)


def _lie() -> None:
    """Report through every pipe, also those of the supervisor, that this cell is ok; then fail."""
    fields = {"status": "ok", "uv_sha256": "0" * 64, "seconds": 1e-9}
    line = json.dumps(["Outcome", fields]).encode() + b"\n"
    _say(line, os.getpid())
    _say(line, os.getppid())
    raise ValueError("a lie")


def _noise() -> None:
    _say(b'{"half": \xff', os.getpid())
    raise ValueError("only noise")


def _flood() -> None:
    while True:
        for path in _pipes(os.getpid()):
            with contextlib.suppress(OSError):
                writing = os.open(path, os.O_WRONLY | os.O_NONBLOCK)
                os.write(writing, bytes(1 << 15))
                os.close(writing)


def _no_space() -> Never:
    raise OSError(errno.ENOSPC, "no space left on device")


FAULTS: dict[str, tuple[Callable[[], object], str]] = {
    "segfault": (lambda: ctypes.string_at(0), "failed"),
    "quit": (lambda: os._exit(0), "failed"),
    "exit": (lambda: sys.exit("enough"), "failed"),
    "kill_itself": (lambda: os.kill(os.getpid(), signal.SIGKILL), "failed"),
    "kill_the_supervisor": (_kill_the_supervisor, "failed"),
    "breed": (_breed, "failed"),
    "babble": (_babble, "failed"),
    "scatter": (_scatter, "ok"),
    "scatter_and_kill_the_supervisor": (_scatter_and_kill_the_supervisor, "failed"),
    "leak_descriptors": (_leak_descriptors, "failed"),
    "small_files": (_small_files, "failed"),
    "few_descriptors": (_few_descriptors, "failed"),
    "remove_its_map": (lambda: _at_the_end(lambda at: (at / "map.npz").unlink()), "failed"),
    "folder_for_a_map": (lambda: _at_the_end(_folder_for_a_map), "failed"),
    "file_for_its_folder": (lambda: _at_the_end(_file_in_place_of), "failed"),
    "link_for_its_folder": (lambda: _at_the_end(_link_to_elsewhere), "failed"),
    "file_for_all_folders": (
        lambda: _at_the_end(lambda at: _file_in_place_of(at.parent)),
        "failed",
    ),
    "no_folders": (lambda: _at_the_end(lambda at: shutil.rmtree(at.parent)), "failed"),
    "lie": (_lie, "failed"),
    "noise": (_noise, "failed"),
    "flood": (_flood, "failed"),
    "no_space": (_no_space, "failed"),
    "eat": (_eat, "out_of_memory"),
    "sleep": (_sleep, "timeout"),
}
"""By name, what the method does, and the status that its row must have."""


@dataclass(frozen=True)
class Faulty:
    """A method that goes wrong.

    Attributes:
        fault: how; one of FAULTS.
        seconds: how long it sleeps when that is done.
    """

    fault: str = "segfault"
    seconds: float = 0.0

    requires: ClassVar[frozenset[str]] = frozenset({"faces"})

    def parameterize(self, surface: Surface, *, seed: int) -> Parameterization:  # noqa: ARG002  its end comes first
        """Go wrong."""
        assert isinstance(surface, Mesh)
        FAULTS[self.fault][0]()
        time.sleep(self.seconds)
        return Parameterization(surface.vertices[:, :2], surface.faces)
