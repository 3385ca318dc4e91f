"""One map of a surface of several parts, made of a map of each."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from parapoint.errors import InputError
from parapoint.fitting import Fitted, Session, Strategy, SurfaceMap, placed
from parapoint.surfaces.components import FEWEST, components
from parapoint.surfaces.frame import IDENTITY, Frame
from parapoint.surfaces.parameterization import Charted, Parameterization
from parapoint.surfaces.preparation import shelves
from parapoint.surfaces.surface import FloatArray, IntArray, Mesh, PointCloud, Surface

logger = logging.getLogger("parapoint")

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


def fitted_side_by_side(
    strategy: Strategy, parts: Sequence[Surface], session: Session, *, whole: bool = False
) -> Fitted:
    """The map of one part of a surface, or those of several parts side by side.

    Of the points and the time each part has the share that its size is of all.

    Args:
        strategy: finds the map of a part.
        parts: the parts.
        session: what accompanies the fit.
        whole: what is not on the surface that was found of a cloud becomes further parts, where it
            has the points of one; it stays unmapped where no map of it is found.

    Raises:
        InputError: the strategy cannot be fitted to a part.
    """
    sizes = [len(part.vertices if isinstance(part, Mesh) else part.points) for part in parts]
    waiting, made = list(parts), list[Fitted]()
    while waiting:
        part, number = waiting.pop(0), len(made)
        own = session if len(parts) == 1 and not made else session.of_component(number)
        size = len(part.vertices if isinstance(part, Mesh) else part.points)
        try:
            found = strategy(part, min(1.0, size / sum(sizes)), own)
        except (InputError, RuntimeError) as error:
            if number < len(parts):
                raise
            logger.warning("%d points stay without a map: %s", size, error)
            continue
        made.append(found)
        if own is not session and own.checkpoint is not None and own.checkpoint.is_dir():
            own.checkpoint.rmdir()
        if whole and isinstance(part, PointCloud) and (left := _left_of(part, found)):
            logger.warning(
                "these make %d further component%s: each is fitted",
                len(left),
                "s" * (len(left) > 1),
            )
            waiting += left
    return made[0] if len(made) == 1 else side_by_side(made)


def _left_of(part: PointCloud, found: Fitted) -> list[Surface]:
    """The parts that the points of a cloud make which are not on the surface that was found."""
    if len(found.missed) < FEWEST:
        return []
    near, away = (cKDTree(of).query(part.points)[0] for of in (found.points, found.missed))
    left = components(part.chosen(away < near))
    return [one for one in left if isinstance(one, PointCloud) and len(one.points) >= FEWEST]


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
    for name in ("iterations", "anchors", "missed", "divergences"):
        if name in report:
            report[name] = sum(int(str(of[name])) for of in reports)
    if "start" in report:
        report["start"] = ", ".join(dict.fromkeys(str(of["start"]) for of in reports))
    return Fitted(whole, IDENTITY, points, parts[0].trace, report)
