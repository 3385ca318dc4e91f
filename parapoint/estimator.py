"""Estimators as a user meets them: fit a surface, map points to the plane and back, find seams."""

from __future__ import annotations

import dataclasses
import importlib
import logging
from abc import ABC, abstractmethod
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
import numpy.typing as npt

from parapoint import saving
from parapoint.errors import InputError, NotFittedError
from parapoint.fitting import Fitted, Progress, Session, SurfaceMap
from parapoint.parameters import (
    LARGEST_SEED,
    LONGEST_SECONDS,
    check_choice,
    check_number,
    check_whole,
)
from parapoint.side_by_side import SideBySide, fitted_side_by_side
from parapoint.surfaces.components import COMPONENTS, parts_of
from parapoint.surfaces.dimension import checked_dimension
from parapoint.surfaces.foreign import surface_or_array
from parapoint.surfaces.frame import Frame
from parapoint.surfaces.gridding import gridded
from parapoint.surfaces.parameterization import (
    Charted,
    Parameterization,
    PointParameterization,
    TracePoint,
)
from parapoint.surfaces.seam_points import seam_points
from parapoint.surfaces.strays import far_from, fitted_rows, unmapped
from parapoint.surfaces.surface import BoolArray, FloatArray, Mesh, PointCloud, Surface

if TYPE_CHECKING:
    from matplotlib.figure import Figure

logger = logging.getLogger("parapoint")

MOST_WATCHED = 50_000
"""Maps along the way are kept of surfaces of at most this many points."""
ESTIMATORS = {
    "ComputedMap": "parapoint.computed.computed_map",
    "ParaPoint": "parapoint.learned.parapoint",
}
"""The module of each estimator that a saved model may be of."""


