"""Parts that a conformal map shrinks to nothing, and what becomes of them."""

import math
from collections.abc import Iterator

import numpy as np
import pytest

from benchmarks.cases import builtin
from benchmarks.metrics.evaluation import evaluate
from parapoint.computed import parts
from parapoint.computed.flattening import flattened
from parapoint.computed.parts import parts_kept, towards_conformal
from parapoint.planar.bijection import bijective_map, is_bijective
from parapoint.planar.descent import Run
from parapoint.planar.growth import Need
from parapoint.surfaces.areas import LEAST_PART, starved_share
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import FloatArray, Mesh


@pytest.fixture(scope="module")
def conformal() -> tuple[Mesh, FloatArray]:
    """A disk with a finger at its middle, and its conformal map."""
    mesh = builtin.finger()
    return mesh, bijective_map(mesh, None)


def test_a_finger_is_starved_by_the_conformal_map_alone(conformal) -> None:
    found = {}
    for distortion in ("conformal", "balanced", "isometric"):
        disk, uv = parts_kept(*conformal, distortion)
        assert is_bijective(disk, uv)
        share = starved_share(disk, uv)
        assert (share > 0.2) if distortion == "conformal" else (share <= LEAST_PART)
        found[distortion] = evaluate(disk, Parameterization(uv, disk.faces))
    assert found["conformal"]["part_area_ratio_min"] < 1
    assert found["balanced"]["part_area_ratio_min"] == 1
    # Of those that keep every part, the balanced map has the better angles, the other the energy.
    angle = {name: values["angle_difference_mean"] for name, values in found.items()}
    energy = {name: values["symmetric_dirichlet"] for name, values in found.items()}
    assert angle["balanced"] < angle["isometric"]
    assert energy["isometric"] <= energy["balanced"] < energy["conformal"]


def test_the_same_at_every_scale(conformal) -> None:
    scale = 2.0**12
    mesh, flat = conformal
    small, uv = parts_kept(mesh, flat, "balanced")
    large, scaled = parts_kept(Mesh(scale * mesh.vertices, mesh.faces), scale * flat, "balanced")
    np.testing.assert_array_equal(small.faces, large.faces)
    np.testing.assert_allclose(scaled / scale, uv, atol=1e-6)


def test_a_balanced_map_starves_no_more_than_the_conformal_one(conformal, monkeypatch) -> None:
    def worse(run: Run, _: Need) -> Run:
        run.uv = run.uv * np.where(run.uv[:, :1] > np.median(run.uv[:, 0]), 1, 1e-3)
        return run

    monkeypatch.setattr(parts, "grown", worse)
    monkeypatch.setattr(parts, "towards_conformal", lambda _, uv, __: uv)
    disk, uv = parts_kept(*conformal, "balanced")
    assert disk is conformal[0]
    assert uv is conformal[1]


def test_a_map_that_starves_nothing_stays_conformal() -> None:
    rng = np.random.default_rng(0)
    points = rng.uniform(-1, 1, (400, 2))
    flat = flattened(np.column_stack([points, 0.1 * points[:, 0] ** 2]))
    disk, uv = parts_kept(flat.disk, flat.uv, "balanced")
    assert disk is flat.disk
    assert uv is flat.uv


@pytest.mark.parametrize(("last", "steps"), [(0.495, 3), (0.48, 5)])
def test_the_way_to_a_conformal_map_ends_once_a_step_gains_little(monkeypatch, last, steps) -> None:
    """The excess is halved, and then falls by a hundredth or by four; two are little."""
    points = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    mesh = Mesh(points, [[0, 1, 2], [0, 2, 3]])
    uv = points[:, :2]
    falls = iter([1.0, 0.5, last, 0.2, 0.1])

    def down(*_: object) -> Iterator[FloatArray]:
        for k in range(1, 6):
            yield uv + k

    monkeypatch.setattr(parts, "steps_down", down)
    monkeypatch.setattr(parts, "excess", lambda *_: next(falls))
    assert (towards_conformal(mesh, uv, math.inf) == uv + steps).all()
