"""Coloured clouds of models: samples whose colours are sums of waves through space."""

from __future__ import annotations

import numpy as np

from parapoint.surfaces.sampling import surface_sample
from parapoint.surfaces.surface import FloatArray, Mesh, PointCloud

WAVES = {"smooth": 5.0, "fine": 20.0}
"""For each kind of colours, the most waves along the longest side of a model's bounding box."""
POINTS = 60_000
"""Points of a cloud."""
WAVE_COUNT = 12
"""Number of waves that are summed."""


def coloured(mesh: Mesh, waves: float, count: int = POINTS) -> PointCloud:
    """Points spread over a mesh, always the same, with 8-bit colours.

    Args:
        mesh: what is sampled, by area.
        waves: the most waves along the longest side of its bounding box.
        count: number of points.
    """
    side = float(np.ptp(mesh.vertices[mesh.referenced], axis=0).max())
    points = surface_sample(mesh.vertices, mesh.faces, count, 0)
    colours = np.rint(255 * wave_colours(points / side, waves)).astype(np.uint8)
    return PointCloud(points, attributes={"colours": colours})


def wave_colours(points: FloatArray, waves: float) -> FloatArray:
    """(N, 3) colours from 0 to 1: sums of plane waves, with at most `waves` in a unit of length."""
    rng = np.random.default_rng(0)
    towards = rng.normal(size=(WAVE_COUNT, 3))
    towards *= (
        waves
        * rng.uniform(0.3, 1, (WAVE_COUNT, 1))
        / np.linalg.norm(towards, axis=1, keepdims=True)
    )
    phase = rng.uniform(0, 2 * np.pi, WAVE_COUNT)
    strength = rng.normal(size=(WAVE_COUNT, 3)) / 8
    return np.asarray(
        np.clip(0.5 + np.sin(2 * np.pi * points @ towards.T + phase) @ strength, 0, 1)
    )
