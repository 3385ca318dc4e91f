"""Measured figures of the baselines on real models.

The tolerances are those of the project's plan: the values follow from the mesh, the boundary loop
and the energy, but libigl's line search and summation order differ between processors.
"""

import numpy as np
import pytest

from baselines import registry
from parapoint.surfaces.areas import signed_areas
from parapoint.surfaces.preparation import prepared


def model(name):
    models = pytest.importorskip("benchmarks.cases.models")
    try:
        return models.load(name)
    except models.MissingModelError as error:
        pytest.skip(str(error))


def angle_difference_mean(mesh, uv, corners):
    """The paper's conformality: mean of abs(angle in space - angle in the plane), radians."""

    def angles(points):
        a, b = (np.roll(points, -k, axis=1) - points for k in (1, 2))
        cosine = (a * b).sum(axis=2) / np.linalg.norm(a, axis=2) / np.linalg.norm(b, axis=2)
        return np.arccos(np.clip(cosine, -1, 1))

    return np.abs(angles(mesh.vertices[mesh.faces]) - angles(uv[corners])).mean()


@pytest.mark.parametrize(
    ("name", "spec", "expected", "tolerance"),
    [
        ("beetle_igl", "lscm", 0.0039, 0.0005),
        ("beetle_igl", "slim(iterations=1)", 0.43, 0.01),
        ("camelhead", "lscm", 0.0246, 0.0005),
        ("hand_1", "lscm", 0.096, 0.001),
        ("hand_1", "slim", 0.641, 0.005),
        ("hand_1", "slim(iterations=1)", 0.333, 0.003),
        ("hand_1", "slim(energy=conformal)", 0.105, 0.002),
        ("max_planck", "lscm", 0.041, 0.001),
        ("max_planck", "slim(iterations=1)", 0.281, 0.003),
    ],
)
def test_conformality_of_the_paper_s_models(name, spec, expected, tolerance):
    mesh = model(name)
    result = registry.method(spec)[1].parameterize(mesh, seed=0)
    measured = angle_difference_mean(mesh, result.uv, result.corners)
    assert measured == pytest.approx(expected, abs=tolerance)
    if spec.startswith("slim"):
        assert (signed_areas(result.uv, result.corners) > 0).all()


def test_conformality_of_slim_after_20_iterations():
    mesh = model("camelhead")
    result = registry.method("slim")[1].parameterize(mesh, seed=0)
    assert angle_difference_mean(mesh, result.uv, result.corners) == pytest.approx(0.32, abs=0.005)


@pytest.mark.parametrize("name", ["spot_c3d", "fertility", "torus_odedstein", "kitten.nf20k"])
def test_closed_models_are_cut_to_disks_that_tutte_embeds(name):
    method = registry.method("tutte")[1]
    preparation = prepared(model(name), method.requires)
    assert preparation.steps == "automatic cut to a disk"
    (disk,) = preparation.parts
    assert disk.topology == "disk"
    assert method.parameterize(disk, seed=0).report == {"flipped": 0, "degenerate": 0}


@pytest.mark.parametrize("name", ["hand_1_i_f5000", "three_man_statue_i_f10000", "mannequin-devil"])
def test_mean_value_flips_no_triangle_of_a_model_with_limbs(name):
    result = registry.method("mean_value")[1].parameterize(model(name), seed=0)
    assert result.report == {"flipped": 0, "degenerate": 0}
