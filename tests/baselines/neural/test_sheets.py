"""Networks that fold squares onto a surface: the fit, preimages, charts; what each one changes."""

import numpy as np
import pytest
import torch

from baselines.neural.atlasnet import AtlasNet
from baselines.neural.atlasnet_networks import AtlasNetworks, chamfer
from baselines.neural.diffsr_networks import DiffSRNetworks
from baselines.neural.flattening_net import FlatteningNet
from baselines.neural.foldingnet import FoldingNet
from baselines.neural.foldingnet_networks import FoldingNetworks, TwoFolds
from baselines.neural.nsm import NSM
from baselines.neural.nuvo import Nuvo
from baselines.neural.sheets import (
    corner_rows,
    face_charts,
    fitted,
    nearest_sheets,
    packed,
    preimages,
)
from parapoint import clock
from parapoint.errors import InputError
from parapoint.surfaces.surface import PointCloud
from parapoint.testing import irregular_disk

SMALL = {"points": 150, "subset": 120}


def generator():
    return torch.Generator().manual_seed(0)


def bowl(x):
    """A sheet with known preimages: (u, v) to (u, v, (u² + v²) / 2), with its tangents."""
    (u, v), tangents = x[0].T, x[1:]
    height = (u**2 + v**2) / 2
    rise = (tangents * x[:1]).sum(dim=2, keepdim=True)
    point = torch.stack([u, v, height], dim=1)[None]
    return torch.cat([point, torch.cat([tangents, rise], dim=2)])


def test_the_preimage_of_a_point_of_a_sheet_is_its_place():
    places = 1.9 * torch.rand(300, 2, generator=generator()) - 0.95
    found, distance = preimages(bowl, bowl(places[None])[0])
    assert (found - places).abs().max() < 1e-5
    assert distance.max() < 1e-5


def test_the_preimage_of_a_point_beside_a_sheet_is_below_it_or_on_its_border():
    beside = [[1.2, 0.0, 0.5], [-1.2, 0.0, 0.5], [0.0, 1.2, 0.5], [0.0, -1.2, 0.5]]
    points = torch.tensor([[0.0, 0.0, -0.2], [0.5, 0.5, 0.25], *beside])
    normal = torch.tensor([-0.5, -0.5, 1.0])
    points[1] += 0.1 * normal
    found, distance = preimages(bowl, points)
    np.testing.assert_allclose(found[:2], [[0, 0], [0.5, 0.5]], atol=1e-3)
    np.testing.assert_allclose(found[2:], [[1, 0], [-1, 0], [0, 1], [0, -1]], atol=1e-3)
    np.testing.assert_allclose(distance, [0.2, 0.1 * normal.norm(), *[0.2] * 4], rtol=1e-4)


def test_each_point_goes_to_the_nearest_sheet():
    def lifted(x):
        made = bowl(x)
        return torch.cat([made[:1] + torch.tensor([0.0, 0.0, 5.0]), made[1:]])

    points = torch.tensor([[0.1, 0.2, 0.0], [0.1, 0.2, 5.0]])
    chart, uv, _ = nearest_sheets([bowl, lifted], points)
    assert chart.tolist() == [0, 1]
    np.testing.assert_allclose(uv, 2 * [[0.1, 0.2]], atol=0.05)


def test_charts_are_packed_apart_each_by_its_area():
    rng = np.random.default_rng(0)
    chart = rng.integers(0, 3, 600)
    chart[chart == 1] = 2  # a sheet that no point is on
    uv = packed(rng.uniform(-1, 1, (600, 2)), chart, np.array([0.8, 0.0, 0.2]))
    first, second = (uv[chart == which] for which in (0, 2))
    assert np.ptp(first, axis=0) == pytest.approx(np.sqrt(0.8) * np.ones(2), abs=0.02)
    assert np.ptp(second, axis=0) == pytest.approx(np.sqrt(0.2) * np.ones(2), abs=0.02)
    boxes = [(of.min(axis=0), of.max(axis=0)) for of in (first, second)]
    assert (boxes[0][1] < boxes[1][0]).any() or (boxes[1][1] < boxes[0][0]).any()


def test_squares_of_equal_area_fill_a_square():
    corners = np.tile([[-1, -1], [1, 1]], (16, 1))
    uv = packed(corners, np.arange(16).repeat(2), np.full(16, 1 / 16))
    np.testing.assert_allclose(uv[1::2] - uv[::2], 0.25)
    np.testing.assert_allclose(np.ptp(uv, axis=0), 1, atol=0.1)  # and the room between them


