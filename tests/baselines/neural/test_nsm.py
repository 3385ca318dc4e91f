"""Neural Surface Maps: samples, losses by hand, and what the refinement changes."""

from itertools import pairwise

import numpy as np
import pytest
import torch

from baselines.hybrid import AutomaticSLIM
from baselines.neural.nsm import NSM, flattened
from baselines.neural.nsm_networks import Refinement, SurfaceMap
from baselines.neural.nsm_samples import Triangles
from baselines.neural.nsm_training import (
    ROUND,
    batches,
    distortion_terms,
    figures,
    first_forms,
    overfit_terms,
)
from baselines.neural.sheets import with_axes
from baselines.neural.stepping import trained
from parapoint import clock
from parapoint.errors import InputError
from parapoint.surfaces.surface import PointCloud
from parapoint.testing import irregular_disk

A = torch.tensor([[2.0, 0.5], [0.0, 1.5], [1.0, -0.5]], dtype=torch.float64)
FLAT = torch.tensor([[[0.0, 0], [1, 0], [0, 1]], [[1, 0], [1, 3], [0, 1]]], dtype=torch.float64)


def generator():
    return torch.Generator().manual_seed(0)


def plane(x):
    """The map A with its tangents."""
    return x @ A.T.float()


def test_samples_lie_on_the_triangles_evenly_in_space():
    at = Triangles(FLAT, FLAT @ A.T).drawn(4_000, generator())
    torch.testing.assert_close(at.points, at.uv @ A.T.float())
    torch.testing.assert_close(at.jacobians, A.float().expand(4_000, 3, 2))
    normal = torch.linalg.cross(A[:, 0], A[:, 1])
    torch.testing.assert_close(at.normals[7].double(), normal / normal.norm())
    second = (at.uv.sum(dim=1) > 1).float().mean().item()  # of area 3/2 beside 1/2
    assert second == pytest.approx(0.75, abs=0.03)


def test_a_map_that_is_right_loses_nothing_and_one_turned_over_its_normals():
    at = Triangles(FLAT, FLAT @ A.T).drawn(100, generator())
    right = {name: of.item() for name, of in overfit_terms(plane, at).items()}
    assert right == pytest.approx({"position": 0, "normal": 0}, abs=1e-10)
    over = overfit_terms(plane, at._replace(normals=-at.normals))
    assert over["normal"].item() == pytest.approx(0.01 * 4)
    moved = overfit_terms(lambda x: plane(x) + torch.tensor([0.0, 3.0, 4.0]), at)
    assert moved["position"].item() == pytest.approx(25)


def test_the_distortion_by_hand():
    uv = torch.rand(50, 2, generator=generator())
    forms = torch.tensor([[4.0, 0.0], [0.0, 1.0]]).expand(50, 2, 2)

    def stretched(x):
        return x * torch.tensor([2.0, 1.0])

    still = distortion_terms(Refinement(generator()), uv, forms)
    assert still["distortion"].item() == pytest.approx(4 + 1 + 1 / 4 + 1, abs=0.02)
    assert still["flip"].item() == 0
    assert distortion_terms(stretched, uv, forms)["distortion"].item() == pytest.approx(4, abs=0.02)
    mirrored = distortion_terms(lambda x: -stretched(x) * torch.tensor([1.0, -1.0]), uv, forms)
    assert mirrored["flip"].item() == pytest.approx(100 * 2)


def test_the_figures_of_a_map_that_is_a_tenth_too_large_and_of_a_mirror():
    at = Triangles(FLAT, FLAT @ A.T).drawn(500, generator())
    found = figures(lambda x: 1.1 * plane(x), lambda x: x * torch.tensor([1.0, -1.0]), at)
    form = 1.1**2 * A.T @ A
    safe = form + 0.01 * torch.eye(2)
    energy = form.trace().item() + torch.linalg.inv(safe).trace().item()
    assert found == pytest.approx(
        {
            "distance": 0.1 * at.points.square().sum(1).mean().sqrt().item(),
            "derivative_error": 0.1,
            "derivative_error_rms": 0.1,
            "distortion_before": energy,
            "distortion_after": energy,
            "flipped": 1,
        },
        rel=1e-3,
    )
    assert figures(plane, Refinement(generator()), at)["flipped"] == 0


