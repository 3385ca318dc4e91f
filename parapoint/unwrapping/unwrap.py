"""A mesh unwrapped: one chart a component, cut along a clean path of edges, one to one."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar

import numpy as np

from parapoint import clock
from parapoint.computed.computed_map import ComputedMap
from parapoint.computed.faces import is_even, map_of_faces
from parapoint.computed.parts import DISTORTIONS, towards_conformal
from parapoint.computed.reconstruction import ReconstructionError
from parapoint.errors import InputError
from parapoint.messages import unsaid
from parapoint.method import UnsupportedError
from parapoint.parameters import LONGEST_SECONDS, check_choice, check_number
from parapoint.planar.coarse import COARSE, LARGE, Led, led
from parapoint.planar.descent import LEAST_ENERGY, Run, sound
from parapoint.planar.domains import FlatteningError
from parapoint.planar.embedding import embeddable
from parapoint.planar.growth import PRICE, Need, grown
from parapoint.planar.scaffold import of_area_one
from parapoint.surfaces.across_seams import learned_seam
from parapoint.surfaces.areas import LEAST_PART
from parapoint.surfaces.cutting import cut_along, disk_cut
from parapoint.surfaces.lids import lid_cut
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.preparation import LEAST_TIME, prepared
from parapoint.surfaces.sampling import FEWEST_VERTICES
from parapoint.surfaces.surface import BoolArray, FloatArray, Mesh, Surface

POINTS_OF_A_FACE, ENOUGH_POINTS = 100, 6_000
"""Points that are sampled of a mesh: so many on each face, and so many at most."""
STEPPING = 0.9
"""Share of a time budget after which no step begins: the last one takes time, too."""
SHARE_OF_SEAM = 0.5
"""Share of the time left in which the computed map, which tells the seam, is to be ready."""

Start = Callable[[float], tuple[BoolArray, dict[str, object]]]
"""Gives the edges (E,) to be cut at first, by a time of `clock.worked`, and what told them."""


@dataclass(frozen=True, eq=False)
class Begun:
    """A mesh cut open along a start, and the map that tells how good this start is.

    Attributes:
        seam: (E,) the edges of the mesh that were cut at first.
        told: what told where.
        run: the map.
        led: the large mesh, where the map is that of its simplified one; otherwise None.
    """

    seam: BoolArray
    told: dict[str, object]
    run: Run
    led: Led | None


@dataclass(frozen=True)
class Unwrap:
    """An isometric map of the mesh, cut along a clean path of edges; no flips, one to one.

    The symmetric Dirichlet energy is brought down from Tutte's embedding, or from the conformal
    layout of a surface that unrolls (`parapoint.planar.unrolling`); the boundary never crosses
    itself (`parapoint.planar.scaffold`). Then the seam grows to where the map is most distorted
    (`parapoint.planar.growth`), as long as that pays, or until a bound on the energy is met, and on
    until hardly a place is starved of area.

    A mesh is begun along the least cut, none for a disk, with or without holes, and the automatic
    one (`parapoint.surfaces.cutting`) for others; along cuts from rim to rim, if it is a disk with
    holes; around a large side between creases, if it has one (`parapoint.surfaces.lids`); and along
    the seam of the computed map of its faces (`parapoint.computed.faces`), or of points of it where
    these are slender, made a clean path of edges (`parapoint.surfaces.across_seams`). The best map
    stays, by its energy and the price of its seam: which start leads to it cannot be told before.
    Where the map must come below a bound on the energy, it is begun along the map of points, too,
    and the shortest stays.
    Of a large mesh a simplified one tells which start is the better, and where the seam grows to
    (`parapoint.planar.coarse`), but under a bound, as the two differ in energy.
    Components are mapped one after another.

    Attributes:
        time_budget: seconds of work (`parapoint.clock`), which components share by their faces, or
            None for no bound. No step begins after that; the map is then as good as it has become.
        price: what the symmetric Dirichlet energy (4 at least) must fall by for each sqrt(area) of
            seam; None for the seam of the computed map, no shorter and no longer. Under a bound on
            the energy it is not asked.
        max_distortion: symmetric Dirichlet energy, above 4, down to which the seam grows and no
            longer; None for no such bound. The report has the energy that was reached.
        distortion: "isometric" weighs angles and areas alike, as the energy does; "balanced" goes
            on from there to keep angles as far as every part keeps its area; "conformal" keeps
            angles along the seam of the computed map, whatever becomes of an ear or a finger.
    """

    time_budget: float | None = None
    price: float | None = PRICE
    max_distortion: float | None = None
    distortion: str = "isometric"

    requires: ClassVar[frozenset[str]] = frozenset({"faces", "manifold", "oriented", "connected"})
    packages: ClassVar[tuple[str, ...]] = ("libigl", "scipy", "shapely")

    def __post_init__(self) -> None:
        if self.price is not None:
            check_number("price", self.price)
        if self.time_budget is not None:
            check_number("time_budget", self.time_budget, most=LONGEST_SECONDS, above=True)
        if self.max_distortion is not None:
            check_number("max_distortion", self.max_distortion, LEAST_ENERGY, above=True)
        check_choice("distortion", self.distortion, DISTORTIONS)
        if self.max_distortion is not None and self.distortion != "isometric":
            raise InputError(
                f"max_distortion bounds an energy that distortion {self.distortion} gives up for "
                f"angles: leave one of them out"
            )

    @property
    def deterministic(self) -> bool:
        """Whether the same seed gives the same map: a clock decides nothing."""
        return self.time_budget is None

    def unwrapped(self, mesh: Mesh, *, seed: int = 0) -> Parameterization:
        """The map of any mesh: each component by itself, the time budget shared by their faces.

        Vertices at one place count as one, so that no seam of an older map is left in the mesh.

        Args:
            mesh: what is no manifold or oriented is opened (`parapoint.surfaces.preparation`).
            seed: of every random draw.

        Raises:
            UnsupportedError: no face has an area.
            FlatteningError: no start without flips was found.
        """
        preparation = prepared(mesh.welded, self.requires)
        maps = preparation.maps(self, seed)
        joined = preparation.joined(maps)
        assert isinstance(joined, Parameterization)
        report = {"parts": [dict(of.report) for of in maps], "steps": preparation.steps}
        return Parameterization(joined.uv, joined.corners, report=report)

    def parameterize(self, surface: Surface, *, seed: int) -> Parameterization:
        """The map, in the scale of the surface.

        Raises:
            UnsupportedError: the surface is a point cloud.
            InputError: a triangle has no area.
            FlatteningError: no start without flips was found.
        """
        if not isinstance(surface, Mesh):
            raise UnsupportedError("needs faces; the surface is a point cloud")
        mesh = sound(surface)
        deadline = math.inf
        if self.time_budget is not None:
            deadline = clock.worked() + STEPPING * self.time_budget
        begun = self._begun(mesh, seed, deadline)
        run = begun.run
        run.deadline = deadline
        if self._grows:
            run.improve()
        self._keep_angles(run)
        report = {
            **run.report(),
            "first_cut_edges": int(begun.seam.sum()),
            "computed": begun.told,
        }
        return Parameterization(run.uv, run.mesh.faces, report=report)

    @property
    def _grows(self) -> bool:
        """Whether the seam is led on to where the map is most distorted."""
        is_asked = self.price is not None or self.max_distortion is not None
        return is_asked and self.distortion != "conformal"

    @property
    def _need(self) -> Need:
        """What the seam is to bring."""
        if self.max_distortion is not None:
            return Need(math.inf, most_energy=self.max_distortion)
        return Need(PRICE if self.price is None else self.price)

    def _begun(self, mesh: Mesh, seed: int, deadline: float) -> Begun:
        """The best of the maps grown from all starts.

        A start begins only where as much time is left as another has taken. One that needs no cut
        is the last: no other can be shorter. Under a bound, where one may take all the time that
        there is, they share it.

        Raises:
            FlatteningError: no start has a map without flips.
        """
        starts = self._starts(mesh, seed)
        found: list[Begun] = []
        longest, fault = 0.0, FlatteningError("no start without flips was found")
        for number, start in enumerate(starts):
            before = clock.worked()
            if found and before + longest > deadline:
                break
            share = len(starts) - number if self.max_distortion is not None else 1
            until = before + (deadline - before) / share
            try:
                one = self._tried(mesh, start, until)
            except FlatteningError as error:  # such as too thin for a start: others are cut
                fault = error
                continue
            found.append(one)
            ahead = 1.0 if one.led is None else len(mesh.faces) / COARSE
            longest = max(longest, ahead * (clock.worked() - before))
            if not (one.seam.any() or one.run.branches or self._need.of(one.run)):
                break
        for one in sorted(found, key=lambda one: self._cost(one.run)):
            try:
                return self._whole(one, deadline)
            except FlatteningError as error:
                fault = error
        raise fault

    def _starts(self, mesh: Mesh, seed: int) -> list[Start]:
        """The ways to begin, those that take less time first."""

        def least(_: float) -> tuple[BoolArray, dict[str, object]]:
            return _least_cut(mesh), {"not_asked": "the map begins along the least cut"}

        def across_rims(_: float) -> tuple[BoolArray, dict[str, object]]:
            return disk_cut(mesh), {"not_asked": "the map begins along cuts from rim to rim"}

        def along_faces(until: float) -> tuple[BoolArray, dict[str, object]]:
            return _seam(mesh, partial(map_of_faces, mesh), until)

        def along_points(until: float) -> tuple[BoolArray, dict[str, object]]:
            return _seam(mesh, partial(_map_of_points, mesh, seed), until)

        along_map = along_faces if is_even(mesh) else along_points
        if not self._grows:
            return [along_map]
        lid = lid_cut(mesh)

        def around_lid(_: float) -> tuple[BoolArray, dict[str, object]]:
            return lid, {"not_asked": "the map begins with a side opened like a lid"}

        is_bounded = self.max_distortion is not None
        has_rims = mesh.is_planar_domain and len(mesh.boundary_loops) > 1
        first = [*[around_lid] * bool(lid.any()), least, *[across_rims] * has_rims]
        starts = [*first, along_map, *[along_points] * is_bounded]
        return list(dict.fromkeys(starts))

    def _cost(self, run: Run) -> tuple[bool, float]:
        """By which of two maps is worse: one that lacks something, or costs more."""
        if self.max_distortion is not None:
            return self._need.of(run), run.rim
        price = PRICE if self.price is None else self.price
        return self._need.of(run), run.energy + price * run.rim / (2 * run.unit)

    def _tried(self, mesh: Mesh, start: Start, deadline: float) -> Begun:
        """The mesh cut open along a start, and its map, or that of a simplified mesh.

        Raises:
            FlatteningError: it has no map without flips.
        """
        seam, told = start(deadline)
        domain = cut_along(mesh, mesh.edges[seam])
        if self._is_led(mesh):
            guess = led(embeddable(domain), self._need, deadline)
            if guess is not None:
                return Begun(seam, told, guess.run, guess)
        run = _settled(domain, (), deadline)
        if self._grows and (not self._is_led(mesh) or self._need.of(run)):
            run = grown(run, self._need)
        return Begun(seam, told, run, None)

    def _whole(self, begun: Begun, deadline: float) -> Begun:
        """The map of the whole mesh, where that of a simplified one has told how good a start is.

        Raises:
            FlatteningError: it has no map without flips.
        """
        if begun.led is None:
            return begun
        run = _settled(begun.led.domain, begun.led.tips, deadline)
        if self._need.of(run):
            run = grown(run, self._need)
        return Begun(begun.seam, begun.told, run, None)

    def _is_led(self, mesh: Mesh) -> bool:
        """Whether a simplified mesh tells where the seam grows to."""
        return self._grows and self.max_distortion is None and len(mesh.faces) > LARGE

    def _keep_angles(self, run: Run) -> None:
        """Move the map down the conformal energy as far as `distortion` says."""
        if self.distortion == "isometric":
            return
        most_starved = 1.0 if self.distortion == "conformal" else LEAST_PART
        unit = of_area_one(run.mesh.vertices, run.mesh.faces)
        uv = towards_conformal(unit, run.uv / run.unit, run.deadline, most_starved)
        run.take(run.unit * uv, run.start)


def _settled(domain: Mesh, tips: tuple[int, ...], deadline: float) -> Run:
    """The settled map of a planar domain, to whose `tips` branches of its seam have grown.

    Raises:
        FlatteningError: it has no map without flips.
    """
    run = _started(domain, deadline)
    run.tips = tips
    run.improve()
    return run


def _started(domain: Mesh, deadline: float) -> Run:
    """The map that a descent begins with: of the domain, or of one that gives Tutte's more room.

    Raises:
        FlatteningError: neither has a map without flips.
    """
    found: list[Run] = []
    fault = FlatteningError("no start without flips was found")
    for mesh in dict.fromkeys([domain, embeddable(domain)]):
        run = Run(mesh, deadline)
        try:
            run.begin()
        except FlatteningError as error:
            fault = error
            continue
        found.append(run)
    if not found:
        raise fault
    return min(found, key=lambda run: run.energy)


def _seam(
    mesh: Mesh, computed: Callable[[float], tuple[FloatArray, dict[str, Any]]], deadline: float
) -> tuple[BoolArray, dict[str, object]]:
    """(E,) the edges along the seam of a map that is `computed`, and what is known of that map.

    Where no map can be computed they are those of the automatic cut.
    """
    begun = clock.worked()
    try:
        uv, facts = computed(begun + SHARE_OF_SEAM * (deadline - begun))
    except (InputError, ReconstructionError) as error:  # such as points along a curve
        return _least_cut(mesh), {"failed": str(error)}
    return learned_seam(mesh, uv), facts


def _least_cut(mesh: Mesh) -> BoolArray:
    """(E,) the edges of the automatic cut to a disk; none where the mesh is a planar domain."""
    return np.zeros(len(mesh.edges), dtype=bool) if mesh.is_planar_domain else disk_cut(mesh)


def _map_of_points(mesh: Mesh, seed: int, deadline: float) -> tuple[FloatArray, dict[str, Any]]:
    """(V, 2) the conformal `ComputedMap` of points of a mesh, at its vertices, and its report.

    Raises:
        ReconstructionError: the points show no surface that can be followed.
        InputError: they lie along a curve, or there are too few.
    """
    points = min(ENOUGH_POINTS, max(FEWEST_VERTICES, POINTS_OF_A_FACE * len(mesh.faces)))
    budget = None
    if math.isfinite(deadline):
        budget = max(deadline - clock.worked(), LEAST_TIME)
    with unsaid():  # warnings would be of points that nobody but us has drawn
        made = ComputedMap(points, distortion="conformal", time_budget=budget)
        found = made.parameterize(mesh, seed=seed)
    return found.uv, dict(found.report)
