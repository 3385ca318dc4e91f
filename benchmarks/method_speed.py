"""The methods' part of `python -m benchmarks speed`: what a method costs beside its library.

Each method is timed as the runner times it (the surface read and prepared, the library imported),
and so is a bare call of its library on the arrays that the method hands it: no check, no start, no
trace, no scaling. Processor time, which other programs disturb less than wall time.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import NamedTuple

import igl
import numpy as np
from rich.table import Table

from baselines import registry
from benchmarks.metric_speed import speed_map
from parapoint.parameterization import Parameterization
from parapoint.preparation import prepared
from parapoint.surface import Mesh

SIZES = (10_000, 100_000)
ENOUGH = 10.0
"""CPU seconds after which a method is measured no more."""
LIMIT = 0.1
"""What a method may take beside its library, of the library's time."""


class Overhead(NamedTuple):
    """One method on one disk.

    Attributes:
        method: its spec.
        faces: number of faces.
        bare: CPU seconds of the library alone.
        whole: CPU seconds of the method.
    """

    method: str
    faces: int
    bare: float
    whole: float


def bare_lscm(mesh: Mesh, made: Parameterization) -> None:
    """LSCM, pinned where the method pins it: the two vertices that lie on the u axis."""
    pins = np.flatnonzero(made.uv[:, 1] == 0)
    igl.lscm(
        mesh.vertices, mesh.faces, pins[np.argsort(made.uv[pins, 0])], np.array([[0.0, 0], [1, 0]])
    )


def bare_slim(mesh: Mesh, made: Parameterization) -> None:
    """Twenty steps of SLIM from the start of the method."""
    solver = igl.slim_precompute(
        np.asfortranarray(mesh.vertices),
        np.asfortranarray(mesh.faces.astype(np.int32)),
        np.asfortranarray(made.trace[0].uv),
        igl.MappingEnergyType.SYMMETRIC_DIRICHLET,
        np.zeros(0, dtype=np.int32),
        np.zeros((0, 2), order="F"),
        0.0,
    )
    igl.slim_solve(solver, 20)


def bare_xatlas(mesh: Mesh, _: Parameterization) -> None:
    """Charts and packing with the library's own options."""
    import xatlas

    atlas = xatlas.Atlas()
    atlas.add_mesh(mesh.vertices.astype(np.float32), mesh.faces.astype(np.uint32))
    atlas.generate()
    atlas.get_mesh(0)


BARE: dict[str, Callable[[Mesh, Parameterization], None]] = {
    "lscm": bare_lscm,
    "slim": bare_slim,
    "xatlas": bare_xatlas,
}
"""The library's part of each method that is measured."""


def overheads(sizes: tuple[int, ...] = SIZES) -> list[Overhead]:
    """Each method on a disk of each size: the least of five times, or of as many as take 10 s."""
    found = []
    for faces in sizes:
        disk, _ = speed_map("disk", faces)
        for spec, bare in BARE.items():
            _, method = registry.method(spec)
            times: list[tuple[float, float]] = []
            while len(times) < 5 and np.sum(times) < ENOUGH:
                mesh = Mesh(disk.vertices, disk.faces)
                (surface,) = prepared(mesh, method.requires).parts
                begin = time.process_time()
                made = method.parameterize(surface, seed=0)
                middle = time.process_time()
                assert isinstance(made, Parameterization)
                bare(mesh, made)
                times.append((time.process_time() - middle, middle - begin))
            found.append(Overhead(spec, len(disk.faces), *map(float, np.min(times, axis=0))))
    return found


def overhead_table(costs: list[Overhead]) -> Table:
    """The costs as a table."""
    shown = Table(title="Methods and bare calls of their libraries", title_justify="left")
    shown.add_column("method")
    for heading in ("faces", "CPU seconds", "library alone", "more", "limit"):
        shown.add_column(heading, justify="right")
    for cost in costs:
        shown.add_row(
            cost.method,
            f"{cost.faces:,}",
            f"{cost.whole:.3f}",
            f"{cost.bare:.3f}",
            f"{cost.whole / cost.bare - 1:+.1%}",
            f"{LIMIT:.0%}",
        )
    return shown
