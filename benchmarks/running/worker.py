"""One cell of a run: a process of its own, under a time limit and a memory limit.

`python -m benchmarks.running.worker FD [MODULE ...]` is a supervisor. It has the slow imports
behind it, those of MODULE included, takes jobs (cells, and later the metrics of their maps) as JSON
lines on standard input, runs each in a child process that it watches, and answers with one JSON
line each on file descriptor FD.

On Linux the child is a fork, which costs milliseconds. The supervisor only imports and never
computes: no thread exists that a fork could lose (but OpenBLAS's own, which it stops and restarts
around a fork). It imports nothing because a cell does, and no plugin: the tenth cell finds what the
first one found. Elsewhere, where forking after such imports is not safe, the child is a fresh
interpreter.

What a method may do, it does to its own cell: the child has its own session, its own empty working
folder, and a result pipe that ends with it. At a limit all its descendants are killed, those that
left its process group as well (on Linux they fall to the supervisor as subreaper). If the
supervisor's parent dies, so do they.

Memory is the resident memory of the whole process tree, polled: a limit on address space would
refuse what torch and CUDA only reserve. A method may thus exceed the limit for the length of a
poll.
"""

from __future__ import annotations

import contextlib
import ctypes
import faulthandler
import gc
import importlib
import json
import os
import random
import resource
import select
import signal
import subprocess
import sys
import time
import traceback
from pathlib import Path
from typing import Any, Never

import igl  # noqa: F401  imported before the forks, so that no cell pays for it
import numpy as np
import psutil
import scipy.sparse.linalg
import scipy.spatial  # noqa: F401  as above

from baselines import registry
from benchmarks.store.archives import (
    arrays_hash,
    map_arrays,
    read_map,
    read_surface,
    trace_arrays,
    write_arrays,
)
from benchmarks.store.results import MISSING, SOURCE_CHANGED, measured, plain
from parapoint.method import MissingError, UnsupportedError
from parapoint.surfaces.parameterization import Parameterization, PointParameterization
from parapoint.surfaces.preparation import prepared
from parapoint.surfaces.surface import Mesh, Surface

POLL = 0.05
"""Seconds between two looks at the memory of the method's process."""
TREE_POLL = 0.5
"""Seconds between two looks at its descendants, which cost some milliseconds to find."""
LARGEST_MESSAGE = 1 << 20
"""Bytes of the longest outcome a cell may send, its report included."""
PR_SET_PDEATHSIG = 1
PR_SET_CHILD_SUBREAPER = 36
FORKS = sys.platform == "linux"

Outcome = dict[str, Any]


def main() -> None:
    """Supervise cells until standard input ends."""
    reply = int(sys.argv[1])
    os.set_inheritable(reply, False)
    if FORKS:
        ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
        for module in sys.argv[2:]:
            with contextlib.suppress(Exception):  # a method that needs it says so in its cell
                importlib.import_module(module)
    wake, waker = os.pipe()
    os.set_blocking(wake, False)
    os.set_blocking(waker, False)
    signal.signal(signal.SIGCHLD, lambda *_: None)  # a handler is what makes the wake-up write
    signal.set_wakeup_fd(waker, warn_on_full_buffer=False)
    registry.names()  # looks through the installed packages, so that no cell has to
    gc.freeze()  # a collection in a cell copies none of this
    jobs = os.fdopen(os.dup(0), "rb", buffering=0)
    os.write(reply, b'{"status": "ready"}\n')
    while line := jobs.readline():
        job = json.loads(line)
        if "measure" in job:
            importlib.import_module("benchmarks.metrics.table")  # once, before the forks
        outcome = _supervised(job, wake, [reply, wake, waker, jobs.fileno()])
        os.write(reply, json.dumps(outcome).encode() + b"\n")