def test_a_face_lies_in_the_chart_of_most_corners_and_vertices_are_doubled_at_the_border():
    faces = np.array([[0, 1, 2], [1, 2, 3], [3, 4, 5]])
    of_face = face_charts(np.array([0, 0, 1, 1, 2, 0]), faces)
    assert of_face.tolist() == [0, 1, 1]
    corners, vertex, of_row = corner_rows(of_face, faces)
    assert vertex[corners].tolist() == faces.tolist()
    assert (of_row[corners] == of_face[:, None]).all()
    assert np.bincount(vertex).tolist() == [1, 2, 2, 1, 1, 1]


def test_the_chamfer_distance_by_hand():
    made, given = torch.tensor([[0.0, 0, 0], [1, 0, 0]]), torch.tensor([[0.0, 0, 0], [0, 3, 0]])
    assert chamfer(made, given).item() == pytest.approx((0 + 1) / 2 + (0 + 9) / 2)


@pytest.mark.parametrize(
    "method", [AtlasNet(**SMALL, iterations=100), FoldingNet(**SMALL, iterations=100)]
)
def test_the_loss_falls_and_the_report_says_what_ran(method):
    mesh = irregular_disk()
    result = method.parameterize(mesh, seed=0)
    totals = [row.values["total"] for row in result.trace]
    assert totals[-1] < 0.3 * totals[0]
    assert result.report["iterations"] == 100
    assert result.report["rms_distance"] < 0.2
    assert result.corners.shape == mesh.faces.shape


def test_a_fit_ends_where_its_time_is_over(monkeypatch):
    """A second passes at each look at the clock: when a step begins, and when it has ended."""
    monkeypatch.setattr(clock, "worked", map(float, range(100)).__next__)
    network = torch.nn.Linear(2, 1)
    steps = list(fitted(network, lambda: {"all": network.weight.square().sum()}, 100, 4.5))
    assert [step.seconds for step in steps] == [2, 4]


def test_time_ends_a_fit():
    networks = FoldingNetworks([TwoFolds(generator())])
    given = torch.rand(100, 3, generator=generator())
    trace = list(fitted(networks, lambda: networks.terms(given, 50, generator()), 10**9, 0.2))
    assert 1 <= len(trace) < 10_000
    assert not FoldingNet(time_budget=1.0).deterministic
    assert FoldingNet().deterministic


def test_a_gpu_breaks_the_promise_of_those_alone_that_train_on_it(monkeypatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    for method in (FoldingNet(), FlatteningNet(), NSM()):
        assert method.deterministic
    assert not Nuvo().deterministic


def test_more_squares_are_more_charts_nearer_to_the_surface():
    """What AtlasNet is for; a cloud of two balls that a single sheet has to bridge."""
    ball = np.random.default_rng(0).normal(size=(200, 3))
    ball /= np.linalg.norm(ball, axis=1, keepdims=True)
    cloud = PointCloud(np.concatenate([ball, ball + np.array([3, 0, 0])]))
    one, many = (
        AtlasNet(points=400, subset=200, iterations=80, charts=charts).parameterize(cloud, seed=0)
        for charts in (1, 6)
    )
    assert one.report["charts"] == 1
    assert many.report["charts"] > 2
    assert many.report["rms_distance"] < 0.8 * one.report["rms_distance"]


def test_the_second_folding_works_on_what_the_first_has_made():
    fold = TwoFolds(generator())
    x = torch.rand(3, 5, 2, generator=generator())
    torch.testing.assert_close(fold(x), fold.second(fold.first(x)))
    assert len(fold.second.layers[0]) == 4  # three coordinates and a 1


@pytest.mark.parametrize("kind", [AtlasNetworks, DiffSRNetworks])
def test_the_sheets_share_the_places_of_a_step(kind):
    networks, drawn = kind(3, generator()), []
    for sheet in networks.sheets:
        sheet.register_forward_hook(lambda _, x, __: drawn.append(x[0].shape[1]))
    networks.terms(torch.rand(50, 3, generator=generator()), 100, generator())
    assert drawn == [34, 34, 34]


def test_sheets_have_weights_of_their_own():
    sheets = AtlasNetworks(3, generator()).sheets
    x = torch.zeros(1, 1, 2)
    made = torch.stack([sheet(x)[0, 0] for sheet in sheets])
    assert len(torch.unique(made, dim=0)) == 3


def test_one_square_will_do_and_so_will_64():
    assert [AtlasNet(charts=charts).charts for charts in (1, 64)] == [1, 64]


@pytest.mark.parametrize("charts", [0, 65])
def test_numbers_of_charts_out_of_range_are_refused(charts):
    with pytest.raises(InputError, match="charts must be a whole number"):
        AtlasNet(charts=charts)
