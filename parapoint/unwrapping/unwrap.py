"""A mesh unwrapped: one chart a component, cut along a clean path of edges, one to one."""

from __future__ import annotations

import contextlib
import logging
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from parapoint import clock
from parapoint.computed.computed_map import ComputedMap
from parapoint.computed.parts import DISTORTIONS, towards_conformal
from parapoint.computed.reconstruction import ReconstructionError
from parapoint.errors import InputError
from parapoint.method import UnsupportedError
from parapoint.parameters import LONGEST_SECONDS, check_choice, check_number
from parapoint.planar.coarse import LARGE, grown_as_coarse
from parapoint.planar.descent import LEAST_ENERGY, Run, sound
from parapoint.planar.domains import FlatteningError
from parapoint.planar.embedding import embeddable
from parapoint.planar.growth import PRICE, Need, grown
from parapoint.planar.scaffold import of_area_one
from parapoint.surfaces.across_seams import learned_seam
from parapoint.surfaces.areas import LEAST_PART
from parapoint.surfaces.cutting import cut_along, disk_cut
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.preparation import LEAST_TIME, prepared
from parapoint.surfaces.sampling import FEWEST_VERTICES
from parapoint.surfaces.surface import BoolArray, Mesh, Surface

POINTS_OF_A_FACE = 100
"""Of a mesh with few faces so many points are sampled on each."""
ENOUGH_POINTS = 6_000
"""So many points show where any mesh should open. camelhead (22,704 faces) comes to an energy of
4.30 with them in 20 s of processor time, to 4.39 with 20,000 in 45 s; a fish of 220 faces to 5.38
in 7 s, to 5.63 in 27 s."""
STEPPING = 0.9
"""Share of a time budget after which no step begins: the last one takes time, too."""
SHARE_OF_SEAM = 0.5
"""Share of a time budget in which the computed map, which tells the seam, is to be ready."""


