"""The way down a loss, for rivals with losses of their own: SOAP, and a budget of work."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import torch
from torch import Tensor, nn

from parapoint import clock
from parapoint.learned.optimizers import SOAP

Terms = Callable[[], dict[str, Tensor]]
"""Gives the weighted terms of a loss at a batch."""


def trained(
    network: nn.Module,
    terms: Terms,
    rate: float,
    iterations: int,
    seconds: float | None,
) -> Iterator[dict[str, float]]:
    """Train a network on the sum of the terms until the steps or the seconds of work end.

    Yields:
        The terms and their "total", at each step.
    """
    began, limit = clock.worked(), math.inf
    if seconds is not None:
        limit = max(seconds, 1e-9)
    optimizer = SOAP(list(network.parameters()))
    for step in range(iterations):
        progress = max(step / iterations, (clock.worked() - began) / limit)
        if progress >= 1:
            return
        found = terms()
        total = torch.stack(list(found.values())).sum()
        total.backward()  # type: ignore[no-untyped-call]
        optimizer.step(rate * (1 + math.cos(math.pi * progress)) / 2)
        yield {name: term.item() for name, term in found.items()} | {"total": total.item()}
