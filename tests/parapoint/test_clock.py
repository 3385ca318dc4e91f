"""Time budgets count the work that was done, not the time that went by."""

import threading
import time

from parapoint import clock


def test_waiting_is_not_work():
    before = clock.worked()
    time.sleep(0.05)
    assert clock.worked() - before < 0.04


def test_work_counts_as_the_seconds_it_takes():
    before, wall = clock.worked(), time.monotonic()
    while clock.worked() - before < 0.02:
        pass
    assert time.monotonic() - wall > 0.019


def test_another_threads_work_is_not_ones_own():
    def work() -> None:
        begun = clock.worked()
        while clock.worked() - begun < 0.05:
            pass

    thread = threading.Thread(target=work)
    before = clock.worked()
    thread.start()
    thread.join()
    assert clock.worked() - before < 0.04
