"""The computed map: a flat map of a bare cloud, computed without training."""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from parapoint import clock
from parapoint.computed.flattening import FlatMap, Say, flat_map
from parapoint.computed.interpolation import Anchors, InterpolatedMap
from parapoint.computed.parts import DISTORTIONS, Distortion
from parapoint.computed.reconstruction import ReconstructionError
from parapoint.estimator import Estimator
from parapoint.fitting import Fitted, Progress, Session
from parapoint.parameters import LARGEST_SEED, check_choice, check_whole
from parapoint.surfaces.components import FEWEST
from parapoint.surfaces.frame import Frame
from parapoint.surfaces.normals import are_outer
from parapoint.surfaces.sampling import (
    COINCIDENT,
    FEWEST_POINTS,
    training_points,
    without_coincident,
)
from parapoint.surfaces.strays import named
from parapoint.surfaces.surface import BoolArray, FloatArray, PointCloud, Surface, unit_normals

logger = logging.getLogger("parapoint")

TRIAL_PER_SECOND = 50
"""Points of a first, small map for each second of the time budget. It takes about a twentieth of
the budget at the 1,000 points a second of one idle core, and is what there is on a busy machine."""
PLANNED = 0.55
"""Share of the time left in which the second map would be done at the speed of the first. On seven
models three times as many points took 0.8 to 1.6 times as long each."""
EACH = "; --components each maps parts that stand apart"
"""What is said where as many points are missed as a part of its own has."""
DESCENDING = 0.8
"""Share of the time budget after which a map is improved no more."""


@dataclass(repr=False)
class ComputedMap(Estimator):
    """A free-boundary UV map of a bare point cloud, computed without training.

    Ours, and not the paper's method: no network takes part. The cloud is triangulated
    (`parapoint.computed.reconstruction`), cut open along short seams and flattened one to one
    (`parapoint.computed.flattening`), and every part keeps its area (`parapoint.computed.parts`);
    the map of any other point is interpolated
    between those of the fitted points (`parapoint.computed.interpolation`). docs/COMPUTED.md has
    the experiments behind it.

        >>> import numpy as np
        >>> from parapoint import ComputedMap
        >>> points = np.random.default_rng(0).normal(size=(2000, 3))
        >>> points /= np.linalg.norm(points, axis=1, keepdims=True)
        >>> model = ComputedMap().fit(points)
        >>> uv = model.transform(points)                  # (2000, 2)
        >>> cut = points[model.seams()]                   # the points where the surface is open

    Attributes:
        points: the most points that the map is computed on.
        distortion: "conformal" keeps angles, whatever becomes of an ear or a finger; "balanced"
            keeps them as far as every part keeps its area, along longer seams where need be;
            "isometric" keeps angles and areas alike.
        time_budget: seconds of work (`parapoint.clock`) that a fit may take; the number of points
            follows the machine's speed. None takes as long as it takes.
        components: "together", one map of the whole surface; "each", one of each component, side by
            side in the plane; "largest", one of the largest alone, which then holds for all points.
        seed: of the draw of points.
    """

    packages: ClassVar[tuple[str, ...]] = ("libigl", "scipy", "shapely")

    points: int = 20_000
    distortion: Distortion = "balanced"
    time_budget: float | None = None
    components: str = "together"
    seed: int = 0

    @property
    def deterministic(self) -> bool:
        """Whether the same seed gives the same map: not where time decides the number of points."""
        return self.time_budget is None

    def check(self) -> None:
        """See `Estimator`."""
        super().check()
        check_whole("points", self.points, FEWEST_POINTS, LARGEST_SEED)
        check_choice("distortion", self.distortion, DISTORTIONS)

    def fit_part(self, surface: Surface, share: float, session: Session) -> Fitted:
        """See `parapoint.fitting.Strategy`.

        Raises:
            ReconstructionError: the points show no surface that can be followed and flattened.
        """
        begun = clock.worked()
        count = max(FEWEST_POINTS, round(self.points * share))
        budget = None if self.time_budget is None else self.time_budget * share
        deadline = math.inf if budget is None else begun + DESCENDING * budget

        def say(phase: str) -> None:
            left = None if budget is None else max(0.0, begun + budget - clock.worked())
            session.tell(Progress(phase, remaining=left))

        if budget is None:
            drawn = _computed(surface, count, self, deadline, say)
        else:
            few = min(count, max(FEWEST_POINTS, round(TRIAL_PER_SECOND * budget)))
            drawn = _computed_within(surface, few, count, self, deadline, say=say)
        flat, cloud = _outer_side_up(drawn.flat, drawn, surface), drawn.cloud
        if len(flat.missed):
            logger.warning(
                "%d of %d points are not on the surface that was found%s%s",
                len(flat.missed),
                len(cloud),
                _rows_of(cloud[flat.missed], drawn.frame, surface),
                EACH if len(flat.missed) >= FEWEST and self.components != "each" else "",
            )
        cut_short = clock.worked() > deadline
        if cut_short:
            logger.warning(
                "the time was up before the map was at its best; it is of %d points", len(cloud)
            )
        anchors = Anchors(cloud[flat.anchors], flat.uv, flat.jacobians)
        held = InterpolatedMap.of(anchors, flat.inverse_jacobians, flat.charted)
        report: dict[str, object] = {
            "points": len(drawn.points),
            "anchors": len(flat.anchors),
            "missed": len(flat.missed),
            "found": flat.facts,
            "cut_short": cut_short,
            "seconds": round(clock.worked() - begun, 3),
        }
        is_on = _is_on_surface(drawn)
        on, off = drawn.points[is_on], drawn.points[~is_on]
        return Fitted(held, drawn.frame, on, (), report, off)