class Estimator(ABC):
    """What all estimators of this package share; a subclass is a dataclass with its own strategy.

    Follows scikit-learn: fields are parameters, and what `fit` finds ends in an underscore. An
    estimator is a `Method` too: `parameterize` fits a copy to a surface and maps it.

    Attributes:
        components: see `parapoint.surfaces.components.COMPONENTS`.
        seed: of every random draw.
        time_budget: seconds of work (`parapoint.clock`) that a fit may take, or None.
        points_: (n, 3) the points that the map was fitted to.
        frame_: where they lie as the map sees them.
        map_: the map in that frame; `transform` and `inverse_transform` use it.
        trace_: states on the way, where there were any.
        report_: settings, what was found, time, rows left out.
    """

    requires: ClassVar[frozenset[str]] = frozenset()

    components: str
    seed: int
    time_budget: float | None

    @property
    @abstractmethod
    def deterministic(self) -> bool:
        """Whether the same seed gives the same map."""

    @abstractmethod
    def fit_part(self, surface: Surface, share: float, session: Session) -> Fitted:
        """The map of one part of a surface; see `parapoint.fitting.Strategy`."""

    def __repr__(self) -> str:
        """The estimator with the parameters that differ from their defaults."""
        given = (
            f"{field.name}={getattr(self, field.name)!r}"
            for field in dataclasses.fields(self)  # type: ignore[arg-type]  # a subclass is a dataclass
            if getattr(self, field.name) != field.default
        )
        return f"{type(self).__name__}({', '.join(given)})"

    def _repr_html_(self) -> str:
        """The estimator as a notebook shows it: with a picture of its map, once it is fitted."""
        from parapoint.picturing import html

        return html(repr(self), self.mesh() if self.__sklearn_is_fitted__() else None)

    def __sklearn_tags__(self) -> Any:
        """What scikit-learn, which alone calls this, has to know: this transforms points."""
        from sklearn.utils import Tags, TargetTags, TransformerTags

        return Tags("transformer", TargetTags(required=False), TransformerTags())

    def __sklearn_is_fitted__(self) -> bool:
        """Whether there is a map."""
        return "fitted_" in vars(self)

    def plot(self) -> Figure:
        """A figure of matplotlib: the surface and its map, in the same colours, seams in black.

        Raises:
            NotFittedError: nothing is fitted.
            InputError: matplotlib is not installed.
        """
        from parapoint.picturing import figure

        points = self.points_
        return figure(points, self.transform(points), self.seams())

    def check(self) -> None:
        """Check the parameters.

        Raises:
            InputError: one is not as its docstring says.
        """
        check_choice("components", self.components, COMPONENTS)
        check_whole("seed", self.seed, 0, LARGEST_SEED)
        if self.time_budget is not None:
            check_number("time_budget", self.time_budget, most=LONGEST_SECONDS, above=True)

    def get_params(self, deep: bool = True) -> dict[str, Any]:  # noqa: ARG002 (scikit-learn's name)
        """The parameters by name."""
        return {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}  # type: ignore[arg-type]  # a subclass is a dataclass

    def set_params(self, **parameters: Any) -> Self:
        """Set parameters by name.

        Raises:
            InputError: there is no such parameter.
        """
        known = self.get_params()
        for name, value in parameters.items():
            if name not in known:
                raise InputError(f"no parameter {name!r}; there are: {', '.join(known)}")
            setattr(self, name, value)
        return self

    def fit(
        self,
        points: npt.ArrayLike | Surface,
        y: None = None,  # noqa: ARG002 (scikit-learn's pipelines pass it)
        *,
        checkpoint: str | Path | None = None,
        callback: Callable[[Progress], None] | None = None,
    ) -> Self:
        """Find the map of a surface.

        Args:
            points: (N, 3) coordinates, a PointCloud, or a Mesh (its vertices, and points on its
                faces where those do not show its shape); or what other libraries have for these
                (`parapoint.surfaces.foreign`). Rows that are not finite, or stray
                (`parapoint.surfaces.strays`), are left out, repeated ones
                count once; `report_` has the numbers. Units are free.
            y: not used.
            checkpoint: folder where the state of a training is saved each minute. A fit that finds
                the state of the same run there goes on from it, and removes it at the end.
            callback: called with each `Progress`.

        Raises:
            InputError: a parameter is not as said, there are fewer than 100 distinct points, or
                they lie along a curve, or farther apart than a number can say; the checkpoint is of
                another run or version.
            RuntimeError: the strategy failed: `ReconstructionError` of `ComputedMap`,
                `DivergedError` of `ParaPoint`.
        """
        folder = None if checkpoint is None else Path(checkpoint)
        session = Session(checkpoint=folder)
        if callback is not None:
            session = dataclasses.replace(session, tell=callback)
        return self._fit(points, session)

    def _fit(self, points: npt.ArrayLike | Surface, session: Session) -> Self:
        self.check()
        surface, left_out = fitted_rows(surface_or_array(points))
        shape = checked_dimension(surface)
        parts = parts_of(surface, self.components)
        fitted = fitted_side_by_side(self.fit_part, parts, session, whole=self.components == "each")
        self.fitted_ = dataclasses.replace(fitted, report=fitted.report | left_out | shape)
        return self

    @property
    def points_(self) -> FloatArray:
        """(n, 3) the points that the map was fitted to."""
        return self._known().points

    @property
    def frame_(self) -> Frame:
        """Where the surface lies as the map sees it."""
        return self._known().frame

    @property
    def map_(self) -> SurfaceMap:
        """The map, in the frame."""
        return self._known().map

    @property
    def trace_(self) -> tuple[TracePoint, ...]:
        """States on the way, where there were any."""
        return self._known().trace

    @property
    def report_(self) -> dict[str, object]:
        """Settings, what was found, time, rows left out."""
        return self._known().report

    def _known(self) -> Fitted:
        if "fitted_" not in vars(self):
            raise NotFittedError("this model is not fitted; call fit or load first")
        return self.fitted_

    def transform(self, points: npt.ArrayLike | Surface) -> FloatArray:
        """(N, 2) coordinates in the plane of (N, 3) points on the surface, in the points' unit.

        Any number of points: they are mapped in batches, which bounds the memory. Rows of points
        that lie far from the surface (`parapoint.surfaces.strays.far_from`) are NaN.

        Raises:
            InputError: the points have another shape or are not finite, or nothing is fitted.
        """
        at, fitted = coordinates(points, 3), self._known()
        is_far = far_from(fitted.points, at)
        if not is_far.any():
            return fitted.flatten(at)
        uv = np.full((len(at), 2), np.nan)
        uv[~is_far] = fitted.flatten(at[~is_far])
        return uv

    def fit_transform(self, points: npt.ArrayLike | Surface, y: None = None) -> FloatArray:
        """Fit to points, and map the same ones; see `fit` and `transform`."""
        return self.fit(points, y).transform(points)

    def inverse_transform(self, uv: npt.ArrayLike) -> FloatArray:
        """(N, 3) points on the surface at (N, 2) coordinates of `transform`.

        Raises:
            InputError: the coordinates have another shape or are not finite, or nothing is fitted.
        """
        return self._known().lift(coordinates(uv, 2))

    def mesh(self) -> Charted:
        """The surface that the map describes, as a mesh with a map, both in the points' unit.

        The triangulation that the map was computed on, where it was; otherwise a grid in the plane,
        carried to the surface by `inverse_transform` (`parapoint.surfaces.gridding`).

        Raises:
            InputError: nothing is fitted.
        """
        fitted = self._known()
        if (held := fitted.charted()) is not None:
            return held
        return gridded(fitted.flatten(fitted.points), fitted.lift)

    def charted(self, surface: Surface, *, seed: int) -> Charted:
        """The mesh and map of a copy of this estimator that is fitted to a surface.

        Raises:
            InputError, RuntimeError: see `fit`.
        """
        return dataclasses.replace(self, seed=seed).fit(surface).mesh()  # type: ignore[type-var]  # a subclass is a dataclass

    def seams(
        self, points: npt.ArrayLike | Surface | None = None, *, rule: str = "stretch"
    ) -> BoolArray:
        """(N,) whether each point lies on a cutting seam; see `parapoint.surfaces.seam_points`.

        Args:
            points: (N, 3) points; the fitted points by default.
            rule: "stretch", which holds at any density, or "paper", for the paper's 10,000 points.

        Raises:
            InputError: the points are not as said, fewer than four, or nothing is fitted; there is
                no such rule.
        """
        at = self.points_ if points is None else coordinates(points, 3)
        return seam_points(at, self._known().flatten(at), rule)

    def parameterize(
        self, surface: Surface, *, seed: int
    ) -> Parameterization | PointParameterization:
        """Fit a copy of this estimator to a surface and map it; see `Method`.

        A mesh gets one uv for each vertex, so faces across a seam span it. The trace of a training
        has its losses and some maps along the way.

        Raises:
            InputError, RuntimeError: see `fit`.
        """
        model = dataclasses.replace(self, seed=seed)  # type: ignore[type-var]  # a subclass is a dataclass
        at = coordinates(surface, 3)
        model._fit(surface, Session(watched=at if len(at) <= MOST_WATCHED else None))  # noqa: SLF001 (a copy of this one)
        if isinstance(surface, Mesh):
            uv = model.fitted_.flatten(at)
            return Parameterization(uv, surface.faces, model.trace_, model.report_)
        uv = unmapped(surface, model.transform(at))
        return PointParameterization(uv, model.trace_, model.report_)

    def save(self, folder: str | Path) -> None:
        """Write the fitted model to `folder`: `model.json` and the arrays that it names.

        Raises:
            InputError: nothing is fitted, or something else is in the way.
        """
        fitted = self._known()
        saving.check_free(Path(folder), "model")
        facts = {
            "estimator": type(self).__name__,
            "parameters": self.get_params(),
            "map": type(fitted.map).__name__,
            "map_facts": fitted.map.facts(),
            "centre": fitted.frame.centre.tolist(),
            "scale": fitted.frame.scale,
            "report": fitted.report,
            "trace": [[t.iteration, t.seconds, dict(t.values)] for t in fitted.trace],
        }
        arrays = {"fitted": fitted.points}
        arrays |= {f"map.{name}": array for name, array in fitted.map.arrays().items()}
        saving.write(Path(folder), "model", arrays, facts)

    @classmethod
    def load(cls, folder: str | Path, *, device: str = "auto") -> Self:
        """The model that `save` wrote to `folder`; `load` reads a model of any estimator.

        Raises:
            InputError: there is none, it is damaged, or of another version of the format, or of
                another estimator.
        """
        model = load(folder, device=device)
        if not isinstance(model, cls):
            raise InputError(f"{folder}: holds a {type(model).__name__}, not a {cls.__name__}")
        return model