def test_the_first_form_is_that_of_differences():
    surface = SurfaceMap(generator()).double()
    uv = torch.rand(5, 2, dtype=torch.float64, generator=generator())
    step = 1e-6
    with torch.no_grad():
        columns = [
            (surface((uv + d)[None])[0] - surface((uv - d)[None])[0]) / (2 * step)
            for d in step * torch.eye(2, dtype=torch.float64)
        ]
    J = torch.stack(columns, dim=2)
    torch.testing.assert_close(first_forms(surface, uv), J.mT @ J, rtol=1e-5, atol=1e-8)


def test_the_refinement_begins_as_the_identity():
    uv = torch.rand(20, 2, generator=generator())
    torch.testing.assert_close(Refinement(generator())(with_axes(uv)), with_axes(uv))


def test_the_refinement_finds_the_stretch_that_undoes_that_of_the_surface():
    uv = 2 * torch.rand(400, 2, generator=generator()) - 1
    forms = torch.tensor([[2.25, 0.0], [0.0, 1.0]]).expand(400, 2, 2)
    refined = Refinement(generator())
    steps = list(trained(refined, lambda: distortion_terms(refined, uv, forms), 5e-3, 150, None))
    assert steps[0]["distortion"] == pytest.approx(2.25 + 1 + 1 / 2.25 + 1, abs=0.02)
    assert steps[-1]["distortion"] < 4.02


def test_the_map_is_the_isometric_one_lowered_further_between_the_vertices():
    mesh = irregular_disk()
    result = NSM(points=4_000, iterations=250, subset=100).parameterize(mesh, seed=0)
    report = result.report
    assert report["iterations"] == [212, 38]
    assert report["rms_of_fit"] < 0.01
    assert report["derivative_error"] < 0.25
    assert 3.98 <= report["distortion_after"] < report["distortion_before"]
    assert report["flipped"] == 0
    begun = AutomaticSLIM().parameterize(mesh, seed=0).uv
    begun = begun - (begun.min(axis=0) + begun.max(axis=0)) / 2
    apart = np.linalg.norm(result.uv - begun, axis=1).max() / np.ptp(begun, axis=0).max()
    assert 1e-3 < apart < 0.1


def test_time_ends_it_and_the_steps_say_how_far_it_came():
    mesh = irregular_disk()
    result = NSM(points=500, subset=100, time_budget=0.5).parameterize(mesh, seed=0)
    fit, refinement = result.report["iterations"]
    assert 0 < fit < 8_500
    assert 0 < refinement < 8_500
    assert not NSM(time_budget=0.5).deterministic
    assert NSM().deterministic


def test_half_of_the_time_is_the_flattening_s(monkeypatch):
    monkeypatch.setattr(clock, "worked", lambda: 100.0)
    assert flattened(irregular_disk(), 10.0).deadline == 105


def test_the_surface_map_has_four_residual_blocks_and_the_refinement_is_smaller():
    def layers(*sizes):
        return sum((a + 1) * b for a, b in pairwise(sizes))

    def count(network):
        return sum(of.numel() for of in network.parameters())

    surface = SurfaceMap(generator())
    assert count(surface) == layers(2, 128) + 4 * layers(128, 128, 128) + layers(128, 3)
    assert count(Refinement(generator())) == layers(2, 64, 64, 2)


def test_a_cloud_and_a_bad_budget_are_refused():
    with pytest.raises(Exception, match="needs faces"):
        NSM().parameterize(PointCloud(irregular_disk().vertices), seed=0)
    with pytest.raises(InputError, match="time_budget"):
        NSM(time_budget=0.0)


def test_half_of_the_samples_are_drawn_where_the_map_is_off():
    samples = Triangles(FLAT, FLAT @ A.T).drawn(10_000, generator())
    samples.points[:100, 2] += 3  # the map `plane` is right at all others
    rows = next(batches(plane, samples, 4_000, generator()))
    assert (rows < 100).float().mean().item() == pytest.approx(0.505, abs=0.02)
    right = Triangles(FLAT, FLAT @ A.T).drawn(10_000, generator())
    rows = next(batches(plane, right, 4_000, generator()))
    assert (rows < 100).float().mean().item() == pytest.approx(0.01, abs=0.005)


def test_samples_are_weighed_anew_after_each_round():
    samples = Triangles(FLAT, FLAT @ A.T).drawn(1_000, generator())
    drawn = batches(plane, samples, 8, generator())
    before = torch.cat([next(drawn) for _ in range(ROUND)])
    samples.points[7] += 3
    after = torch.cat([next(drawn) for _ in range(ROUND)])
    assert (before == 7).float().mean().item() < 0.005
    assert (after == 7).float().mean().item() == pytest.approx(0.5, abs=0.02)
