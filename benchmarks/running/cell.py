"""One cell, inside its own process: run a method or measure maps, say how it ended, and end.

The process belongs to the method: it may crash, fork, print or leave threads behind. So the outcome
goes through a pipe that nothing else uses, and the process ends without running any of the method's
exit handlers.
"""

from __future__ import annotations

import contextlib
import errno
import faulthandler
import functools
import os
import random
import resource
import sys
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Never

import numpy as np

from baselines import registry
from benchmarks.running.environment import load
from benchmarks.running.tasks import Job, MeasureJob, Outcome, Prepared, RunJob, from_json, to_json
from benchmarks.store.archives import (
    arrays_hash,
    map_arrays,
    read_map,
    read_surface,
    trace_arrays,
    write_arrays,
)
from benchmarks.store.measuring import measured
from benchmarks.store.records import plain
from benchmarks.store.rows import MACHINE, MISSING, SOURCE_CHANGED, Status
from parapoint.errors import InputError
from parapoint.method import MissingError, UnsupportedError
from parapoint.surfaces.parameterization import Parameterization, PointParameterization
from parapoint.surfaces.preparation import prepared
from parapoint.surfaces.surface import Mesh, Surface

LONGEST_MESSAGE = 1 << 20
"""Bytes that the line of an outcome may have, the method's report included."""
MACHINE_ERRORS = (errno.ENOSPC, errno.EDQUOT, errno.EIO, errno.EROFS, errno.ENFILE)
"""Errors of the system for which no method can be blamed, wherever they are raised."""
LONGEST_REASON = 500
"""Characters of an error's message that a row keeps."""


def main(send: int) -> Never:
    """The cell as a fresh interpreter: its job comes on standard input."""
    perform(from_json(sys.stdin.buffer.read(), RunJob, MeasureJob), send)


def perform(job: Job, send: int) -> Never:
    """Do a job in this process, write its outcome to the descriptor `send`, and end."""
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with contextlib.suppress(OSError):  # short of memory, the system ends this process first
        Path("/proc/self/oom_score_adj").write_text("1000")
    faulthandler.enable(file=2, all_threads=False)
    os.chdir(job.work)
    os.environ["TMPDIR"] = str(job.work)
    own = os.getpid()
    seed = job.seed if isinstance(job, RunJob) else 0
    random.seed(seed)
    np.random.seed(seed)  # noqa: NPY002  for methods that draw from the global one
    try:
        outcome = _done(job, send)
    except BaseException as error:  # noqa: BLE001  whatever a method raises is a row
        traceback.print_exc()
        outcome = Outcome(*failure(error))
    _end_fork(own)
    with contextlib.suppress(OSError, ValueError):
        sys.stdout.flush()
        sys.stderr.flush()
    _tell(send, outcome)
    os._exit(0)  # no thread, exit handler or destructor of the method runs any more


def _done(job: Job, send: int) -> Outcome:
    """The outcome of a job of either kind."""
    match job:
        case RunJob():
            return run(job, send)
        case MeasureJob():
            return measure(job)
    raise TypeError(f"a cell cannot do a {type(job).__name__}")


def _tell(send: int, message: Prepared | Outcome) -> None:
    """Write a message to the descriptor `send`; one that is too long becomes a failure."""
    content = to_json(message)
    if len(content) > LONGEST_MESSAGE:
        reason = f"its report is too large ({len(content)} bytes)"
        content = to_json(Outcome("failed", reason))
    while content:
        content = content[os.write(send, content) :]


def run(job: RunJob, send: int) -> Outcome:
    """Run the method of a job and write its map; what was done to the surface is told before."""
    for plugin in job.plugins:
        registry.register_plugin(plugin)
    _, method = registry.method(job.spec)
    if registry.source_hash(method) != job.source_hash:
        return Outcome("failed", SOURCE_CHANGED)
    try:
        whole = read_surface(job.surface)
        if isinstance(whole, Mesh) and job.reference and "seams" in method.requires:
            whole = Mesh(whole.vertices, whole.faces, _reference(job.reference).seams(whole))
    except InputError as error:  # a file of the store
        return Outcome("failed", MACHINE + _line(error))
    ended: Callable[..., Outcome] = Outcome
    own = os.getpid()
    try:
        preparation = prepared(whole, method.requires)
        ended = functools.partial(Outcome, preprocessing=preparation.steps)
        _tell(send, Prepared(preparation.steps))
        if hasattr(method, "preload"):
            method.preload()
        busy = load()
        before, wall = os.times(), time.perf_counter()
        maps = preparation.maps(method, job.seed)
        wall, after = time.perf_counter() - wall, os.times()
    except UnsupportedError as error:
        begins = MISSING if isinstance(error, MissingError) else ""
        return ended("skipped", begins + _line(error))
    except Exception as error:  # noqa: BLE001  as in `perform`
        traceback.print_exc()
        return ended(*failure(error))
    _end_fork(own)
    processor = sum(after[:4]) - sum(before[:4])
    busy = max((one for one in (busy, load()) if one is not None), default=None)
    ended = functools.partial(ended, seconds=wall, cpu_seconds=processor, load=busy)
    for surface, part in zip(preparation.parts, maps, strict=True):
        if reason := fault(surface, part):
            return ended("failed", reason)
    result = preparation.joined(maps)
    arrays = map_arrays(result)
    everything = arrays | trace_arrays(result.trace)
    report = plain(result.report)
    try:
        write_arrays(job.map, everything)
    except OSError as error:
        return ended(*failure(error))
    return ended("ok", uv_sha256=arrays_hash(arrays), report=report)


def measure(job: MeasureJob) -> Outcome:
    """Compute every metric of the maps of a job."""
    surface = read_surface(job.surface)
    reference = _reference(job.reference) if job.reference else None
    values = (measured(surface, read_map(path), reference) for path in job.maps)
    return Outcome("ok", metrics=tuple(values))


def _reference(path: Path) -> Parameterization:
    """The map of a mesh in the npz file `path`.

    Raises:
        InputError: the file is missing or damaged, or holds the map of a point cloud.
    """
    reference = read_map(path)
    if not isinstance(reference, Parameterization):
        raise InputError(f"{path}: is the map of a point cloud; a reference is one of a mesh")
    return reference


def _end_fork(own: int) -> None:
    """End this process if it is not `own`, the cell's, but one that the method forked.

    A fork that returns from the method would write the map and tell an outcome a second time.
    """
    if os.getpid() != own:
        os._exit(0)


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


def failure(error: BaseException) -> tuple[Status, str]:
    """The status and the reason of a cell that raised `error`."""
    name = type(error).__name__
    lacking = isinstance(error, MemoryError) or name == "OutOfMemoryError"
    # torch raises a plain RuntimeError when the CPU allocator fails.
    lacking = lacking or "can't allocate memory" in str(error)
    status: Status = "out_of_memory" if lacking else "failed"
    begins = MACHINE if isinstance(error, OSError) and error.errno in MACHINE_ERRORS else ""
    return status, f"{begins}{name}: {_line(error)}".removesuffix(": ")


def _line(error: BaseException) -> str:
    """The message of an error, with its notes, as one line of bounded length."""
    words = " ".join([str(error), *getattr(error, "__notes__", [])]).split()
    return " ".join(words)[:LONGEST_REASON]