def load(folder: str | Path, *, device: str = "auto") -> Estimator:
    """The model that `Estimator.save` wrote to `folder`.

    Args:
        folder: where it lies.
        device: "auto", "cpu" or "cuda", for trained networks.

    Raises:
        InputError: there is none, it is damaged, or of another version of the format; there is no
            such device.
    """
    check_choice("device", device, ("auto", "cpu", "cuda"))
    arrays, facts = saving.read(Path(folder), "model")
    with saving.damage_of(Path(folder)):
        name = facts["estimator"]
        if name not in ESTIMATORS:
            raise InputError(f"{folder}: damaged: there is no estimator {name!r}")
        kind = getattr(importlib.import_module(ESTIMATORS[name]), name)
        parameters = dict(facts["parameters"])
        if "device" in parameters:
            parameters["device"] = device
        model: Estimator = kind(**parameters)
        model.check()
        points = coordinates(arrays.pop("fitted"), 3)
        held = {name.removeprefix("map."): array for name, array in arrays.items()}
        restored = restored_map(facts["map"], held, facts["map_facts"], device)
        frame = Frame(np.array(facts["centre"]), float(facts["scale"]))
        trace = tuple(TracePoint(*row) for row in facts["trace"])
        model.fitted_ = Fitted(restored, frame, points, trace, dict(facts["report"]))
        return model


