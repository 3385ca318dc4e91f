"""`python -m benchmarks speed`: how much of the machine's rate the heavy parts reach.

FLOPs are counted from the sizes of the layers; a matrix product is measured in the same run, so
that the fractions hold on a busy machine too. Best of several runs, wall time, torch's threads.
"""

from __future__ import annotations

import time
from collections.abc import Callable
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
        seconds: time of one run, the best of several.
        gflops: 1e9 operations a second, multiplications and additions counted apart.
        fraction: of the matrix product's rate.
    """

    what: str
    seconds: float
    gflops: float
    fraction: float


def training_rates(preset: str = "paper") -> list[Rate]:
    """The matrix product, training steps of a preset, and the mapping of 250,000 points."""
    import numpy as np
    import torch

    from parapoint.estimator import ParaPoint
    from parapoint.networks import SubNetworks, products
    from parapoint.presets import PRESETS
    from parapoint.trainer import Trainer

    left = torch.rand(PRODUCT, PRODUCT)
    seconds = _best(lambda: left @ left, 5)
    peak = 2 * PRODUCT**3 / seconds
    rows = [Rate(f"matrix product, {PRODUCT} x {PRODUCT}", seconds, peak / 1e9, 1.0)]

    def add(what: str, seconds: float, operations: float) -> None:
        rate = operations / seconds
        rows.append(Rate(what, seconds, rate / 1e9, rate / peak))

    points = np.random.default_rng(0).normal(size=(max(STEPS), 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    numbers = PRESETS[preset]
    for count in STEPS:
        trainer = Trainer(points[:count], numbers, seed=0, device="cpu")
        steps = trainer.run()
        assert isinstance(trainer.networks, SubNetworks)
        there, back = products(trainer.networks)
        lattice = round(count**0.5) ** 2
        operations = 3 * 2 * (there * count + back * lattice)  # the backward pass is two more
        seconds = _best(partial(next, steps), 5)
        add(f"training step of {preset}, {count} points", seconds, operations)
    model = ParaPoint(preset=preset, iterations=1, points=256, device="cpu").fit(points)
    dense = np.resize(points, (MAPPED, 3))
    weights = [*model.networks_.cut.parameters(), *model.networks_.unwrap.parameters()]
    operations = 2 * MAPPED * sum(weight.numel() for weight in weights if weight.ndim == 2)
    seconds = _best(lambda: model.transform(dense), 2)
    add(f"mapping of {MAPPED:,} points, {preset}", seconds, operations)
    return rows


def training_table() -> Table:
    """`training_rates` as a table."""
    table = Table("what", "seconds", "GFLOP/s", "of the matrix product", title="ParaPoint's speed")
    for row in training_rates():
        table.add_row(row.what, f"{row.seconds:.4f}", f"{row.gflops:.1f}", f"{row.fraction:.0%}")
    return table


def _best(run: Callable[[], object], repeats: int) -> float:
    """The shortest of `repeats` times, after one run that is not counted."""
    run()
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        run()
        times.append(time.perf_counter() - begin)
    return min(times)
