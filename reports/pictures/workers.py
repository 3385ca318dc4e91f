"""Processes that share the drawing, and end with the report, however that ends."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import active_children, get_context
from typing import TypeVar

from benchmarks.running.limits import end_with
from parapoint.files.decoding import allow, allowed

Result = TypeVar("Result")
_log = logging.getLogger("parapoint")


def done_by_several(
    make: Callable[..., Result], work: Sequence[tuple[object, ...]], jobs: int
) -> Iterator[Result]:
    """What `make` returns for the arguments of each piece of work, in order.

    Args:
        make: a function that other processes can import, or a partial one.
        work: the arguments of each call.
        jobs: how many processes share the work. Where the system has no room for what they would
            share, as with a full /dev/shm, this process does it alone.

    Raises:
        ChildProcessError: one of them was killed.
    """
    pool = _pool(min(jobs, len(work)))
    if pool is None:
        for arguments in work:
            yield make(*arguments)
        return
    others = set(active_children())
    try:
        for pending in [pool.submit(make, *arguments) for arguments in work]:
            try:
                yield pending.result()
            except BrokenProcessPool:
                raise ChildProcessError(
                    "a process that draws was killed, perhaps for its memory; the same command "
                    "draws what is missing"
                ) from None
    except BaseException:  # what they are at would keep this process for as long as it takes
        for child in set(active_children()) - others:
            child.terminate()
        raise
    finally:
        pool.shutdown(cancel_futures=True)


def _begin(parent: int, decoded: float) -> None:
    """Let this process end with its parent, and files decode to as much as they may there."""
    end_with(parent)
    allow(decoded)


def _pool(jobs: int) -> ProcessPoolExecutor | None:
    """Processes for `jobs` jobs; None for one job, or where there can be no others."""
    if jobs <= 1:
        return None
    try:
        return ProcessPoolExecutor(
            jobs,
            mp_context=get_context("spawn"),
            initializer=_begin,
            initargs=(os.getpid(), allowed()),
        )
    except OSError as error:
        _log.warning("one process draws alone: %s", error.strerror)
        return None