def restored_map(
    kind: str, arrays: dict[str, np.ndarray], facts: dict[str, Any], device: str
) -> SurfaceMap:
    """The map of which `arrays` and `facts` were saved.

    Raises:
        InputError: there is no such kind of map.
        KeyError, ValueError: something is missing or does not fit.
    """
    if kind == "InterpolatedMap":
        from parapoint.computed.interpolation import InterpolatedMap

        return InterpolatedMap.restored(arrays)
    if kind == "TrainedMap":
        from parapoint.learned.trained_map import TrainedMap

        return TrainedMap.restored(arrays, facts, device)
    if kind == "SideBySide":
        maps, frames = [], []
        for k, of in enumerate(facts["components"]):
            prefix = f"component{k}."
            own = {n.removeprefix(prefix): a for n, a in arrays.items() if n.startswith(prefix)}
            maps.append(restored_map(of["map"], own, of["facts"], device))
            frames.append(Frame(np.array(of["centre"]), float(of["scale"])))
        names = ("points", "label", "shift", "low", "high")
        return SideBySide(maps, frames, *(arrays[name] for name in names))
    raise InputError(f"there is no map of the kind {kind!r}")


def coordinates(values: npt.ArrayLike | Surface, columns: int) -> FloatArray:
    """The (N, columns) finite coordinates of a surface or an array.

    Raises:
        InputError: the array has another shape, or a value is not finite.
    """
    given = surface_or_array(values)
    if isinstance(given, Mesh):
        return given.vertices
    if isinstance(given, PointCloud):
        return given.points
    try:
        array = given.astype(np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"coordinates must be numbers: {error}") from None
    if array.ndim != 2 or array.shape[1] != columns or not np.isfinite(array).all():
        raise InputError(f"coordinates must be finite and of shape (n, {columns})")
    return array
