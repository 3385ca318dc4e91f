"""`python -m benchmarks speed`: how much of the machine's rate the heavy parts reach.

FLOPs are counted from the sizes of the layers, and rates are over processor time, all threads
together, best of several runs: on a busy machine it does not count the time in which others ran.
Each row stands against a large matrix product and against the bare products of its own layers,
forward and backward, all three measured in turn, as a processor's rate drifts. The second is what a
step can reach at all: cache misses at these sizes take a fifth of the large product's rate before
anything else is done.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
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
    import torch

    from parapoint.estimator import BATCH, ParaPoint
    from parapoint.networks import SubNetworks, cost, products
    from parapoint.presets import PRESETS
    from parapoint.trainer import Trainer

    left = torch.rand(PRODUCT, PRODUCT)
    product, of_product = partial(torch.mm, left, left), 2 * PRODUCT**3
    ((seconds, cpu),) = _best([product], 5)
    what = f"matrix product, {PRODUCT} x {PRODUCT}"
    rows = [Rate(what, seconds, cpu, of_product / cpu / 1e9, 1.0, np.nan)]

    def add(what: str, run: Callable[[], object], operations: float, layers: Products) -> None:
        own, large, bare = _best([run, product, layers.run], 5)
        rate = operations / own[1]
        peak, reachable = of_product / large[1], layers.operations / bare[1]
        rows.append(Rate(what, *own, rate / 1e9, rate / peak, rate / reachable))

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
            layers = _products(numbers.hidden, 3 * (count + lattice), backward=True)  # as in Wrap
            add(f"step of {preset}, {count} points", partial(next, steps), operations, layers)
        model = ParaPoint(preset=preset, iterations=1, points=256, device="cpu").fit(points)
        assert isinstance(model.networks_, SubNetworks)
        dense = np.resize(points, (MAPPED, 3))
        operations = 2 * MAPPED * (cost(model.networks_.cut) + cost(model.networks_.unwrap))
        layers = _products(numbers.hidden, BATCH["cpu"], backward=False)
        mapping = partial(model.transform, dense)
        add(f"mapping of {MAPPED:,} points, {preset}", mapping, operations, layers)
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


class Products(NamedTuple):
    """The bare products of a stack.

    Attributes:
        run: takes them.
        operations: FLOPs that it takes.
    """

    run: Callable[[], None]
    operations: float


def _products(hidden: tuple[int, ...], rows: int, *, backward: bool) -> Products:
    """The products of a stack 3 → 3 at so many rows."""
    import torch

    sizes = list(itertools.pairwise((3, *hidden, 3)))
    layers = [(torch.rand(rows, i), torch.rand(o, i), torch.rand(rows, o)) for i, o in sizes]

    def run() -> None:
        for x, weight, gradient in layers:
            weight @ x.t()
            if backward:
                weight.t() @ gradient.t()
                x.t() @ gradient

    return Products(run, 2 * rows * sum(i * o for i, o in sizes) * (3 if backward else 1))


def _best(runs: list[Callable[[], object]], rounds: int) -> list[tuple[float, float]]:
    """The shortest wall and processor times of each of `runs`, which are taken in turn.

    After one round that is not counted.
    """
    times = np.empty((rounds + 1, len(runs), 2))
    for one_round in times:
        for run, taken in zip(runs, one_round, strict=True):
            begin = time.perf_counter(), time.process_time()
            run()
            taken[:] = time.perf_counter() - begin[0], time.process_time() - begin[1]
    return [(float(wall), float(cpu)) for wall, cpu in times[1:].min(axis=0)]
