"""The neural rivals: their networks' derivatives, their terms, what they make of a surface."""

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from baselines.neural.fam import FAM
from baselines.neural.fam_training import FAMTrainer, repulsion
from baselines.neural.method import NeuralMethod, surface_normals
from baselines.neural.nuvo import Nuvo
from baselines.neural.nuvo_training import NuvoNetworks, NuvoTrainer, encoded
from parapoint import PointCloud
from parapoint.errors import InputError
from parapoint.learned.presets import Preset
from parapoint.surfaces.surface import Mesh
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
    assert result.report["losses"] == result.trace[-1].values
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


@pytest.mark.parametrize("value", [0, -1, 1e999, "9", True])
@pytest.mark.parametrize("field", ["points", "iterations", "subset", "time_budget"])
def test_a_budget_that_a_training_would_refuse_is_refused_at_once(field, value):
    with pytest.raises(InputError, match=field):
        FAM(**{field: value})


@pytest.mark.parametrize("field", ["points", "subset"])
def test_fewer_points_than_a_fit_takes_are_refused_at_once(field):
    FAM(**{field: 100})
    with pytest.raises(InputError, match=f"{field} must be a whole number of at least 100"):
        FAM(**{field: 99})


def test_the_rivals_train_on_all_points_as_they_are():
    """Their papers have neither noise, nor a warm-up, nor a last phase."""
    for method in (FAM, Nuvo):
        assert method.schedule.perturbation == 0
        assert method.schedule.warm_up == 0
        assert method.schedule.all_from == 1


def test_the_encoding_is_the_point_and_its_waves_of_four_octaves():
    x = torch.tensor([[[1 / 32, 1 / 3]]], dtype=torch.float64)
    found = encoded(x)[0, 0].numpy()
    wanted = [1 / 32, 1 / 3]
    for times in (2, 4, 8, 16):
        wanted += [np.sin(times * np.pi / 32), np.sin(times * np.pi / 3)]
        wanted += [np.cos(times * np.pi / 32), np.cos(times * np.pi / 3)]
    np.testing.assert_allclose(found, wanted, atol=1e-12)


@pytest.mark.parametrize("method", [FAM, Nuvo])
def test_the_map_is_in_the_unit_of_the_surface(method):
    mesh = irregular_disk()
    small = method(points=150, subset=100, iterations=2)
    maps = [
        small.parameterize(Mesh(unit * mesh.vertices, mesh.faces), seed=0).uv
        for unit in (1.0, 1024.0)
    ]
    np.testing.assert_allclose(maps[1], 1024 * maps[0], rtol=1e-5, atol=1e-2)


class Known:
    """In the place of a trainer: its map leaves the third coordinate out."""

    device, weights, divergences, iteration = "cpu", {}, 0, 1
    networks = SimpleNamespace(parameterization=lambda points: points[:, :2])

    def __init__(self, points, normals, preset, **_):
        type(self).given = points, normals
        self.subset = preset.subset

    def run(self):
        yield SimpleNamespace(iteration=1, seconds=0.0, losses={"total": 1.0}, progress=1.0)


@pytest.mark.parametrize("kind", [Mesh, PointCloud])
def test_the_networks_know_the_surface_in_a_ball_of_radius_1_around_the_origin(kind):
    """Of a cube somewhere, with a side of 10."""
    corners = np.array([[x, y, z] for x in (0, 10) for y in (0, 10) for z in (0, 10)])
    inside = np.random.default_rng(0).uniform(4, 10, (142, 3))
    points = np.array([7.0, 8, 9]) + np.vstack([corners, inside])
    faces = np.arange(150).reshape(50, 3)
    surface = PointCloud(points) if kind is PointCloud else Mesh(points, faces)
    method = type("Held", (NeuralMethod,), {"trainer": lambda _: Known})(points=150, subset=120)
    result = method.parameterize(surface, seed=0)
    given, normals = Known.given
    np.testing.assert_allclose(given.min(axis=0), -(3**-0.5))
    np.testing.assert_allclose(given.max(axis=0), 3**-0.5)
    np.testing.assert_allclose(result.uv, points[:, :2] - [12, 13], atol=1e-4)
    assert (normals is None) == (kind is PointCloud)
    assert (result.report["points"], result.report["points_of_a_step"]) == (150, 120)


def test_only_a_run_without_a_time_limit_is_the_same_each_time():
    for method in (FAM, Nuvo):
        assert method().deterministic == (not torch.cuda.is_available())
        assert not method(time_budget=5.0).deterministic


def layers(sizes):
    """Weights and biases of a stack with layers of these widths."""
    return sum(a * b + b for a, b in pairwise(sizes))


