"""No two methods are the same map under two names."""

from itertools import combinations

import numpy as np

from baselines import registry
from parapoint.surfaces.surface import Mesh
from parapoint.testing import irregular_disk, sphere

DISK_METHODS = [
    "tutte",
    "harmonic",
    "mean_value",
    "lscm",
    "bff",
    "abf",
    "arap",
    "smith_schaefer",
    "geometry_image",
    "slim",
    "slim(energy=conformal)",
]
CUTS = ["seamster", "erickson_har_peled", "unwrap", "xatlas", "uvunwrap"]
"""Methods that cut a closed surface open, each along other edges."""
SHORT = "points=120, subset=100, iterations=2"
NEURAL = [
    "parapoint(preset=paper, {})",
    "parapoint(preset=learned, {})",
    "fam({})",
    "nuvo({})",
    "nuvo(charts=2, {})",
    "nsm({})",
    "atlasnet({})",
    "foldingnet({})",
    "diffsr({})",
    "elestruc({})",
    "gtif({})",
    "tearingnet({})",
    "flattening_net({})",
    "reggeonet({})",
]
"""Neural methods, to be given SHORT: after two steps each is what its own start and terms make."""
APART = 1e-3
"""Least distance between the maps of two methods, in their size."""


def bumpy_ramp():
    """A ramp of more than a turn: no map is nearly isometric, and a free boundary meets itself."""
    turn, radius = (of.ravel() for of in np.meshgrid(np.linspace(0, 7.8, 27), [0.5, 1, 1.5, 2]))
    height = 0.02 * turn + 0.3 * np.sin(3 * turn) * np.cos(np.pi * radius)
    points = np.stack([radius * np.cos(turn), radius * np.sin(turn), height], axis=1)
    corner = (np.arange(3)[:, None] * 27 + np.arange(26)).ravel()
    faces = np.concatenate([corner[:, None] + side for side in ([0, 28, 1], [0, 27, 28])])
    return Mesh(points, faces)


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


def too_close(specs, mesh):
    """The pairs of methods whose maps of a mesh, corner by corner, are APART or nearer."""
    maps = {}
    for spec in specs:
        result = registry.method(spec)[1].parameterize(mesh, seed=0)
        maps[spec] = result.uv[result.corners].reshape(-1, 2)
    return [pair for pair in combinations(maps, 2) if distance(*(maps[s] for s in pair)) < APART]


def test_no_two_maps_of_a_disk_are_equal():
    assert too_close(DISK_METHODS, bumpy_ramp()) == []


def test_no_two_cut_a_closed_surface_alike():
    assert too_close(CUTS, Mesh(sphere().vertices * [1, 2, 3], sphere().faces)) == []


def test_no_two_neural_maps_are_equal():
    assert too_close([spec.format(SHORT) for spec in NEURAL], irregular_disk()) == []