@dataclass(frozen=True)
class Unwrap:
    """An isometric map of the mesh, cut along a clean path of edges; no flips, one to one.

    The symmetric Dirichlet energy is brought down from Tutte's embedding; the boundary never
    crosses itself (`parapoint.planar.scaffold`). Then the seam grows to where the map is most
    distorted (`parapoint.planar.growth`), as long as that pays, or until a bound on the energy is
    met, and on until hardly a place is starved of area.

    A disk, with or without holes, begins without a seam. Any other mesh is cut along the seam of
    `ComputedMap`, made a clean path of edges (`parapoint.surfaces.across_seams`), or along the
    automatic cut (`parapoint.surfaces.cutting`) where no map can be computed. Where the map must
    come below a bound on the energy, a disk is begun in both ways, and the shorter seam stays.
    Where to a large mesh's seam grows is told by a simplified one (`parapoint.planar.coarse`), but
    under a bound, as the two differ in energy.
    Components are mapped one after another.

    Attributes:
        points: of the computed map; None for as many as show where the mesh should open.
        time_budget: seconds of work (`parapoint.clock`) for each component, or None for no bound.
            No step begins after that; the map is then as good as it has become.
        price: what the symmetric Dirichlet energy (4 at least) must fall by for each sqrt(area) of
            seam; None for the learned seam, no shorter and no longer. Under a bound on the energy
            it is not asked.
        max_distortion: symmetric Dirichlet energy, above 4, down to which the seam grows and no
            longer; None for no such bound. The report has the energy that was reached.
        distortion: "isometric" weighs angles and areas alike, as the energy does; "balanced" goes
            on from there to keep angles as far as every part keeps its area; "conformal" keeps
            angles along the first seam, whatever becomes of an ear or a finger.
    """

    points: int | None = None
    time_budget: float | None = None
    price: float | None = PRICE
    max_distortion: float | None = None
    distortion: str = "isometric"

    requires: ClassVar[frozenset[str]] = frozenset({"faces", "manifold", "oriented", "connected"})
    packages: ClassVar[tuple[str, ...]] = ("libigl", "shapely")

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

        Args:
            mesh: what is no manifold or oriented is opened (`parapoint.surfaces.preparation`).
            seed: of every random draw.

        Raises:
            UnsupportedError: no face has an area.
            FlatteningError: no start without flips was found.
        """
        preparation = prepared(mesh, self.requires)
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
        seam: BoolArray = np.zeros(len(mesh.edges), dtype=bool)
        computed: dict[str, object] = {"not_asked": "the mesh is a disk, with or without holes"}
        run = None
        if self._grows and mesh.is_planar_domain:
            half = clock.worked() + (deadline - clock.worked()) / 2
            with contextlib.suppress(FlatteningError):  # too thin for a start: it is cut first
                run = self._grown(mesh, seam, deadline if self.max_distortion is None else half)
        if run is None or (self.max_distortion is not None and self._is_cut_or_in_need(run)):
            seam, computed = self._seam(mesh, seed, deadline)
            other = self._grown(mesh, seam, deadline)
            run = other if run is None else min(run, other, key=self._cost)
            seam &= run is other
        run.deadline = deadline
        if self._grows:
            run.improve()
        self._keep_angles(run)
        report = {
            **run.report(),
            "learned_seam_edges": int(seam.sum()),
            "computed": computed,
        }
        return Parameterization(run.uv, run.mesh.faces, report=report)

    @property
    def _grows(self) -> bool:
        """Whether the seam is led on to where the map is most distorted."""
        return self.price is not None and self.distortion != "conformal"

    @property
    def _need(self) -> Need:
        """What the seam is to bring."""
        if self.max_distortion is not None:
            return Need(math.inf, most_energy=self.max_distortion)
        return Need(PRICE if self.price is None else self.price)

    def _is_cut_or_in_need(self, run: Run) -> bool:
        """Whether a map that begins without a seam has got one, or lacks something still."""
        return run.branches > 0 or self._need.of(run)

    def _cost(self, run: Run) -> tuple[bool, float]:
        """By which of two maps is worse: one that lacks something, or has the longer seam."""
        return self._need.of(run), run.rim

    def _grown(self, mesh: Mesh, seam: BoolArray, deadline: float) -> Run:
        """The settled map of the mesh cut along some edges (E,), and on from there.

        Args:
            mesh: what is to be mapped.
            seam: edges that make a planar domain of it.
            deadline: no step begins after this time of `clock.worked`.
        """
        is_large = len(mesh.faces) > LARGE and self.max_distortion is None
        domain = embeddable(cut_along(mesh, mesh.edges[seam]))
        tips: tuple[int, ...] = ()
        if self._grows and is_large:
            domain, tips = grown_as_coarse(domain, self._need, deadline)
        run = Run(domain, deadline)
        run.tips = tips
        run.begin()
        run.improve()
        if not self._grows or (is_large and not self._need.of(run)):
            return run
        return grown(run, self._need)

    def _seam(self, mesh: Mesh, seed: int, deadline: float) -> tuple[BoolArray, dict[str, object]]:
        """(E,) the edges along the seam of the computed map, and the report of that map.

        Where no map can be computed they are those of the automatic cut.
        """
        points = self.points or _enough_points(mesh)
        budget = None
        if self.time_budget is not None:
            budget = SHARE_OF_SEAM * max(deadline - clock.worked(), LEAST_TIME)
        computed = ComputedMap(points, distortion="conformal", time_budget=budget)
        try:
            with _unsaid():
                learned = computed.parameterize(mesh, seed=seed)
        except ReconstructionError as error:
            seam = np.zeros(len(mesh.edges), dtype=bool)
            return seam if mesh.is_planar_domain else disk_cut(mesh), {"failed": str(error)}
        return learned_seam(mesh, learned.uv), dict(learned.report)

    def _keep_angles(self, run: Run) -> None:
        """Move the map down the conformal energy as far as `distortion` says."""
        if self.distortion == "isometric":
            return
        most_starved = 1.0 if self.distortion == "conformal" else LEAST_PART
        unit = of_area_one(run.mesh.vertices, run.mesh.faces)
        uv = towards_conformal(unit, run.uv / run.unit, run.deadline, most_starved)
        run.take(run.unit * uv, run.start)


@contextlib.contextmanager
def _unsaid() -> Iterator[None]:
    """Leave warnings unsaid: they would be of points that nobody but us has drawn."""
    logger = logging.getLogger("parapoint")
    before, logger.disabled = logger.disabled, True
    try:
        yield
    finally:
        logger.disabled = before


def _enough_points(mesh: Mesh) -> int:
    """Points that show where a mesh should open: some on each face, or some of its vertices."""
    return min(ENOUGH_POINTS, max(FEWEST_VERTICES, POINTS_OF_A_FACE * len(mesh.faces)))
