"""A method that goes wrong in a given way: what is left of a run is what the harness saves."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Never

import numpy as np

from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import Mesh, Surface


def _eat() -> Never:
    hoard = []
    while True:
        hoard.append(np.ones(1 << 21))
        time.sleep(0.005)


def _sleep() -> Never:
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    while True:
        time.sleep(60)


def _breed() -> None:
    for _ in range(3):
        if not os.fork():
            time.sleep(600)
    os.kill(os.getpid(), signal.SIGKILL)


def _kill_the_supervisor() -> None:
    os.kill(os.getppid(), signal.SIGKILL)
    time.sleep(60)


def _babble() -> None:
    for _ in range(20_000):
        print("x" * 1000)
    raise ValueError("enough is said")


FAULTS: dict[str, tuple[Callable[[], object], str]] = {
    "segfault": (lambda: ctypes.string_at(0), "failed"),
    "quit": (lambda: os._exit(0), "failed"),
    "exit": (lambda: sys.exit("enough"), "failed"),
    "kill_itself": (lambda: os.kill(os.getpid(), signal.SIGKILL), "failed"),
    "kill_the_supervisor": (_kill_the_supervisor, "failed"),
    "breed": (_breed, "failed"),
    "babble": (_babble, "failed"),
    "eat": (_eat, "out_of_memory"),
    "sleep": (_sleep, "timeout"),
}
"""What goes wrong, and the status of the row that comes of it."""


@dataclass(frozen=True)
class Faulty:
    """Does not come back.

    Attributes:
        fault: one of FAULTS.
    """

    fault: str = "segfault"

    requires: ClassVar[frozenset[str]] = frozenset({"faces"})

    def parameterize(self, surface: Surface, *, seed: int) -> Parameterization:  # noqa: ARG002  its end comes first
        """Go wrong."""
        assert isinstance(surface, Mesh)
        FAULTS[self.fault][0]()
        return Parameterization(surface.vertices[:, :2], surface.faces)
