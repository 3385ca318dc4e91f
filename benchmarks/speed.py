"""`python -m benchmarks speed`: how much of the machine's rate the heavy parts reach.

FLOPs are counted from the sizes of the layers, and rates are over processor time, all threads
together, best of several runs: on a busy machine it does not count the time in which others ran.
Each row stands against a large matrix product and against the bare products of its own layers,
forward and backward, measured in the same run. The second is what a step can reach at all: cache
misses at these sizes take a fifth of the large product's rate before anything else is done.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import NamedTuple

from rich.table import Table

PRODUCT = 2048
"""Rows and columns of the float32 matrices whose product is the machine's rate."""
MAPPED = 250_000
"""Dense points of the paper's texture mapping."""
STEPS = (256, 512, 2048)
"""Points of a training step."""


class Rate(NamedTuple):
    """One measured row.

    Attributes:
        what: what ran.
        seconds: wall time of one run, the best of several.
        cpu_seconds: processor time of one run, the best of several.
        gflops: 1e9 operations a second of processor time, multiplications and additions counted
            apart.
        fraction: of the matrix product's rate.
        bare_fraction: of the rate of the bare products of its layers; NaN for the product itself.
    """

    what: str
    seconds: float
    cpu_seconds: float
    gflops: float
    fraction: float
    bare_fraction: float


def training_rates() -> list[Rate]:
    """The matrix product, training steps of two presets, and the mapping of 250,000 points."""
    import numpy as np
    import torch

    from parapoint.estimator import BATCH, ParaPoint
    from parapoint.networks import SubNetworks, cost, products
    from parapoint.presets import PRESETS
    from parapoint.trainer import Trainer

    left = torch.rand(PRODUCT, PRODUCT)
    seconds, cpu = _best(lambda: left @ left, 5)
    peak = 2 * PRODUCT**3 / cpu
    rows = [Rate(f"matrix product, {PRODUCT} x {PRODUCT}", seconds, cpu, peak / 1e9, 1.0, np.nan)]

    def add(what: str, times: tuple[float, float], operations: float, bare: float) -> None:
        rate = operations / times[1]
        rows.append(Rate(what, *times, rate / 1e9, rate / peak, rate / bare))

    points = np.random.default_rng(0).normal(size=(max(STEPS), 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    for preset in ("paper", "smooth"):
        for count in STEPS:
            numbers = replace(PRESETS[preset], subset=count, warm_up=0.0)
            trainer = Trainer(points[:count], numbers, seed=0, device="cpu")
            steps = trainer.run()
            assert isinstance(trainer.networks, SubNetworks)
            there, back = products(trainer.networks, tangents=len(trainer.shape) - 1)
            lattice = round(count**0.5) ** 2
            operations = 3 * 2 * (there * count + back * lattice)  # the backward pass is two more
            bare = _bare_rate(numbers.hidden, 3 * (count + lattice), backward=True)  # as in Wrap
            add(
                f"step of {preset}, {count} points",
                _best(partial(next, steps), 5),
                operations,
                bare,
            )
        model = ParaPoint(preset=preset, iterations=1, points=256, device="cpu").fit(points)
        assert isinstance(model.networks_, SubNetworks)
        dense = np.resize(points, (MAPPED, 3))
        operations = 2 * MAPPED * (cost(model.networks_.cut) + cost(model.networks_.unwrap))
        bare = _bare_rate(numbers.hidden, BATCH["cpu"], backward=False)
        times = _best(partial(model.transform, dense), 2)
        add(f"mapping of {MAPPED:,} points, {preset}", times, operations, bare)
    return rows


def training_table() -> Table:
    """`training_rates` as a table."""
    columns = ("what", "seconds", "processor s", "GFLOP/s", "of the product", "of the bare layers")
    table = Table(*columns, title="ParaPoint's speed")
    for row in training_rates():
        bare = "" if row.bare_fraction != row.bare_fraction else f"{row.bare_fraction:.0%}"
        times = f"{row.seconds:.4f}", f"{row.cpu_seconds:.4f}"
        table.add_row(row.what, *times, f"{row.gflops:.1f}", f"{row.fraction:.0%}", bare)
    return table


def _bare_rate(hidden: tuple[int, ...], rows: int, *, backward: bool) -> float:
    """FLOPs a second of processor time of the products of a stack 3 → 3 at so many rows."""
    import torch

    sizes = list(itertools.pairwise((3, *hidden, 3)))
    layers = [(torch.rand(rows, i), torch.rand(o, i), torch.rand(rows, o)) for i, o in sizes]

    def products() -> None:
        for x, weight, gradient in layers:
            weight @ x.t()
            if backward:
                weight.t() @ gradient.t()
                x.t() @ gradient

    operations = 2 * rows * sum(i * o for i, o in sizes) * (3 if backward else 1)
    return operations / _best(products, 5)[1]


def _best(run: Callable[[], object], repeats: int) -> tuple[float, float]:
    """The shortest wall and processor times of `repeats` runs, after one that is not counted."""
    run()
    times = []
    for _ in range(repeats):
        begin = time.perf_counter(), time.process_time()
        run()
        times.append((time.perf_counter() - begin[0], time.process_time() - begin[1]))
    wall, processor = zip(*times, strict=True)
    return min(wall), min(processor)
