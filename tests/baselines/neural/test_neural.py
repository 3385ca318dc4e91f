"""The neural rivals: their networks' derivatives, their terms, what they make of a surface."""

import numpy as np
import pytest
import torch

from baselines.neural.fam import FAM, FAMTrainer
from baselines.neural.nuvo import Nuvo, NuvoNetworks, NuvoTrainer, encoded
from baselines.neural.training import surface_normals
from parapoint import PointCloud
from parapoint.errors import InputError
from parapoint.learned.presets import Preset
from parapoint.testing import irregular_disk, sphere


def generator():
    return torch.Generator().manual_seed(0)


def unit_points(count=150):
    points = np.random.default_rng(0).normal(size=(count, 3))
    return points / np.linalg.norm(points, axis=1, keepdims=True)


def trainer(kind, normals):
    preset = Preset(points=150, subset=120, iterations=3, all_from=1.0, warm_up=0.0, perturbation=0)
    return kind(unit_points(), normals, preset, seed=0, time_budget=None)


def assert_tangents_are_pushed(function, x):
    """The tangents of `function` at (1 + T, N, C) agree with central differences."""
    step, mapped = 1e-6, function(x)
    for k in range(1, len(x)):
        ahead, behind = (function(x[:1] + s * x[k : k + 1])[0] for s in (step, -step))
        torch.testing.assert_close(mapped[k], (ahead - behind) / (2 * step), rtol=1e-5, atol=1e-7)


def test_the_encoding_pushes_tangents_forward():
    assert_tangents_are_pushed(
        encoded, torch.rand(3, 5, 2, dtype=torch.float64, generator=generator())
    )


def test_texture_coordinates_push_tangents_forward_and_fill_the_unit_square():
    networks = NuvoNetworks(generator()).double()
    x = torch.rand(3, 5, 3, dtype=torch.float64, generator=generator())
    uv = networks.texture(x)[0]
    assert ((uv > 0) & (uv < 1)).all()
    assert_tangents_are_pushed(networks.texture, x)


def test_fam_holds_its_normals_against_those_given():
    points = unit_points()
    made = trainer(FAMTrainer, points)
    batch = made._batch()
    assert batch[0].shape == (2, 120, 3)
    there, back = made.networks(batch[0][:1], batch[1])
    normals = there.cut_cycle[:, 3:]
    aligned = torch.stack([batch[0][0], normals.detach()])
    opposite = torch.stack([batch[0][0], -normals.detach()])
    given = made.shape.points
    cycles = [made.terms(rows, batch[1], given)["cycle"].item() for rows in (aligned, opposite)]
    plain = (there.points_cycle - batch[0][0]).abs().mean() + (back.uv_cycle - back.uv).abs().mean()
    assert cycles[0] == pytest.approx(plain.item(), rel=1e-5)
    assert cycles[1] == pytest.approx(plain.item() + 2, rel=1e-5)


def test_fam_leaves_the_normals_out_where_there_are_none():
    made = trainer(FAMTrainer, None)
    points, grid = made._batch()
    there, back = made.networks(points, grid)
    plain = (there.points_cycle - points[0]).abs().mean() + (back.uv_cycle - back.uv).abs().mean()
    assert made.terms(points, grid, made.shape.points)["cycle"].item() == pytest.approx(
        plain.item()
    )


def test_nuvo_finds_no_fault_with_perpendicular_images_of_even_area(monkeypatch):
    made = trainer(NuvoTrainer, None)
    points, grid = made._batch()

    def stretched(_, x):  # 2 along the first tangent, 1/2 along the second
        axes = torch.tensor([[2.0, 0.0], [0.0, 0.5]])
        return torch.cat([x[:1, :, :2], axes[:, None].expand(2, x.shape[1], 2)])

    monkeypatch.setattr(NuvoNetworks, "texture", stretched)
    terms = made.terms(points, grid, made.shape.points)
    assert terms["conformal"].item() == 0
    assert terms["stretch"].item() == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize(("method", "kind"), [(FAM, FAMTrainer), (Nuvo, NuvoTrainer)])
def test_the_loss_falls_and_the_report_says_what_ran(method, kind):
    mesh = irregular_disk()
    result = method(points=150, subset=120, iterations=12).parameterize(mesh, seed=0)
    totals = [row.values["total"] for row in result.trace]
    assert totals[-1] < 0.8 * totals[0]
    assert result.report["iterations"] == 12
    assert result.report["weights"] == kind.weights
    assert sum(row.uv is not None for row in result.trace) == 8
    assert np.array_equal(result.trace[-1].uv.shape, result.uv.shape)


def test_normals_are_those_of_the_mesh_or_of_the_cloud():
    mesh = sphere()
    normals = surface_normals(mesh, mesh.vertices)
    np.testing.assert_allclose((normals * mesh.vertices).sum(1), 1, atol=0.02)  # of a coarse sphere
    points = unit_points()
    assert surface_normals(PointCloud(points), points) is None
    np.testing.assert_array_equal(surface_normals(PointCloud(points, -points), points), -points)


@pytest.mark.parametrize("field", ["points", "iterations", "subset", "time_budget"])
def test_a_budget_below_one_is_refused(field):
    with pytest.raises(InputError, match=field):
        FAM(**{field: 0})


def test_the_rivals_train_on_all_points_as_they_are():
    """Their papers have neither noise, nor a warm-up, nor a last phase."""
    for method in (FAM, Nuvo):
        assert method.schedule.perturbation == 0
        assert method.schedule.warm_up == 0
        assert method.schedule.all_from == 1