class _Drawn(NamedTuple):
    """Points drawn of a surface, and the map that was computed on them.

    Attributes:
        points: (n, 3) in the surface's unit.
        frame: of these.
        cloud: (m, 3) the points in the frame, none twice.
        flat: the map of `cloud`.
    """

    points: FloatArray
    frame: Frame
    cloud: FloatArray
    flat: FlatMap


def _is_on_surface(drawn: _Drawn) -> BoolArray:
    """(n,) whether each of the drawn points is on the surface that was found."""
    if len(drawn.flat.missed) == 0:
        return np.ones(len(drawn.points), dtype=bool)
    missed = cKDTree(drawn.cloud[drawn.flat.missed])
    return np.asarray(missed.query(drawn.frame.inside(drawn.points))[0] > COINCIDENT)


def _rows_of(missing: FloatArray, frame: Frame, surface: Surface) -> str:
    """The rows of a cloud in which these points (n, 3) of the frame are, for a message."""
    if not isinstance(surface, PointCloud):
        return ""
    nearest = cKDTree(surface.points).query(frame.outside(missing))[1]
    rows = surface.rows_of(np.unique(nearest))
    return f": row{'s' * (len(rows) > 1)} {named(rows)}"


def _outer_side_up(flat: FlatMap, drawn: _Drawn, surface: Surface) -> FlatMap:
    """The map as seen from the outer side of the surface."""
    mesh = flat.charted.mesh
    at = drawn.frame.outside(mesh.vertices[mesh.faces].mean(axis=1))
    normals = mesh.face_areas[:, None] * unit_normals(mesh.vertices, mesh.faces)
    return flat if are_outer(surface, at, normals) else flat.turned()


def _computed(surface: Surface, count: int, of: ComputedMap, deadline: float, say: Say) -> _Drawn:
    """The map of at most `count` points of a surface."""
    points = training_points(surface, count, of.seed)
    frame = Frame.of(points)
    cloud = without_coincident(frame.inside(points))
    return _Drawn(points, frame, cloud, flat_map(cloud, deadline, of.distortion, say))


def _computed_within(
    surface: Surface, few: int, most: int, of: ComputedMap, deadline: float, *, say: Say
) -> _Drawn:
    """The map of as many points, up to `most`, as the time up to `deadline` allows.

    A map of `few` points comes first. It tells how fast this machine is on this surface, and it
    stays where the second map fails, or is cut short and worse.
    """
    before = clock.worked()
    first: _Drawn | None = None
    try:
        first = _computed(surface, few, of, deadline, say)
    except ReconstructionError as error:
        fault = error
    now = clock.worked()
    affordable = round(few * PLANNED * (deadline - now) / max(now - before, 1e-9))
    count = min(most, affordable)
    # Where the surface has no more points than the first map took, there is nothing to add.
    if count > few and (first is None or len(first.points) == few):
        try:
            second = _computed(surface, count, of, deadline, say)
        except ReconstructionError as error:
            logger.warning("no map of %d points could be computed: %s", count, error)
            fault = error
        else:
            is_whole = clock.worked() < deadline
            # Of two that are as good as exact the one of more points stays.
            if (
                first is None
                or is_whole
                or _conformality(second.flat) > _conformality(first.flat) - 1e-6
            ):
                return second
    if first is None:
        raise fault
    return first


def _conformality(flat: FlatMap) -> float:
    """Mean ratio of the singular values of the map's Jacobians, 1 where it keeps all angles."""
    values = np.linalg.svd(flat.jacobians, compute_uv=False)
    return float((values[:, 1] / np.maximum(values[:, 0], 1e-300)).mean())
