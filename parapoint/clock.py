"""The clock that time budgets go by."""

from __future__ import annotations

import time


def worked() -> float:
    """Seconds of processor time that this thread has worked so far.

    Where nothing else wants its core they pass as seconds on the wall do. On a busy machine a
    budget in them buys the same work, and so the same map, only later. What a GPU computes counts
    while the thread waits for it.
    """
    return time.thread_time()
