"""What the numbers of a run depend on besides its methods: commit, versions, machine."""

from __future__ import annotations

import datetime as dt
import functools
import hashlib
import importlib.metadata
import json
import os
import platform
import re
import subprocess
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]

MACHINE = ("python", "packages", "platform", "cpu", "cores", "memory_mb", "gpu")
"""Entries that say where a cell ran. A cell that failed is tried again if one of them differs."""


def environment() -> dict[str, Any]:
    """The commit, interpreter, package versions and machine of this process, and the time."""
    return {
        "date": dt.datetime.now(dt.UTC).isoformat(timespec="seconds"),
        "commit": _said_by("git", "-C", str(ROOT), "rev-parse", "HEAD"),
        "dirty": bool(_said_by("git", "-C", str(ROOT), "status", "--porcelain")),
        "python": platform.python_version(),
        "packages": _packages(),
        "platform": platform.platform(),
        "cpu": processor(),
        "cores": cores(),
        "memory_mb": memory() // 10**6,
        "gpu": _said_by("nvidia-smi", "--query-gpu=name", "--format=csv,noheader").splitlines(),
    }


def cores() -> int:
    """Number of processor cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def load() -> float | None:
    """Processes that ran or waited for a processor in the last minute, over the processors.

    Above 1 some had to wait, so that a wall time says more of the machine than of the method. All
    programs of the machine count. None where the system does not tell.
    """
    try:
        return os.getloadavg()[0] / (os.cpu_count() or 1)
    except (AttributeError, OSError):  # not on every system
        return None


def memory() -> int:
    """Bytes of memory that this machine has, or the container that the process runs in."""
    import psutil

    total = int(psutil.virtual_memory().total)
    try:
        return min(total, int(Path("/sys/fs/cgroup/memory.max").read_text()))
    except (OSError, ValueError):  # no container, or one without a limit ("max")
        return total


def threads(jobs: int) -> int:
    """Threads that a cell may use while `jobs` cells run: OMP_NUM_THREADS, if the user set it."""
    wanted = os.environ.get("OMP_NUM_THREADS", "")
    return int(wanted) if wanted.isdigit() and int(wanted) else max(1, cores() // jobs)


def _packages() -> dict[str, str]:
    """Versions of those packages that the project asks for and that are installed."""
    try:
        wanted = importlib.metadata.requires("parapoint") or []
    except importlib.metadata.PackageNotFoundError:
        return {}
    versions = {"parapoint": importlib.metadata.version("parapoint")}
    for requirement in wanted:
        match = re.match(r"[\w.-]+", requirement)
        name = match.group() if match else requirement
        try:
            versions[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            continue
    return versions


@functools.cache
def processor() -> str:
    """Name of the processor."""
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


@functools.cache
def project() -> str:
    """Hash of the project's source and of the versions of the packages that it asks for.

    Two machines with the same hash get the same map from a cell, and the same metrics from a map.
    """
    digest = hashlib.sha256(json.dumps(_packages(), sort_keys=True).encode())
    for package in ("parapoint", "baselines", "benchmarks"):
        for path in sorted((ROOT / package).rglob("*.py")):
            digest.update(str(path.relative_to(ROOT)).encode() + path.read_bytes())
    return digest.hexdigest()[:16]


def _said_by(*command: str) -> str:
    """What a program prints; "" if it is missing or fails."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=20, check=True)  # noqa: S603  fixed programs
    except (OSError, subprocess.SubprocessError):
        return ""
    return done.stdout.strip()
