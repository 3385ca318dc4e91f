"""The components of meshes and clouds."""

from __future__ import annotations

import logging

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph
from scipy.spatial import cKDTree

from parapoint.surfaces.scan_lines import breadth
from parapoint.surfaces.surface import BoolArray, FloatArray, IntArray, Mesh, Surface, compact

COMPONENTS = ("together", "each", "largest")
"""What the parameter `components` of a fit may say: one map of the whole surface, one of each
component, or one of the largest component alone."""
NEIGHBOURS = 8
"""Each point of a cloud is joined to this many nearest points. No length is needed, so uneven
density does no harm. More points than this that are nearer to each other than to all others are
apart from these."""
FEWEST = 100
"""Points of a component of a cloud; smaller ones go with the nearest that is larger."""
SAMPLE = 200_000
"""Most points of a cloud among which components are looked for; the others go with the nearest."""

logger = logging.getLogger("parapoint")


def parts_of(surface: Surface, which: str) -> list[Surface]:
    """The parts of a surface that get a map each, as COMPONENTS says; a warning tells of several.

    Args:
        surface: a mesh or a cloud.
        which: one of COMPONENTS.
    """
    if which == "together":
        if isinstance(surface, Mesh) and (count := surface.welded.component_count) > 1:
            logger.warning(
                "%d components: one map is fitted to all of them; --components each or largest "
                "fits them apart",
                count,
            )
        return [surface]
    parts = components(surface)
    if len(parts) > 1:
        done = "the largest is fitted" if which == "largest" else "each is fitted"
        logger.warning("%d components: %s", len(parts), done)
    return parts[:1] if which == "largest" else parts


def components(surface: Surface) -> list[Surface]:
    """The components of a surface, largest first (a mesh's by area, a cloud's by points).

    Of a mesh: faces that share places, left out where they have no area. Of a cloud: connected
    components of the graph that joins each point to its NEIGHBOURS nearest and the next scan line.
    """
    if isinstance(surface, Mesh):
        label = surface.welded.face_components
        area = np.bincount(label, weights=surface.face_areas)
        order = [k for k in np.argsort(-area, kind="stable") if area[k] > 0]
        return [compact(surface.vertices, surface.faces[label == k]) for k in order] or [surface]
    label = cloud_labels(surface.points)
    by_size = np.argsort(-np.bincount(label), kind="stable")
    return [surface.chosen(label == k) for k in by_size]


def largest_component(mesh: Mesh) -> tuple[Mesh, BoolArray]:
    """The component of the largest area, and (F,) which faces are its."""
    label = mesh.welded.face_components
    chosen = label == np.bincount(label, weights=mesh.face_areas).argmax()
    return compact(mesh.vertices, mesh.faces[chosen]), chosen


def cloud_labels(points: FloatArray) -> IntArray:
    """(N,) the component, from 0, of each of (N, 3) points; see `components`."""
    size = min(len(points), SAMPLE)
    sample = np.unique(points[np.random.default_rng(0).permutation(len(points))[:size]], axis=0)
    tree = cKDTree(sample)
    near = tree.query(sample, min(NEIGHBOURS + 1, len(sample)))[1][:, 1:]
    if (count := breadth(sample)) is not None:  # one more link, to the next scan line
        near = np.column_stack([near, near[:, 0]])
        for rank in np.unique(count[count > NEIGHBOURS]):
            on_lines = count == rank
            near[on_lines, -1] = tree.query(sample[on_lines], [rank + 1])[1][:, 0]
    rows = np.repeat(np.arange(len(sample)), near.shape[1])
    graph = sparse.coo_matrix((np.ones(len(rows), bool), (rows, near.ravel())), [len(sample)] * 2)
    label = csgraph.connected_components(graph, directed=False)[1]
    large = np.bincount(label)[label] >= FEWEST
    if not large.any():
        return np.zeros(len(points), dtype=np.int64)
    nearest = cKDTree(sample[large]).query(points)[1]
    return np.unique(label[large][nearest], return_inverse=True)[1].astype(np.int64)
