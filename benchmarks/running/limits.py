"""The processes of a cell: how much memory they hold, and how every one of them is ended.

On Linux the supervisor is a subreaper: a process whose parent ends falls to it, so that all
descendants of a cell can be found even where they have left its session. Elsewhere the process
group of the cell is all that can be found.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import time
from pathlib import Path

import psutil

FORKS = sys.platform == "linux"
"""Whether a cell is a fork of its supervisor, which is then a subreaper."""
BURIAL_SECONDS = 5
"""Seconds after which `bury` gives up: a system call may hold a killed process for long."""


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


def resident(process: psutil.Process) -> int:
    """Resident memory of a process in bytes; 0 if it has ended."""
    try:
        return int(process.memory_info().rss)
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
