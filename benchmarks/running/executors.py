"""Where the cells of a run are done: on this machine, or on the workers of a cluster.

`local` starts supervisors as child processes (`benchmarks.running.local`). `dask://HOST:PORT` has
the same supervisors below each worker of a dask scheduler, and `slurm` starts such workers as jobs
of a Slurm cluster (`benchmarks.running.cluster`). With any of them, a cell has a process of its own
under its own limits; its outcome and its map come back to the process of the run, which alone
writes into the results folder.
"""

from __future__ import annotations

import functools
import importlib.util
from pathlib import Path

from benchmarks.running import environment
from benchmarks.running.cluster import Remote, dask_client, slurm_client
from benchmarks.running.local import Local
from benchmarks.running.tasks import Executor, Tick
from parapoint.errors import InputError

PROTOCOLS = {"dask": "tcp", "dask+tls": "tls"}
"""How a scheduler is reached, by the scheme of its executor. Over tcp anybody who reaches it can
run code on the workers; the certificates of tls are those of dask's own configuration
(`distributed.comm.tls`)."""


def executor(name: str, folder: Path, *, jobs: int, memory: float | None, tick: Tick) -> Executor:
    """The executor of a name: local, dask://HOST:PORT or slurm.

    Args:
        name: its name.
        folder: scratch folder on this machine; the executor makes it and removes it.
        jobs: how many cells run at a time.
        memory: GB that a cell may hold; only `local` can do without, as it knows the machine.
        tick: called several times a second.

    Raises:
        InputError: there is no such executor, a package that it needs is missing, or `memory` is
            None where it is needed.
    """
    if name == "local":
        return Local(folder, environment.threads(jobs), tick)
    scheme, _, address = name.partition("://")
    if name != "slurm" and not (scheme in PROTOCOLS and address):
        raise InputError(
            f"there is no executor {name!r}; there are local, dask://HOST:PORT, "
            "dask+tls://HOST:PORT, slurm"
        )
    for package in ("distributed", *["dask_jobqueue"] * (name == "slurm")):
        if importlib.util.find_spec(package) is None:
            raise InputError(
                f"the executor {name} needs the package {package}: "
                "python -m pip install -e '.[bench,cluster]'"
            )
    if memory is None:
        raise InputError(f"say how many GB a cell may hold on a worker of {name}: --memory 8")
    threads = environment.threads(environment.cores())
    if name == "slurm":
        return Remote(functools.partial(slurm_client, jobs, memory, threads), folder, jobs, tick)
    return Remote(
        functools.partial(dask_client, f"{PROTOCOLS[scheme]}://{address}"), folder, jobs, tick
    )