def test_the_networks_have_the_layers_of_their_papers():
    def count(networks):
        return sum(of.numel() for of in networks.parameters())

    deep, narrow = [512] * 3, [512] * 2
    offset = [
        layers([channels, *hidden, 64]) + layers([64 + channels, *hidden, channels])
        for channels, hidden in ((2, deep), (3, narrow))
    ]
    wrap = layers([2, *deep, 64]) + layers([66, *deep, 6])
    made = trainer(FAMTrainer, None)
    assert count(made.networks.wrap) == wrap
    assert count(made.networks.unwrap) == layers([3, *narrow, 2])
    deform, cut = count(made.networks.deform), count(made.networks.cut)
    embedded = [layers([channels, *hidden, 64]) for channels, hidden in ((2, deep), (3, narrow))]
    assert (deform > embedded[0], cut > embedded[1]) == (True, True)
    assert (deform, cut) == tuple(offset)
    seven = [256] * 7
    octaves = 1 + 2 * 4
    textured = layers([3 * octaves, *seven, 2]) + layers([2 * octaves, *seven, 3])
    assert count(NuvoNetworks(generator())) == textured + 1  # sigma


def test_the_repulsion_of_fam_is_that_of_eight_neighbours_within_a_quarter_of_the_spacing():
    uv = torch.rand(40, 2, dtype=torch.float64, generator=generator())
    apart = torch.cdist(uv, uv).sort(dim=1).values[:, 1:9]
    side = (uv.amax(0) - uv.amin(0)).max()
    wanted = (0.25 * side / 40**0.5 - apart).clamp(min=0).sum(1).mean()
    assert wanted > 0
    assert repulsion(uv).item() == pytest.approx(wanted.item(), rel=1e-6)
    # Ten points on one place have eight others there each, as nine would; ninety are far apart.
    apart = torch.cartesian_prod(torch.arange(1.0, 11), torch.arange(1.0, 10))
    crowd = torch.cat([torch.zeros(10, 2), apart])
    assert repulsion(crowd).item() == pytest.approx(0.1 * 8 * 0.25 * 10 / 10, rel=1e-4)


def test_the_terms_of_fam_by_a_second_route():
    made = trainer(FAMTrainer, None)
    points, grid = made._batch()
    there, back = made.networks(points, grid)
    given = made.shape.points
    terms = made.terms(points, grid, given)
    far = torch.cdist(back.points, given)
    wrap = max(far.amin(0).mean(), far.amin(1).mean())
    values = torch.linalg.svdvals(there.tangents.permute(1, 2, 0)).square()
    assert terms["wrap"].item() == pytest.approx(wrap.item(), rel=1e-4)
    assert terms["distortion"].item() == pytest.approx(
        (values[:, 0] - values[:, 1]).mean().item(), rel=1e-3
    )
    assert terms["unwrap"].item() == pytest.approx(
        sum(repulsion(q).item() for q in (there.uv, back.uv, back.uv_cycle)), rel=1e-5
    )


def test_the_terms_of_nuvo_by_a_second_route(monkeypatch):
    made = trainer(NuvoTrainer, None)
    rows, grid = made._batch()
    given = made.shape.points
    turn = torch.tensor([[0.5, 0.2, -0.1], [0.1, 0.3, 0.4]])
    monkeypatch.setattr(NuvoNetworks, "texture", lambda _, x: x @ turn.T)
    monkeypatch.setattr(NuvoNetworks, "surface", lambda _, uv: 0.7 * uv @ turn + 0.1)
    terms = {name: of.item() for name, of in made.terms(rows, grid, given).items()}

    def surface(uv):
        return 0.7 * uv @ turn + 0.1

    square = (grid + 1) / 2
    (p, a, b), on = (rows @ turn.T), surface(square)
    far = torch.cdist(given, on).square()
    cosine = torch.cosine_similarity(a, b, dim=1)
    area = torch.linalg.det(torch.stack([a, b], dim=1)).abs()
    wanted = {
        "three_two_three": (surface(p) - rows[0]).square().sum(1).mean(),
        "two_three_two": (on @ turn.T - square).square().sum(1).mean(),
        "surface": far.amin(0).mean() + far.amin(1).mean(),
        "conformal": cosine.square().mean(),
        "stretch": (area - 1).square().mean(),
    }
    assert terms == pytest.approx({name: of.item() for name, of in wanted.items()}, rel=1e-3)


def test_the_weights_are_those_of_the_authors_and_of_the_reimplementation():
    assert FAMTrainer.weights == {"wrap": 1, "unwrap": 0.01, "cycle": 0.01, "distortion": 0.01}
    assert NuvoTrainer.weights == {
        "three_two_three": 1,
        "two_three_two": 1,
        "surface": 10,
        "conformal": 0.4,
        "stretch": 0.1,
    }
