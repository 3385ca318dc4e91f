"""No two methods are the same map under two names."""

from itertools import combinations

import numpy as np

from baselines import registry
from parapoint.surfaces.surface import Mesh
from parapoint.testing import irregular_disk

DISK_METHODS = [
    "tutte",
    "harmonic",
    "mean_value",
    "lscm",
    "bff",
    "arap",
    "slim",
    "slim(energy=conformal)",
]
APART = 1e-3
"""Least distance between the maps of two methods, in their size."""


def distance(one, other):
    """The least distance between two maps (V, 2), in their size, after a similarity."""
    a, b = (uv @ [1, 1j] for uv in (one, other))
    a, b = (of - of.mean() for of in (a, b))
    a, b = (of / np.linalg.norm(of) for of in (a, b))
    return np.sqrt(2 - 2 * max(abs(np.vdot(a, b)), abs(np.vdot(a.conj(), b))))


def test_the_distance_is_that_of_shapes():
    uv = np.random.default_rng(0).normal(size=(20, 2))
    assert distance(uv, 3 * uv @ [[0, 1], [1, 0]] + [5, 6]) < 1e-7
    assert distance(uv, uv * [1, 1.1]) > 0.01


def test_no_two_methods_give_equal_maps():
    mesh = irregular_disk()
    mesh = Mesh(mesh.vertices * [1, 1, 4], mesh.faces)  # so bent that no map is nearly isometric
    maps = {spec: registry.method(spec)[1].parameterize(mesh, seed=0).uv for spec in DISK_METHODS}
    close = [pair for pair in combinations(maps, 2) if distance(*(maps[s] for s in pair)) < APART]
    assert close == []
