"""Part of `python -m benchmarks speed`: which fraction of the machine's rate training reaches.

Floating-point operations are counted from the sizes of the layers. Rates are per second of
processor time, over all threads. On a shared processor this rate, too, changes by a factor of two
within seconds, as other programs use the same core. So each run is measured between two large
matrix products, and its fraction is the median over several rounds of its rate divided by theirs.

The bare products of the layers, forward and backward, are measured in the same way. They are the
most that a training step can reach: at their sizes, cache misses alone cost a fifth to a third of
the large product's rate.
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

from parapoint.surfaces.surface import FloatArray

PRODUCT = 2048
"""Rows and columns of the float32 matrices whose product is the machine's rate."""
MAPPED = 250_000
"""Dense points of the paper's texture mapping."""
STEPS = (256, 512, 2048)
"""Numbers of points of a training step."""
FEWEST_ROUNDS, ENOUGH = 7, 10.0
"""A row is measured in at least this many rounds, and for at least this many seconds."""


class Work(NamedTuple):
    """A piece of work to measure.

    Attributes:
        run: does it once.
        operations: floating-point operations that it takes.
    """

    run: Callable[[], object]
    operations: float


class Rate(NamedTuple):
    """One measured row.

    Attributes:
        what: what ran.
        seconds: median wall time of one run.
        cpu_seconds: median processor time of one run.
        gflops: median of 1e9 operations per second of processor time; a multiplication and an
            addition are two operations.
        fraction: its rate, divided by that of the matrix products before and after it.
        bare_fraction: its rate, divided by that of the bare products of its layers; NaN for the
            matrix product itself.
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

    from parapoint.learned.networks import SubNetworks, cost, products
    from parapoint.learned.parapoint import ParaPoint
    from parapoint.learned.presets import PRESETS
    from parapoint.learned.trained_map import BATCH, TrainedMap
    from parapoint.learned.trainer import Trainer

    left = torch.rand(PRODUCT, PRODUCT)
    product = Work(partial(torch.mm, left, left), 2 * PRODUCT**3)
    what = f"matrix product, {PRODUCT} x {PRODUCT}"
    wall, cpu = np.median(_in_turn([product])[:, 0], axis=0)
    rows = [Rate(what, wall, cpu, product.operations / cpu / 1e9, 1.0, np.nan)]
    points = np.random.default_rng(0).normal(size=(max(STEPS), 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    for preset in PRESETS:
        for count in STEPS:
            numbers = replace(PRESETS[preset], subset=count, warm_up=0.0)
            trainer = Trainer(points[:count], numbers, seed=0, device="cpu")
            steps = trainer.run()
            assert isinstance(trainer.networks, SubNetworks)
            there, back = products(trainer.networks, tangents=len(trainer.shape.rows) - 1)
            lattice = round(count**0.5) ** 2
            operations = 3 * 2 * (there * count + back * lattice)  # the backward pass is two more
            layers = _products(numbers.hidden, 3 * (count + lattice), backward=True)  # as in Wrap
            step = Work(partial(next, steps), operations)
            rows.append(_rate(f"step of {preset}, {count} points", step, layers, product))
        model = ParaPoint(preset=preset, iterations=1, points=256, device="cpu").fit(points)
        assert isinstance(model.map_, TrainedMap)
        networks = model.map_.networks
        assert isinstance(networks, SubNetworks)
        dense = np.resize(points, (MAPPED, 3))
        operations = 2 * MAPPED * (cost(networks.cut) + cost(networks.unwrap))
        layers = _products(numbers.hidden, BATCH["cpu"], backward=False)
        mapping = Work(partial(model.transform, dense), operations)
        rows.append(_rate(f"mapping of {MAPPED:,} points, {preset}", mapping, layers, product))
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


def _products(hidden: tuple[int, ...], rows: int, *, backward: bool) -> Work:
    """The matrix products of layers from 3 to 3 numbers, applied to `rows` points."""
    import torch

    sizes = list(itertools.pairwise((3, *hidden, 3)))
    layers = [(torch.rand(rows, i), torch.rand(o, i), torch.rand(rows, o)) for i, o in sizes]

    def run() -> None:
        for x, weight, gradient in layers:
            weight @ x.t()
            if backward:
                weight.t() @ gradient.t()
                x.t() @ gradient

    return Work(run, 2 * rows * sum(i * o for i, o in sizes) * (3 if backward else 1))


def _rate(what: str, work: Work, layers: Work, product: Work) -> Rate:
    """The row of a piece of work, measured with the bare products of its layers."""
    times = _in_turn([product, work, product, layers, product])
    before, own, between, bare, after = times[:, :, 1].T
    peak = product.operations
    fraction = float(np.median(work.operations / own * (before + between) / 2) / peak)
    reachable = float(np.median(layers.operations / bare * (between + after) / 2) / peak)
    wall, cpu = np.median(times[:, 1], axis=0)
    return Rate(what, wall, cpu, work.operations / cpu / 1e9, fraction, fraction / reachable)


def _in_turn(works: list[Work]) -> FloatArray:
    """(rounds, works, 2) wall and processor time of each, in seconds.

    Each round does all of them one after another; a first round is not counted.
    """
    rounds: list[list[tuple[float, float]]] = []
    begun = time.perf_counter()
    while len(rounds) <= FEWEST_ROUNDS or time.perf_counter() - begun < ENOUGH:
        rounds.append([])
        for work in works:
            wall, cpu = time.perf_counter(), time.process_time()
            work.run()
            rounds[-1].append((time.perf_counter() - wall, time.process_time() - cpu))
    return np.array(rounds[1:])
