"""What a strategy of fitting is given, what it tells on the way, and what it returns.

Estimators (`parapoint.estimator`) differ in their strategy alone: `ComputedMap` computes the map of
a surface, `ParaPoint` trains it. Both return a `Fitted`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np

from parapoint.surfaces.frame import Frame
from parapoint.surfaces.parameterization import Charted, Parameterization, TracePoint
from parapoint.surfaces.surface import FloatArray, Mesh, Surface


class SurfaceMap(Protocol):
    """A map between a surface and the plane, both in the frame of the surface."""

    def flatten(self, points: FloatArray) -> FloatArray:
        """(N, 3) points of the surface → (N, 2) points of the plane."""
        ...

    def lift(self, uv: FloatArray) -> FloatArray:
        """(N, 2) points of the plane → (N, 3) points of the surface."""
        ...

    def charted(self) -> Charted | None:
        """The mesh that the map was computed on, in the frame, with its map; None without one."""
        ...

    def arrays(self) -> dict[str, np.ndarray]:
        """Everything that `parapoint.saving` keeps of the map as arrays, by name."""
        ...

    def facts(self) -> dict[str, Any]:
        """Everything else that it keeps, as JSON."""
        ...


@dataclass(frozen=True, eq=False)
class Fitted:
    """What a fit returns.

    Attributes:
        map: the map, in the frame.
        frame: where the surface lies in it.
        points: (n, 3) the points that the map was fitted to, in the surface's unit.
        trace: states on the way, where there were any.
        report: settings and what was found, for tables and `model.json`.
        missed: (m, 3) points that are not on the surface that was found, in the surface's unit.
    """

    map: SurfaceMap
    frame: Frame
    points: FloatArray
    trace: tuple[TracePoint, ...]
    report: dict[str, object]
    missed: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))

    def flatten(self, points: FloatArray) -> FloatArray:
        """(N, 3) points → (N, 2) points of the plane, both in the surface's unit."""
        return np.asarray(self.map.flatten(self.frame.inside(points)) * self.frame.scale)

    def lift(self, uv: FloatArray) -> FloatArray:
        """(N, 2) points of the plane → (N, 3) points, both in the surface's unit."""
        return self.frame.outside(self.map.lift(uv / self.frame.scale))

    def charted(self) -> Charted | None:
        """The mesh that the map was computed on, with its map, both in the surface's unit."""
        return None if (held := self.map.charted()) is None else placed(held, self.frame)


def placed(charted: Charted, frame: Frame) -> Charted:
    """A mesh and its map in a frame → both in the surface's unit, the mesh in its place."""
    mesh = Mesh(frame.outside(charted.mesh.vertices), charted.mesh.faces)
    return Charted(mesh, Parameterization(charted.map.uv * frame.scale, charted.map.corners))


class Progress(NamedTuple):
    """What the callback of a fit is told.

    Attributes:
        phase: what is being done, in a word or two: "reconstructing", "training", ...
        fraction: share of the fit that is done, from 0 to 1; None where nobody can tell.
        remaining: seconds to the end; None where nobody can tell.
        iteration: training steps done; 0 where nothing is trained.
        losses: means of the training terms since they were last told; often empty.
    """

    phase: str
    fraction: float | None = None
    remaining: float | None = None
    iteration: int = 0
    losses: dict[str, float] = {}  # noqa: RUF012 (a default of a named tuple, never changed)


def _silent(_: Progress) -> None:
    pass


@dataclass(frozen=True)
class Session:
    """What accompanies one fit.

    Attributes:
        tell: is called with each Progress.
        checkpoint: folder for the state of the training, or None.
        watched: (N, 3) points whose maps along the way go into the trace, or None.
    """

    tell: Callable[[Progress], None] = _silent
    checkpoint: Path | None = None
    watched: FloatArray | None = field(default=None, compare=False)

    def of_component(self, number: int) -> Session:
        """The session of one of several components: a checkpoint of its own, no watched points."""
        folder = None if self.checkpoint is None else self.checkpoint / f"component-{number}"
        return dataclasses.replace(self, checkpoint=folder, watched=None)


Strategy = Callable[[Surface, float, Session], Fitted]
"""Finds the map of one part of a surface, with a share (0 to 1) of the points and of the time."""