def _supervised(job: dict[str, Any], wake: int, private: list[int]) -> Outcome:
    """Run one cell in a child to its end or its limit, and leave nothing of it behind."""
    kills = _system_kills()
    deadline = time.monotonic() + job["time_limit"]
    next_tree = time.monotonic() + TREE_POLL
    result, send = os.pipe()
    child = _start(job, send, [*private, result])
    os.close(send)
    os.set_blocking(result, False)
    message = bytearray()
    verdict: Outcome | None = None
    peak = others = 0
    watched = [0, wake, result]
    while True:
        ready, _, _ = select.select(watched, [], [], POLL)
        if 0 in ready:  # jobs come one at a time, so this is the end of input: the runner is gone
            _bury(child)
            os._exit(1)
        if wake in ready:
            os.read(wake, 4096)
        if result in ready:
            chunk = os.read(result, 1 << 16)
            message += chunk
            if not chunk:
                watched.remove(result)
        ended, status, usage = os.wait4(child, os.WNOHANG)
        if ended:
            break
        now = time.monotonic()
        if now >= next_tree:
            others = sum(_resident(process) for process in _descendants() if process.pid != child)
            next_tree = now + TREE_POLL
        memory = _resident(psutil.Process(child)) + others
        peak = max(peak, memory)
        if verdict is None and memory > job["memory_limit"]:
            limit = job["memory_limit"] / 1e6
            reason = f"used {memory / 1e6:.0f} MB of memory; the limit is {limit:.0f} MB"
            verdict = {"status": "out_of_memory", "reason": reason}
        elif verdict is None and now > deadline:
            reason = f"not done within the limit of {job['time_limit']:g} s"
            verdict = {"status": "timeout", "reason": reason}
        if verdict is not None:
            _kill(child)
    message += _available(result)
    os.close(result)
    _bury(child)
    said = _message(message)
    if verdict is None:
        verdict = said if "status" in said else _death(status, _system_kills() > kills)
    outcome = {"preprocessing": said.get("preprocessing", "")} | verdict
    unit = 1 if sys.platform == "darwin" else 1024  # of ru_maxrss, in bytes
    return outcome | {"peak_memory_mb": max(peak, usage.ru_maxrss * unit) / 1e6}


def _start(job: dict[str, Any], send: int, private: list[int]) -> int:
    """Start the child of a cell, which answers on `send`; its process id."""
    if not FORKS:
        process = subprocess.Popen(  # noqa: S603  our own module
            [sys.executable, "-c", f"from benchmarks.running import worker; worker.cell({send})"],
            stdin=subprocess.PIPE,
            start_new_session=True,
            pass_fds=[send],
        )
        assert process.stdin is not None
        process.stdin.write(json.dumps(job).encode())
        process.stdin.close()
        return process.pid
    supervisor = os.getpid()
    child = os.fork()
    if child:
        return child
    try:
        signal.set_wakeup_fd(-1)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        os.setsid()
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
        if os.getppid() != supervisor:
            os._exit(1)
        for descriptor in private:
            os.close(descriptor)
        _perform(job, send)
    finally:
        os._exit(1)


def cell(send: int) -> Never:
    """The child as a fresh interpreter: the job comes on standard input."""
    _perform(json.loads(sys.stdin.buffer.read()), send)


def _perform(job: dict[str, Any], send: int) -> Never:
    """Run a cell in this process, send its outcome, and end."""
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with contextlib.suppress(OSError):  # short of memory, the system ends this process first
        Path("/proc/self/oom_score_adj").write_text("1000")
    faulthandler.enable(file=2, all_threads=False)
    os.chdir(job["work"])
    os.environ["TMPDIR"] = job["work"]
    own = os.getpid()
    seed = job.get("seed", 0)
    random.seed(seed)
    np.random.seed(seed % 2**32)  # noqa: NPY002  for methods that draw from the global one
    try:
        outcome = _measured(job) if "measure" in job else _outcome(job, send)
    except BaseException as error:  # noqa: BLE001  whatever a method raises is a row
        traceback.print_exc()
        outcome = _failure(error)
    _end_fork(own)
    with contextlib.suppress(OSError, ValueError):
        sys.stdout.flush()
        sys.stderr.flush()
    _tell(send, outcome)
    os._exit(0)  # threads, exit handlers and destructors of a method have no say any more


