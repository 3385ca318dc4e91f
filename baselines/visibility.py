"""How much of a surface is seen from outside."""

from __future__ import annotations

import numpy as np

from parapoint.surfaces.cutting import edge_lengths
from parapoint.surfaces.surface import FloatArray, Mesh, vertex_normals

DIRECTIONS = 60
"""Directions from which the surface is looked at."""
PIXEL = 2.0
"""Side of a pixel of these views, and what counts as equally near, in mean edges."""


def visibility(mesh: Mesh) -> FloatArray:
    """(V,) the share of DIRECTIONS from which a vertex is seen: it faces there, unhidden."""
    count = np.arange(DIRECTIONS)
    z = 1 - (2 * count + 1) / DIRECTIONS
    turn = np.pi * (3 - np.sqrt(5)) * count
    level = np.sqrt(1 - z**2)
    views = np.stack([level * np.cos(turn), level * np.sin(turn), z], axis=1)
    pixel = PIXEL * float(edge_lengths(mesh).mean())
    normals = vertex_normals(mesh)
    centred = mesh.vertices - mesh.vertices.mean(axis=0)
    seen = np.zeros(len(centred))
    for view in views:
        across = np.linalg.svd(view[None])[2][1:]
        cell = np.floor(centred @ across.T / pixel).astype(np.int64)
        _, place = np.unique(cell, axis=0, return_inverse=True)
        nearness = centred @ view
        front = np.full(len(centred), -np.inf)
        np.maximum.at(front, place.reshape(-1), nearness)
        seen += (nearness >= front[place.reshape(-1)] - pixel) & (normals @ view > 0)
    return seen / DIRECTIONS
