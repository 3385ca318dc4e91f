"""The direction of L-BFGS.

J. Nocedal 1980, "Updating quasi-Newton matrices with limited storage".
"""

from __future__ import annotations

from collections import deque

from parapoint.surfaces.surface import FloatArray

MEMORY = 8
"""Steps that the quasi-Newton direction remembers."""


def direction(slope: FloatArray, pairs: deque[tuple[FloatArray, FloatArray]]) -> FloatArray:
    """The L-BFGS direction: minus the (V, 2) slope times the inverse Hessian that `pairs` imply."""
    move = -slope
    shares = []
    for step, change in reversed(pairs):
        share = (step * move).sum() / (step * change).sum()
        move = move - share * change
        shares.append(share)
    if pairs:
        step, change = pairs[-1]
        move = move * (step * change).sum() / (change * change).sum()
    for (step, change), share in zip(pairs, reversed(shares), strict=True):
        move = move + (share - (change * move).sum() / (step * change).sum()) * step
    return move
