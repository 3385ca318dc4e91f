"""Golden quality on real models: computed maps, the mesh method, trained networks.

A change of the geometry or of the training that moves these values is meant to, or is a mistake; in
the first case its commit says by how much, and rewrites them (`nox -s regress -- --update`).
"""

import logging

import numpy as np
import pytest

from baselines import registry
from benchmarks.cases import models
from benchmarks.checks.regress import COMPUTED, cell, golden_rows, moves, tolerances
from benchmarks.store import results
from parapoint import ComputedMap, ParaPoint, PointCloud
from parapoint.surfaces.preparation import prepared
from parapoint.surfaces.sampling import training_points

SEAM_EDGES = 0.03
"""Relative change of the number of seam edges that rounding may bring. Vertices moved by 1e-14 of
their coordinates, as another processor's sums would, left it as it is on these four models."""


def model(name):
    try:
        return models.load(name)
    except models.MissingModelError as error:
        pytest.skip(str(error))


def assert_golden(spec, case, comparison=COMPUTED):
    surface = model(case)
    _, method = registry.method(spec)
    preparation = prepared(surface, method.requires)
    result = preparation.joined(preparation.maps(method, 0))
    now = {case: cell("ok", results.measured(surface, result, None))}
    golden = {case: golden_rows(spec, comparison)[case]}
    assert not moves(spec, golden, now, tolerances(comparison))
    return result.report


@pytest.mark.parametrize(
    ("case", "genus", "boundary_loops", "seam_edges"),
    [
        ("hand_1_i_f5000", 0, 1, 66),
        ("max_planck_i_f8000", 0, 1, 68),
        ("fertility", 4, 0, 259),
        ("kitten", 1, 0, 103),
    ],
)
def test_computed_maps_are_as_good_as_before(case, genus, boundary_loops, seam_edges):
    found = assert_golden("computed(points=4000)", case)["found"]
    assert (found["genus"], found["boundary_loops"]) == (genus, boundary_loops)
    assert found["seam_edges"] == pytest.approx(seam_edges, rel=SEAM_EDGES)


@pytest.mark.parametrize("case", ["hand_1_i_f5000", "eight_cfwen", "torus_odedstein"])
def test_maps_of_the_mesh_method_are_as_good_as_before(case):
    assert assert_golden("parapoint+slim(points=2000)", case)["bijective"]
