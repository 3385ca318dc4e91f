"""The processes of a cell: how much memory they hold, and how every one of them is ended.

On Linux the supervisor is a subreaper: a process whose parent ends falls to it, so that all
descendants of a cell can be found even where they have left its session. So is the process of the
run, to which they fall if the supervisor itself is killed. Elsewhere the process group of the cell
is all that can be found.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import sys
import time
from collections.abc import Container
from pathlib import Path

import psutil

FORKS = sys.platform == "linux"
"""Whether a cell is a fork of its supervisor, which is then a subreaper."""
BURIAL_SECONDS = 5
"""Seconds after which `bury` gives up: a system call may hold a killed process for long."""


PR_SET_PDEATHSIG = 1
PR_SET_CHILD_SUBREAPER = 36


def adopt_orphans(*, is_parent: bool = True) -> None:
    """Let this process adopt every process below it whose own parent ends; or stop it doing so."""
    if FORKS:
        ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, int(is_parent), 0, 0, 0)


def end_with(parent: int) -> None:
    """Let the system kill this process once `parent`, which has started it, has ended."""
    if FORKS:
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
        if os.getppid() != parent:
            os._exit(1)


def end_orphans(known: Container[int]) -> None:
    """Kill and reap what has fallen to this process, and everything below it.

    That is each child in a session of its own, as all cells and what they start have, that is not
    `known`; give up on what a system call holds for seconds.
    """
    give_up = time.monotonic() + BURIAL_SECONDS
    while FORKS and time.monotonic() < give_up:
        orphans = [child for child in psutil.Process().children() if _is_orphan(child.pid, known)]
        if not orphans:
            return
        for orphan in orphans:
            with contextlib.suppress(psutil.Error):
                below = orphan.children(recursive=True)
                for process in (orphan, *below):
                    with contextlib.suppress(psutil.Error):
                        process.kill()
            with contextlib.suppress(ChildProcessError):
                os.waitpid(orphan.pid, os.WNOHANG)
        time.sleep(0.005)


def _is_orphan(child: int, known: Container[int]) -> bool:
    """Whether a child of this process is not known and has another session."""
    try:
        return child not in known and os.getsid(child) != os.getsid(0)
    except OSError:
        return False


def system_kills() -> int:
    """How often Linux has killed a process for lack of memory, here or in a container."""
    with contextlib.suppress(OSError):
        for line in Path("/proc/vmstat").read_text().splitlines():
            if line.startswith("oom_kill "):
                return int(line.split()[1])
    return 0


def descendants() -> list[psutil.Process]:
    """All processes below this one."""
    try:
        return list(psutil.Process().children(recursive=True))
    except psutil.Error:
        return []


def resident(process: int) -> int:
    """Resident memory in bytes of the process of that number; 0 if it has ended."""
    try:
        return int(psutil.Process(process).memory_info().rss)
    except psutil.Error:
        return 0


def kill(child: int) -> None:
    """Kill the process `child`, its group, and all descendants of this process."""
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(child, signal.SIGKILL)
    for process in descendants():
        with contextlib.suppress(psutil.Error):
            process.kill()


def bury(child: int) -> None:
    """Kill and reap everything that is left of the cell whose process is `child`."""
    if not FORKS:
        kill(child)
    give_up = time.monotonic() + BURIAL_SECONDS
    while time.monotonic() < give_up:
        try:
            if os.waitpid(-1, os.WNOHANG) == (0, 0):
                kill(child)
                time.sleep(0.005)
        except ChildProcessError:
            return
