"""One map of a surface of several parts, made of a map of each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from parapoint.fitting import Fitted, Session, Strategy, SurfaceMap, placed
from parapoint.surfaces.frame import IDENTITY, Frame
from parapoint.surfaces.parameterization import Charted, Parameterization
from parapoint.surfaces.preparation import shelves
from parapoint.surfaces.surface import FloatArray, IntArray, Mesh, Surface

GAP = 0.02
"""Least distance between neighbouring charts, in widths of the widest."""


@dataclass(frozen=True, eq=False)
class SideBySide:
    """A map of each of K components; their charts stand apart on shelves, in the surface's unit.

    A point is mapped by the component whose fitted points it is nearest to, a point of the plane
    by the chart whose box it is nearest to.

    Attributes:
        maps: K maps, each in its own frame.
        frames: K frames.
        points: (n, 3) fitted points of all components.
        label: (n,) the component of each.
        shift: (K, 2) what moves a component's map to its chart.
        low, high: (K, 2) corners of the charts' boxes.
    """

    maps: Sequence[SurfaceMap]
    frames: Sequence[Frame]
    points: FloatArray
    label: IntArray
    shift: FloatArray
    low: FloatArray
    high: FloatArray

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.points)

    def flatten(self, points: FloatArray) -> FloatArray:
        """See `SurfaceMap`."""
        label = self.label[self._tree.query(points, workers=-1)[1]]
        uv = np.empty((len(points), 2))
        for k, (of, frame) in enumerate(zip(self.maps, self.frames, strict=True)):
            mine = label == k
            uv[mine] = of.flatten(frame.inside(points[mine])) * frame.scale + self.shift[k]
        return uv

    def lift(self, uv: FloatArray) -> FloatArray:
        """See `SurfaceMap`."""
        beyond = np.maximum(self.low - uv[:, None], 0) + np.maximum(uv[:, None] - self.high, 0)
        label = (beyond**2).sum(axis=2).argmin(axis=1)
        points = np.empty((len(uv), 3))
        for k, (of, frame) in enumerate(zip(self.maps, self.frames, strict=True)):
            mine = label == k
            points[mine] = frame.outside(of.lift((uv[mine] - self.shift[k]) / frame.scale))
        return points

    def charted(self) -> Charted | None:
        """See `SurfaceMap`."""
        parts = []
        for of, frame, shift in zip(self.maps, self.frames, self.shift, strict=True):
            if (held := of.charted()) is None:
                return None
            mesh, own = placed(held, frame)
            parts.append(Charted(mesh, Parameterization(own.uv + shift, own.corners)))
        return joined(parts)

    def arrays(self) -> dict[str, np.ndarray]:
        """See `SurfaceMap`."""
        own = {name: getattr(self, name) for name in ("points", "label", "shift", "low", "high")}
        return own | {
            f"component{k}.{name}": array
            for k, of in enumerate(self.maps)
            for name, array in of.arrays().items()
        }

    def facts(self) -> dict[str, Any]:
        """See `SurfaceMap`."""
        return {
            "components": [
                {
                    "map": type(of).__name__,
                    "centre": frame.centre.tolist(),
                    "scale": frame.scale,
                    "facts": of.facts(),
                }
                for of, frame in zip(self.maps, self.frames, strict=True)
            ]
        }


def joined(parts: Sequence[Charted]) -> Charted:
    """Several meshes with their maps as one."""
    faces, corners = [], []
    vertex_count = uv_count = 0
    for mesh, own in parts:
        faces.append(mesh.faces + vertex_count)
        corners.append(own.corners + uv_count)
        vertex_count += len(mesh.vertices)
        uv_count += len(own.uv)
    vertices = np.concatenate([mesh.vertices for mesh, _ in parts])
    uv = np.concatenate([own.uv for _, own in parts])
    return Charted(
        Mesh(vertices, np.concatenate(faces)), Parameterization(uv, np.concatenate(corners))
    )


def fitted_side_by_side(strategy: Strategy, parts: Sequence[Surface], session: Session) -> Fitted:
    """The map of one part of a surface, or those of several parts side by side.

    Of the points and the time each part has the share that its size is of all.

    Raises:
        InputError: the strategy cannot be fitted to a part.
    """
    if len(parts) == 1:
        return strategy(parts[0], 1.0, session)
    sizes = [len(part.vertices if isinstance(part, Mesh) else part.points) for part in parts]
    made = []
    for number, (part, size) in enumerate(zip(parts, sizes, strict=True)):
        own = session.of_component(number)
        made.append(strategy(part, size / sum(sizes), own))
        if own.checkpoint is not None and own.checkpoint.is_dir():
            own.checkpoint.rmdir()
    return side_by_side(made)


def side_by_side(parts: Sequence[Fitted]) -> Fitted:
    """One fitted map of the components of a surface.

    Args:
        parts: the fitted components, one chart each; they are set on shelves, the highest first.
    """
    charts = [part.flatten(part.points) for part in parts]
    low = np.array([uv.min(axis=0) for uv in charts])
    size = np.array([np.ptp(uv, axis=0) for uv in charts])
    places = shelves(size + GAP * size[:, 0].max())
    points = np.concatenate([part.points for part in parts])
    label = np.repeat(np.arange(len(parts)), [len(part.points) for part in parts])
    whole = SideBySide(
        [part.map for part in parts],
        [part.frame for part in parts],
        points,
        label,
        places - low,
        places,
        places + size,
    )
    reports = [part.report for part in parts]
    report = {
        **reports[0],
        "points": len(points),
        "components": len(parts),
        "seconds": round(sum(float(str(of["seconds"])) for of in reports), 3),
    }
    if "iterations" in report:
        report["iterations"] = sum(int(str(of["iterations"])) for of in reports)
    return Fitted(whole, IDENTITY, points, parts[0].trace, report)
