"""The way down a loss, for rivals with losses of their own: SOAP, and a budget of work."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator

import torch
from torch import Tensor, nn

from parapoint.learned.optimizers import SOAP

Terms = Callable[[], dict[str, Tensor]]
"""Gives the weighted terms of a loss at a batch."""


def trained(
    network: nn.Module,
    terms: Terms,
    rate: float,
    iterations: int,
    processor_seconds: float | None,
) -> Iterator[dict[str, float]]:
    """Train a network on the sum of the terms until the steps or the processor's time end.

    Yields:
        The terms and their "total", at each step.
    """
    began, limit = time.process_time(), math.inf
    if processor_seconds is not None:
        limit = max(processor_seconds, 1e-9)
    optimizer = SOAP(list(network.parameters()))
    for step in range(iterations):
        progress = max(step / iterations, (time.process_time() - began) / limit)
        if progress >= 1:
            return
        found = terms()
        total = torch.stack(list(found.values())).sum()
        total.backward()  # type: ignore[no-untyped-call]
        optimizer.step(rate * (1 + math.cos(math.pi * progress)) / 2)
        yield {name: term.item() for name, term in found.items()} | {"total": total.item()}
