"""One-to-one SLIM along seams: those of the computed map, the automatic cut, an artist's."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.sparse import csgraph

from baselines.disks.bijection import crossing_vertices
from baselines.disks.flattening import (
    FlatteningError,
    check_iterations,
    check_triangles,
    domain,
    frames,
    signed_areas,
    singular_values,
)
from baselines.disks.slim import DENSITIES, stepper
from baselines.disks.tutte import tutte
from baselines.packing import by_component
from parapoint.computed.bijection import BijectionError, isometric_map
from parapoint.computed.computed_map import ComputedMap
from parapoint.errors import InputError
from parapoint.method import UnsupportedError
from parapoint.surfaces.cutting import cut_along, cut_to_disk, edge_graph, edge_lengths, path_to
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.sampling import FEWEST_VERTICES
from parapoint.surfaces.spanning import learned_seam, unfolded
from parapoint.surfaces.surface import FloatArray, IntArray, Mesh, Surface

ENERGY = "symmetric_dirichlet"
DENSITY, LEAST_ENERGY = DENSITIES[ENERGY]
HOLD = 1e6
"""Weight of the soft constraint on a vertex that is held at its place for a step."""
MOST_HOLDS = 12
"""How often more vertices are held before a step is given up."""
TRIAL_STEPS = 5
"""Steps of SLIM after which a longer seam is judged."""
TRIALS = 3
"""The seam is as long as it should be once so many trials in a row do not pay."""
POINTS_OF_A_FACE = 100
"""Of a mesh with few faces so many points are sampled on each. Along the seams of a fish of 220
faces the energy is 4.65 to 5.02 (three seeds) with 20,000 points, 5.45 to 6.07 with 2,000."""
MOST_BRANCHES = 10
"""The seam grows by so many branches at most."""


@dataclass(frozen=True)
class ParaPointSLIM:
    """SLIM on the mesh cut along the seams of the computed map; no flips, one to one.

    `ComputedMap` maps the vertices; along its seam, made a clean path of edges
    (`parapoint.surfaces.spanning`), the mesh is cut. SLIM (M. Rabinovich et al. 2017) starts from a
    bijective map of small energy (`parapoint.computed.bijection`), or from the computed map where
    that has less and is one to one on the cut mesh. A step after which the boundary would cross
    itself is taken anew with the vertices that cross held where they are, so the map stays one to
    one. Then the seam grows to where the map is most distorted (X. Gu et al. 2002, "Geometry
    images"), as long as that pays.

    A disk, with or without holes, is cut only where that pays; where its map without a cut is so
    good that none could, no map is computed. Components are mapped one after another.

    Attributes:
        points: of the computed map; None for its own number, or fewer for a mesh of few faces.
        time_budget: of the computed map, in seconds for each component; None for no bound.
        iterations: steps of SLIM, at least 1; the longer seam takes more.
        price: what the symmetric Dirichlet energy (4 at least) must fall by for each sqrt(area) of
            seam; None for the learned seam, no shorter and no longer.
    """

    points: int | None = None
    time_budget: float | None = None
    iterations: int = 20
    price: float | None = 0.1

    requires: ClassVar[frozenset[str]] = frozenset({"faces", "manifold", "oriented", "connected"})
    packages: ClassVar[tuple[str, ...]] = ("libigl", "shapely")

    def __post_init__(self) -> None:
        _check(self.iterations, self.price)

    @property
    def deterministic(self) -> bool:
        """Whether the same seed gives the same map: as the computed map's."""
        return ComputedMap(time_budget=self.time_budget).deterministic

    def parameterize(self, surface: Surface, *, seed: int) -> Parameterization:
        """The map, in the scale of the surface.

        Raises:
            UnsupportedError: the surface is a point cloud; shapely is not installed.
            InputError: a triangle has no area.
            ReconstructionError: no map can be computed.
            FlatteningError: no start without flips was found.
        """
        if not isinstance(surface, Mesh):
            raise UnsupportedError("needs faces; the surface is a point cloud")
        mesh = _sound(surface)
        whole = self._uncut(mesh)
        if whole is not None and whole.energy - LEAST_ENERGY <= self._least_cost(mesh):
            report = {**whole.report(), "learned_seam_edges": 0, "computed": "no cut could pay"}
            return Parameterization(whole.uv, whole.mesh.faces, report=report)
        points = self.points or _enough_points(mesh, ComputedMap().points)
        model = ComputedMap(points, time_budget=self.time_budget)
        learned = model.parameterize(mesh, seed=seed)
        seam = learned_seam(mesh, learned.uv)
        run = _Run(cut_along(mesh, mesh.edges[seam]))
        run.begin(unfolded(mesh, learned.uv, run.mesh))
        run.improve(self.iterations)
        if self.price is not None:
            length = float(edge_lengths(mesh)[seam].sum()) / run.unit
            if whole is not None and whole.energy <= run.energy + self.price * length:
                run, seam = whole, np.zeros_like(seam)
            run.lengthen(self.price)
        report = {
            **run.report(),
            "learned_seam_edges": int(seam.sum()),
            "computed": dict(learned.report),
        }
        return Parameterization(run.uv, run.mesh.faces, report=report)

    def _uncut(self, mesh: Mesh) -> _Run | None:
        """SLIM without a cut, where the mesh has such a map and the price may be too high."""
        if self.price is None or not mesh.is_planar_domain:
            return None
        run = _Run(mesh)
        try:
            run.begin(None)
        except FlatteningError:
            return None
        run.improve(self.iterations)
        return run

    def _least_cost(self, mesh: Mesh) -> float:
        """What the energy must fall by for the shortest cut there is, one edge."""
        assert self.price is not None
        return self.price * float(edge_lengths(mesh).min() / np.sqrt(mesh.face_areas.sum()))


@dataclass(frozen=True)
class AutomaticSLIM:
    """SLIM along the automatic cut, grown and kept one to one.

    Held against that one it tells what the learned seam is worth, and what a longer seam is.

    Attributes:
        iterations: steps of SLIM, at least 1; the longer seam takes more.
        price: as of `ParaPointSLIM`; None for the automatic cut as it is.
    """

    iterations: int = 20
    price: float | None = 0.1

    requires: ClassVar[frozenset[str]] = frozenset({"faces", "disk_after_cut"})
    packages: ClassVar[tuple[str, ...]] = ("libigl", "shapely")

    def __post_init__(self) -> None:
        _check(self.iterations, self.price)

    def parameterize(self, surface: Surface, *, seed: int) -> Parameterization:  # noqa: ARG002 (nothing is random)
        """The map, in the scale of the surface.

        Raises:
            UnsupportedError: the surface is no disk, with or without holes; no shapely.
            InputError: a triangle has no area.
            FlatteningError: Tutte's embedding has flips.
        """
        disk = domain(surface)
        run = _Run(_sound(Mesh(disk.vertices, disk.faces)))
        run.begin(None)
        run.improve(self.iterations)
        if self.price is not None:
            run.lengthen(self.price)
        return Parameterization(run.uv, run.mesh.faces, report=run.report())


@dataclass(frozen=True)
class ArtistSLIM:
    """SLIM over each chart of the map that a model came with, its seams taken as they are.

    SLIM starts from a bijective map and is kept one to one, as along learned seams. Charts that
    are no disks, with or without holes, are cut to disks automatically (the report counts them);
    all are packed without a change of scale.

    Attributes:
        iterations: steps of SLIM, at least 1.
    """

    iterations: int = 20

    requires: ClassVar[frozenset[str]] = frozenset({"manifold", "oriented", "seams"})
    packages: ClassVar[tuple[str, ...]] = ("libigl", "shapely")

    def __post_init__(self) -> None:
        check_iterations(self.iterations)

    def parameterize(self, surface: Surface, *, seed: int) -> Parameterization:  # noqa: ARG002 (nothing is random)
        """The map in the scale of the surface.

        Raises:
            UnsupportedError: the surface is no mesh that came with a map.
            InputError: a triangle has no area.
            FlatteningError: a chart has no start without flips.
        """
        if not isinstance(surface, Mesh) or surface.seams is None:
            raise UnsupportedError("needs a mesh that came with a UV map")
        completed = held = 0

        def mapped(chart: Mesh) -> Parameterization:
            nonlocal completed, held
            check_triangles(chart.vertices, chart.faces)
            if not chart.is_planar_domain:
                chart, completed = cut_to_disk(chart), completed + 1
            run = _Run(chart)
            run.begin(None)
            run.improve(self.iterations)
            held += run.held_steps
            return Parameterization(run.uv, chart.faces)

        result = by_component(cut_along(surface, surface.seams), mapped)
        charts = int(result.charts().max()) + 1
        report = {"charts": charts, "charts_cut_to_disks": completed, "held_steps": held}
        return Parameterization(result.uv, result.corners, report=report)


class _Run:
    """SLIM on a planar domain, one step at a time, its boundary kept from crossing itself.

    Attributes:
        mesh: the domain, all its vertices referenced.
        uv: (V, 2) the map so far, without flips.
        energy: its symmetric Dirichlet energy.
        unit: sqrt(area).
        start: what it began with.
        held_steps: steps in which vertices were held.
        branches: branches that the seam grew.
    """

    def __init__(self, mesh: Mesh) -> None:
        self.held_steps = self.branches = 0
        self._set(mesh)

    def _set(self, mesh: Mesh) -> None:
        self.mesh = mesh
        self.unit = float(np.sqrt(mesh.face_areas.sum()))
        self.domain = domain(mesh)
        self.frame = frames(self.domain)

    def begin(self, uv: FloatArray | None) -> None:
        """Start from an isometric map or, if it is one to one and has less energy, from `uv`.

        SLIM alone is far from its end after 20 steps from Tutte's embedding: on lucy the energy is
        20 with the learned seam and 22 without one, and 7.8 and 19 with this start.

        Args:
            uv: (V, 2) the computed map; it is brought to the scale of the surface.
        """
        self.start, self.uv = self._isometric()
        self.energy = self._energy(self.uv)
        if uv is not None and (areas := signed_areas(uv, self.mesh.faces)).min() > 0:
            uv = uv * (self.unit / np.sqrt(areas.sum()))
            energy = self._energy(uv)
            if energy < self.energy and len(crossing_vertices(self.mesh, uv)) == 0:
                self.start, self.uv, self.energy = "computed", uv, energy

    def _isometric(self) -> tuple[str, FloatArray]:
        """The name of the start, and a map (V, 2) of small energy; Tutte's where that fails."""
        with suppress(BijectionError):
            uv = isometric_map(self.mesh)
            if len(crossing_vertices(self.mesh, uv)) == 0:
                return "isometric", uv
        uv = tutte(self.domain)
        folded = int((signed_areas(uv, self.mesh.faces) <= 0).sum())
        if folded:
            raise FlatteningError(
                f"SLIM needs a start without flips; Tutte's embedding has {folded} flipped or "
                f"degenerate triangles of {len(self.mesh.faces)}"
            )
        return "tutte", uv

    def _densities(self, uv: FloatArray) -> FloatArray:
        """(F,) energy of each triangle."""
        return DENSITY(*singular_values(self.frame, uv, self.mesh.faces))

    def _energy(self, uv: FloatArray) -> float:
        return float(self.mesh.face_areas @ self._densities(uv) / self.mesh.face_areas.sum())

    def improve(self, steps: int) -> None:
        """Take so many steps; the map stays one to one if it is."""
        for _ in range(steps):
            stepped = self._one_to_one(1)
            if stepped is None:
                return
            self.uv, self.energy = stepped, self._energy(stepped)

    def _one_to_one(self, steps: int) -> FloatArray | None:
        """(V, 2) the map after some steps, vertices held where need be; None where that fails."""
        held = np.zeros(0, dtype=np.int64)
        for _ in range(MOST_HOLDS):
            uv = self._stepped(held, steps)
            crossing = np.setdiff1d(crossing_vertices(self.mesh, uv), held)
            if len(crossing) == 0:
                if len(held) and len(crossing_vertices(self.mesh, uv)):
                    return None
                self.held_steps += len(held) > 0
                return uv
            held = np.union1d(held, crossing)
        return None

    def _stepped(self, held: IntArray, steps: int) -> FloatArray:
        """(V, 2) the map after some steps of libigl's SLIM with some vertices held in place."""
        return stepper(self.domain, self.uv, "symmetric_dirichlet", held, HOLD)(steps)

    def lengthen(self, price: float) -> None:
        """Lead the seam to where the map is most distorted, while that pays."""
        failed = 0
        blocked = np.zeros(len(self.mesh.vertices), dtype=bool)
        while failed < TRIALS and self.branches < MOST_BRANCHES:
            lengths = edge_lengths(self.mesh)
            graph = edge_graph(self.mesh, lengths)
            distance, previous, _ = csgraph.dijkstra(
                graph,
                indices=np.concatenate(self.mesh.boundary_loops),
                return_predecessors=True,
                min_only=True,
            )
            weight = np.repeat(self.mesh.face_areas, 3)
            rows = self.mesh.faces.reshape(-1)
            excess = np.repeat(self._densities(self.uv) - LEAST_ENERGY, 3)
            excess_at = np.bincount(rows, weight * excess) / np.bincount(rows, weight)
            tip = int(np.where(blocked, -1.0, excess_at * distance).argmax())
            if blocked[tip] or distance[tip] == 0:
                return
            path = np.array(path_to(previous, tip))
            before = self.mesh, self.frame, self.uv
            self._set(cut_along(self.mesh, np.stack([path[:-1], path[1:]], axis=1)))
            self.uv = before[2][origin(before[0], self.mesh)]
            uv = self._one_to_one(TRIAL_STEPS)
            least = price * float(distance[tip]) / self.unit
            if uv is not None and self.energy - self._energy(uv) > least:
                self.uv, self.energy = uv, self._energy(uv)
                self.branches += 1
                failed, blocked = 0, np.zeros(len(self.mesh.vertices), dtype=bool)
            else:
                self.mesh, self.frame, self.uv = before
                failed += 1
                blocked |= np.isfinite(
                    csgraph.dijkstra(graph, indices=tip, limit=float(distance[tip]) / 2)
                )

    def report(self) -> dict[str, object]:
        """What stands beside the map."""
        return {
            "energy": ENERGY,
            "end_energy": self.energy,
            "start": self.start,
            "bijective": len(crossing_vertices(self.mesh, self.uv)) == 0,
            "held_steps": self.held_steps,
            "branches_added": self.branches,
        }


def _sound(mesh: Mesh) -> Mesh:
    """The mesh without unreferenced vertices.

    Raises:
        InputError: a triangle has no area.
    """
    check_triangles(mesh.vertices, mesh.faces)
    used, faces = np.unique(mesh.faces, return_inverse=True)
    return Mesh(mesh.vertices[used], faces.reshape(-1, 3))


def _enough_points(mesh: Mesh, most: int) -> int:
    """Points that show where a mesh should open, at its edges: all vertices, or some a face."""
    return min(most, max(FEWEST_VERTICES, POINTS_OF_A_FACE * len(mesh.faces)))


def _check(iterations: int, price: float | None) -> None:
    check_iterations(iterations)
    if price is not None and not price >= 0:
        raise InputError(f"price must be at least 0 or None, not {price}")


def origin(mesh: Mesh, cut: Mesh) -> IntArray:
    """(V',) the vertex of `mesh` that each one of `cut`, the same mesh cut open, is or copies."""
    rows = np.empty(len(cut.vertices), dtype=np.int64)
    rows[cut.faces] = mesh.faces
    return rows
