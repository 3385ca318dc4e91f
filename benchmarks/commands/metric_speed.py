"""Part of `python -m benchmarks speed`: how the cost of the metrics grows with the faces.

Each size has two maps: a disk, and an atlas whose charts have eight to ten faces. A time is the
best of a few calls of `evaluate`, each on new objects that have nothing cached.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import time
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from rich.table import Table

from benchmarks.cases.builtin import grid_faces
from benchmarks.metrics.evaluation import evaluate
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import Mesh

SIZES = (1_000, 10_000, 100_000, 1_000_000)
"""Numbers of faces of the maps."""
CHART_FACES = 10
"""Faces of each chart of an atlas, at most."""
LIMITS = {100_000: (1.0, 1.0), 1_000_000: (15.0, 6.0)}
"""What the metrics of a map may cost, in seconds and in GB, by its number of faces."""

Kind = Literal["disk", "atlas"]
KINDS: tuple[Kind, ...] = ("disk", "atlas")


class Cost(NamedTuple):
    """What it costs to compute all metrics of one map.

    Attributes:
        kind: "disk" or "atlas".
        faces: number of faces.
        charts: number of charts.
        seconds: wall time.
        cpu_seconds: processor time, which exceeds the wall time if threads ran in parallel.
        gigabytes: peak memory of a process that does nothing else, with its imports and the map.
    """

    kind: Kind
    faces: int
    charts: int
    seconds: float
    cpu_seconds: float
    gigabytes: float


def speed_map(kind: Kind, faces: int) -> tuple[Mesh, Parameterization]:
    """A bumpy sheet of about `faces` faces, mapped with some distortion and without overlap."""
    rng = np.random.default_rng(0)
    if kind == "disk":
        side = round((faces / 2) ** 0.5)
        rows, columns, charts = side + 1, side + 1, 1
    else:
        rows, columns, charts = 2, CHART_FACES // 2 + 1, faces // CHART_FACES
    x, y = np.meshgrid(np.arange(columns, dtype=float), np.arange(rows, dtype=float))
    flat = np.stack([x.ravel(), y.ravel()], axis=1)
    across = int(np.ceil(charts**0.5))
    corner = np.stack(np.divmod(np.arange(charts), across), axis=1) * (np.ptp(flat, axis=0) + 1)
    uv = (flat + rng.uniform(-0.2, 0.2, (charts, *flat.shape)) + corner[:, None]).reshape(-1, 2)
    turn = np.array([[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]])
    corners = grid_faces(rows, columns) + len(flat) * np.arange(charts)[:, None, None]
    vertices = np.column_stack([uv, rng.uniform(-0.1, 0.1, len(uv))])
    return Mesh(vertices, corners.reshape(-1, 3)), Parameterization(
        uv @ turn, corners.reshape(-1, 3)
    )


def metric_cost(kind: Kind, faces: int) -> Cost:
    """What all metrics of the map `speed_map(kind, faces)` cost in this process."""
    mesh, parameterization = speed_map(kind, faces)
    seconds, cpu_seconds = np.inf, np.inf
    for _ in range(3 if faces <= SIZES[2] else 1):
        fresh = Mesh(mesh.vertices, mesh.faces)
        copy = Parameterization(parameterization.uv, parameterization.corners)
        begin, cpu_begin = time.perf_counter(), time.process_time()
        values = evaluate(fresh, copy)
        cpu_seconds = min(cpu_seconds, time.process_time() - cpu_begin)
        seconds = min(seconds, time.perf_counter() - begin)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    unit = 1 if sys.platform == "darwin" else 1024  # bytes there, kibibytes elsewhere
    charts = int(values["chart_count"])
    return Cost(kind, len(mesh.faces), charts, seconds, cpu_seconds, peak * unit / 1e9)


def metric_costs(sizes: tuple[int, ...] = SIZES) -> list[Cost]:
    """The costs of every kind and size, each measured in a process of its own, for its memory."""
    found = []
    for kind in KINDS:
        for faces in sizes:
            done = subprocess.run(  # noqa: S603  # our own module, our own numbers
                [sys.executable, "-m", "benchmarks.commands.metric_speed", kind, str(faces)],
                check=True,
                capture_output=True,
                text=True,
            )
            words = done.stdout.split()
            found.append(Cost(kind, int(words[0]), int(words[1]), *map(float, words[2:])))
    return found


def metric_table(costs: list[Cost]) -> Table:
    """The costs as a table, next to the limits of their sizes."""
    shown = Table(title="All metrics of one map, exact overlap included", title_justify="left")
    shown.add_column("map")
    for heading in ("faces", "charts", "seconds", "CPU seconds", "GB", "µs a face", "limit"):
        shown.add_column(heading, justify="right")
    for cost in costs:
        nearest = min(SIZES, key=lambda size: abs(np.log(size / cost.faces)))
        limit = "{:g} s, {:g} GB".format(*LIMITS[nearest]) if nearest in LIMITS else ""
        shown.add_row(
            cost.kind,
            f"{cost.faces:,}",
            f"{cost.charts:,}",
            f"{cost.seconds:.3f}",
            f"{cost.cpu_seconds:.3f}",
            f"{cost.gigabytes:.2f}",
            f"{cost.seconds / cost.faces * 1e6:.1f}",
            limit,
        )
    return shown


def growth_figure(costs: list[Cost], path: Path) -> None:
    """Draw time and memory against the number of faces, on logarithmic axes, into a PNG file."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 4), dpi=150, layout="constrained")
    time_axis, memory_axis = figure.subplots(1, 2)
    for kind, marker, colour in zip(KINDS, "os", ("#0072B2", "#D55E00"), strict=True):
        rows = [cost for cost in costs if cost.kind == kind]
        faces = [cost.faces for cost in rows]
        style = {"marker": marker, "color": colour}
        time_axis.plot(faces, [cost.seconds for cost in rows], label=kind, **style)
        memory_axis.plot(faces, [cost.gigabytes for cost in rows], label=kind, **style)
    first = costs[0]
    ends = np.array([first.faces, max(cost.faces for cost in costs)], dtype=float)
    anchor = max((cost for cost in costs if cost.kind == first.kind), key=lambda cost: cost.faces)
    line = anchor.seconds * ends / anchor.faces
    time_axis.plot(ends, line, "--", color="0.5", label="linear", zorder=0)
    for size, (seconds, gigabytes) in LIMITS.items():
        time_axis.plot(size, seconds, "v", color="0.2")
        memory_axis.plot(size, gigabytes, "v", color="0.2")
    time_axis.plot([], [], "v", color="0.2", label="limit")
    for axis, label in ((time_axis, "seconds"), (memory_axis, "peak memory, GB")):
        axis.set(xscale="log", yscale="log", xlabel="faces", ylabel=label)
        axis.grid(alpha=0.3)
    time_axis.legend(frameon=False)
    figure.suptitle("All metrics of one map, exact overlap included")
    figure.savefig(path, format="png")


if __name__ == "__main__":
    result = metric_cost("disk" if sys.argv[1] == "disk" else "atlas", int(sys.argv[2]))
    print(*result[1:])