def _tell(send: int, said: Outcome) -> None:
    """Send fields of a row: one line."""
    content = json.dumps(said).encode() + b"\n"
    if len(content) > LARGEST_MESSAGE:
        reason = f"its report is too large ({len(content)} bytes)"
        content = json.dumps({"status": "failed", "reason": reason}).encode() + b"\n"
    while content:
        content = content[os.write(send, content) :]


def _outcome(job: dict[str, Any], send: int) -> Outcome:
    """Run the method and store its map: the fields of the row that it fills.

    What was done to the surface before is sent ahead: the method may not come to an end.
    """
    for plugin in job["plugins"]:
        registry.register_plugin(plugin)
    _, method = registry.method(job["spec"])
    if registry.source_hash(method) != job["source_hash"]:
        return {"status": "failed", "reason": SOURCE_CHANGED}
    whole = read_surface(Path(job["surface"]))
    if isinstance(whole, Mesh) and "reference" in job and "seams" in method.requires:
        reference = read_map(Path(job["reference"]))
        assert isinstance(reference, Parameterization)
        whole = Mesh(whole.vertices, whole.faces, reference.seams(whole))
    preprocessing, own = "", os.getpid()
    try:
        preparation = prepared(whole, method.requires)
        preprocessing = preparation.steps
        _tell(send, {"preprocessing": preprocessing})
        if hasattr(method, "preload"):
            method.preload()
        before, wall = os.times(), time.perf_counter()
        maps = preparation.maps(method, job["seed"])
        wall, after = time.perf_counter() - wall, os.times()
    except UnsupportedError as error:
        reason = MISSING * isinstance(error, MissingError) + _line(error)
        return {"status": "skipped", "reason": reason, "preprocessing": preprocessing}
    except Exception as error:  # noqa: BLE001  as in _perform; the row says what was done before
        traceback.print_exc()
        return _failure(error) | {"preprocessing": preprocessing}
    _end_fork(own)
    timing = {
        "preprocessing": preprocessing,
        "seconds": wall,
        "cpu_seconds": sum(after[:4]) - sum(before[:4]),
    }
    for surface, part in zip(preparation.parts, maps, strict=True):
        if reason := fault(surface, part):
            return {"status": "failed", "reason": reason} | timing
    result = preparation.joined(maps)
    arrays = map_arrays(result)
    everything = arrays | trace_arrays(result.trace)
    report = plain(result.report)
    try:
        write_arrays(Path(job["map"]), everything)
    except OSError as error:  # not the method's fault: the run cannot go on
        return {"status": "stop", "reason": f"{job['map']}: {error.strerror}"}
    return {"status": "ok", "uv_sha256": arrays_hash(arrays), "report": report} | timing


def _end_fork(own: int) -> None:
    """End this process if it is not the cell's own but one that a method forked and that returned.

    It would write the map and send an outcome a second time.
    """
    if os.getpid() != own:
        os._exit(0)


def _measured(job: dict[str, Any]) -> Outcome:
    """Every metric of a stored map, numbers as text: JSON has no infinity."""
    surface, result = read_surface(Path(job["surface"])), read_map(Path(job["uv"]))
    reference = read_map(Path(job["reference"])) if "reference" in job else None
    assert not isinstance(reference, PointParameterization)
    values = measured(surface, result, reference)
    return {"status": "ok", "metrics": {name: repr(value) for name, value in values.items()}}


