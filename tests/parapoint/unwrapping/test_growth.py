"""Growth of the seam to where places are starved of area."""

import numpy as np

from benchmarks.cases import builtin
from benchmarks.metrics.evaluation import evaluate
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import Mesh
from parapoint.unwrapping.descent import Run
from parapoint.unwrapping.growth import MOST_STARVED, grow_to_feed, starved


def finger() -> Mesh:
    """A disk with a long finger at its middle, which is starved where no seam leads to it."""
    points, faces = builtin.disk_points(14)
    away = np.linalg.norm(points, axis=1)
    near = away < 0.5
    radius = np.where(near, np.minimum(away, 0.15), 0.15 + (away - 0.5) * 1.7)
    height = np.where(near, 6 * (0.5 - away), 0)
    plane = points * (radius / np.maximum(away, 1e-9))[:, None]
    return Mesh(np.column_stack([plane, height]), faces)


def test_a_seam_leads_to_what_is_starved() -> None:
    mesh = finger()
    run = Run(mesh)
    run.begin(None)
    run.improve(10)
    before = evaluate(mesh, Parameterization(run.uv, mesh.faces))["starved_area_fraction"]
    assert before > MOST_STARVED
    assert abs(starved(run) - before) < 1e-9
    grow_to_feed(run)
    assert run.branches >= 1
    found = evaluate(mesh, Parameterization(run.uv, run.mesh.faces))
    assert found["starved_area_fraction"] <= MOST_STARVED
    assert found["flipped_fraction"] == found["overlap_area"] == 0
