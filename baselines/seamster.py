"""Seamster: a seam that joins the pointed places of a surface where it is hardest to see."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import igl
import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from baselines.visibility import visibility
from parapoint.method import UnsupportedError
from parapoint.parameters import check_number
from parapoint.planar.descent import Run, sound
from parapoint.planar.embedding import factored
from parapoint.surfaces.cutting import (
    cut_along,
    cut_to_disk,
    edge_graph,
    edge_lengths,
    edge_mask,
    path_edges,
    path_to,
)
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import FloatArray, IntArray, Mesh, Surface

RADIUS = 0.1
"""Radius of the region whose curvature counts for a vertex, in square roots of the area."""
MOST_TERMINALS = 40
"""Terminals at most, the most curved ones."""
HIDDEN = 0.1
"""Cost per length of an edge that no view shows; one that all show costs 1 more."""


@dataclass(frozen=True)
class Seamster:
    """An isometric map along a seam that joins the pointed places, where it is least seen.

    A. Sheffer and J. C. Hart 2002, "Seamster: inconspicuous low-distortion texture seam layout".
    Terminals are vertices that a flattening would distort: the Gaussian curvature of the region
    around one, the sum of its vertices' angle defects, is the largest nearby and at least
    `curvature`. An edge costs its length, and more the more of it is seen. The seam is the smallest
    tree of cheapest paths that joins all terminals and the boundary (a Steiner tree by way of the
    minimal spanning tree). What is no disk then is cut on as automatically (handles, holes).

    The map along it is the one to one isometric map of `automatic+slim(price=None)`, so that the
    two differ in the seam alone. Ours: regions of one size (RADIUS), views of the vertices as
    points in place of rendered ones. Left out: seams given by the user.

    Attributes:
        curvature: least curvature of a terminal's region, in radians; a cube's corner has pi / 2.
    """

    curvature: float = 1.5

    requires: ClassVar[frozenset[str]] = frozenset({"faces", "manifold", "oriented", "connected"})
    packages: ClassVar[tuple[str, ...]] = ("libigl", "scipy", "shapely")

    def __post_init__(self) -> None:
        check_number("curvature", self.curvature, 0, above=True)

    def parameterize(self, surface: Surface, *, seed: int) -> Parameterization:  # noqa: ARG002 (nothing is random)
        """The map, in the scale of the surface.

        Raises:
            UnsupportedError: the surface is a cloud.
            InputError: a triangle has no area.
            FlatteningError: Tutte's embedding of the cut surface has flips.
        """
        if not isinstance(surface, Mesh):
            raise UnsupportedError("needs faces; the surface is a point cloud")
        mesh = sound(surface)
        seen = visibility(mesh)
        cost = edge_lengths(mesh) * (HIDDEN + seen[mesh.edges].mean(axis=1))
        terminals = pointed(mesh, self.curvature)
        seam = joining_tree(mesh, cost, terminals)
        cut = cut_along(mesh, seam)
        run = Run(cut if cut.is_planar_domain else cut_to_disk(cut))
        run.begin()
        run.improve()
        ends = mesh.vertices[seam]
        report = {
            "terminals": len(terminals),
            "tree_length": float(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).sum()),
            "seen": float(seen[seam].mean()) if len(seam) else 0.0,
        }
        return Parameterization(run.uv, run.mesh.faces, report=run.report() | report)


def pointed(mesh: Mesh, least: float) -> IntArray:
    """The terminals, most curved first: inner vertices whose region is curved by `least`."""
    inner = np.ones(len(mesh.vertices), dtype=bool)
    inner[mesh.edges[mesh.edge_face_count == 1]] = False
    defect = np.where(inner, igl.gaussian_curvature(mesh.vertices, mesh.faces), 0.0)
    radius = RADIUS * float(np.sqrt(mesh.face_areas.sum()))
    # Curvature spread as heat finds where to look; the regions' sums decide.
    mass = igl.massmatrix(mesh.vertices, mesh.faces, igl.MASSMATRIX_TYPE_BARYCENTRIC)
    heat = factored((mass - (radius / 2) ** 2 * igl.cotmatrix(mesh.vertices, mesh.faces)).tocsc())
    spread = np.abs(heat.solve(defect))
    top = np.where(inner, spread, -1.0)
    np.maximum.at(neighbours := top.copy(), mesh.edges, top[mesh.edges[:, ::-1]])
    peaks = np.flatnonzero((top >= neighbours) & inner)
    peaks = peaks[np.argsort(-top[peaks], kind="stable")][: 5 * MOST_TERMINALS]
    if not len(peaks):
        return peaks
    apart = csgraph.dijkstra(edge_graph(mesh, edge_lengths(mesh)), indices=peaks, limit=radius)
    curved = np.abs(np.where(np.isfinite(apart), defect, 0.0).sum(axis=1))
    found: list[int] = []
    for row in np.argsort(-curved, kind="stable"):
        is_apart = not np.isfinite(apart[row, peaks[found]]).any()
        if curved[row] >= least and is_apart and len(found) < MOST_TERMINALS:
            found.append(int(row))
    return np.asarray(peaks[found])


def joining_tree(mesh: Mesh, cost: FloatArray, terminals: IntArray) -> IntArray:
    """(n, 2) the edges of a cheap tree that joins all terminals and the boundary, if there is one.

    Cheapest paths between any two, a minimal spanning tree of these, and one of the edges used.
    """
    rim = mesh.edge_face_count == 1
    cost = np.where(rim, 1e-9 * cost.min(), cost)  # along the boundary all is cut already
    ends = np.unique(np.concatenate([terminals, mesh.edges[rim][:1, 0]]))
    graph = edge_graph(mesh, cost)
    distance, previous = csgraph.dijkstra(graph, indices=ends, return_predecessors=True)
    tree = csgraph.minimum_spanning_tree(distance[:, ends]).tocoo()
    paths = [path_to(previous[i], int(ends[j])) for i, j in zip(tree.row, tree.col, strict=True)]
    if not paths:
        return np.zeros((0, 2), dtype=np.int64)
    used = np.concatenate([path_edges(path) for path in paths])
    used = np.unique(np.sort(np.concatenate([used, mesh.edges[rim]]), axis=1), axis=0)
    weights = np.asarray(graph[used[:, 0], used[:, 1]]).reshape(-1)
    kept = csgraph.minimum_spanning_tree(sparse.coo_array((weights, tuple(used.T)), graph.shape))
    return np.asarray(mesh.edges[edge_mask(mesh, np.stack(kept.nonzero(), axis=1)) & ~rim])