def fault(surface: Surface, result: object) -> str:
    """What is wrong with `result` as a map of `surface`; "" if nothing is.

    The types themselves have checked shapes and indices, and that a uv is finite or NaN.
    """
    if isinstance(result, Parameterization | PointParameterization) and not result.covered.any():
        return "the map has no place for anything: every uv is NaN"
    if isinstance(surface, Mesh):
        if not isinstance(result, Parameterization):
            return f"returned {type(result).__name__} for a mesh; it must be a Parameterization"
        if len(result.corners) != len(surface.faces):
            return f"returned {len(result.corners)} corner rows for {len(surface.faces)} faces"
        return ""
    if not isinstance(result, PointParameterization):
        return (
            f"returned {type(result).__name__} for a point cloud; "
            "it must be a PointParameterization"
        )
    if len(result.uv) != len(surface.points):
        return f"returned {len(result.uv)} uv rows for {len(surface.points)} points"
    return ""


def _line(error: BaseException) -> str:
    """The message of an error, with its notes, as one line of bounded length."""
    return " ".join(" ".join([str(error), *getattr(error, "__notes__", [])]).split())[:500]


def _failure(error: BaseException) -> Outcome:
    """The outcome of a cell that raised `error`."""
    name = type(error).__name__
    lacking = isinstance(error, MemoryError) or name == "OutOfMemoryError"
    # torch raises a plain RuntimeError when the CPU allocator fails.
    lacking = lacking or "can't allocate memory" in str(error)
    status = "out_of_memory" if lacking else "failed"
    return {"status": status, "reason": f"{name}: {_line(error)}".removesuffix(": ")}


def _message(content: bytearray) -> Outcome:
    """The fields that a child sent, in whole lines; with a status where it came to its end."""
    said: Outcome = {}
    for line in content.split(b"\n")[:-1]:
        with contextlib.suppress(ValueError, TypeError):  # a method may have written into the pipe
            said |= json.loads(line)
    return said


def _death(status: int, killed_by_system: bool) -> Outcome:
    """The outcome of a child that ended, with that wait status, without sending one."""
    if os.WIFSIGNALED(status):
        number = os.WTERMSIG(status)
        if number == signal.SIGKILL and killed_by_system:
            reason = "killed by the system, which ran out of memory"
            return {"status": "out_of_memory", "reason": reason}
        name = signal.Signals(number).name if number in set(signal.Signals) else f"signal {number}"
        meaning = signal.strsignal(number) or ""
        return {"status": "failed", "reason": f"killed by {name} ({meaning.lower()})"}
    code = os.WEXITSTATUS(status)
    return {"status": "failed", "reason": f"ended the process (exit status {code}) with no result"}


def _system_kills() -> int:
    """How often Linux has killed a process for lack of memory, here or in a container."""
    with contextlib.suppress(OSError):
        for line in Path("/proc/vmstat").read_text().splitlines():
            if line.startswith("oom_kill "):
                return int(line.split()[1])
    return 0


def _available(pipe: int) -> bytes:
    """What can be read from `pipe` without waiting."""
    content = bytearray()
    with contextlib.suppress(BlockingIOError):
        while chunk := os.read(pipe, 1 << 16):
            content += chunk
    return bytes(content)


def _descendants() -> list[psutil.Process]:
    """All processes below the supervisor."""
    try:
        return list(psutil.Process().children(recursive=True))
    except psutil.Error:
        return []


def _resident(process: psutil.Process) -> int:
    """Resident bytes of a process, 0 where it is gone."""
    try:
        return int(process.memory_info().rss)
    except psutil.Error:
        return 0


def _kill(child: int) -> None:
    """Kill the child, its group, and its descendants wherever they have gone."""
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(child, signal.SIGKILL)
    for process in _descendants():
        with contextlib.suppress(psutil.Error):
            process.kill()


def _bury(child: int) -> None:
    """Kill and reap all that is left of a cell; give up on what a system call holds for seconds."""
    if not FORKS:  # no subreaper: the group is all that can be found
        _kill(child)
    give_up = time.monotonic() + 5
    while time.monotonic() < give_up:
        try:
            if os.waitpid(-1, os.WNOHANG) == (0, 0):
                _kill(child)
                time.sleep(0.005)
        except ChildProcessError:
            return


if __name__ == "__main__":
    main()
