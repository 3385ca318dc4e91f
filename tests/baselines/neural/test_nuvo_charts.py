"""Nuvo with several charts: its terms by hand, its networks, what probabilities change."""

import numpy as np
import pytest
import torch

from baselines.neural.nuvo import Nuvo
from baselines.neural.nuvo_charts_training import WEIGHTS, ChartNetworks, chart_terms
from baselines.neural.nuvo_training import NuvoNetworks, NuvoTrainer
from baselines.neural.stepping import trained
from parapoint.errors import InputError
from parapoint.surfaces.normals import tangent_frames
from parapoint.surfaces.surface import PointCloud
from parapoint.testing import check_method, irregular_disk, sphere

SMALL = {"points": 300, "subset": 100}


def generator():
    return torch.Generator().manual_seed(0)


def scattered():
    return np.random.default_rng(0).normal(size=(150, 3)) * [1.0, 1.0, 0.1]


def two_squares():
    """(3, 800, 3) points of two squares, far apart, with tangents along their sides."""
    at = torch.rand(800, 3, generator=generator()) * torch.tensor([1.0, 1.0, 0.0])
    at[400:, 0] += 5.0
    axes = torch.eye(3)[:2, None].expand(2, 800, 3)
    return torch.cat([at[None], axes])


class TwoSheets:
    """The right maps of two squares: chart k holds what is at x = 5 k, sides along the axes."""

    sigma = torch.ones(2)

    def log_probabilities(self, points):
        is_second = (points[:, 0] > 2.5).float()
        return torch.stack([1 - is_second, is_second], dim=1).clamp(min=1e-9).log()

    def texture(self, chart, x):
        moved = x[:1, :, :2] - torch.tensor([5.0 * chart, 0.0])
        return torch.cat([moved, x[1:, :, :2]])

    def surface(self, chart, uv):
        return torch.cat([uv + torch.tensor([5.0 * chart, 0.0]), torch.zeros(len(uv), 1)], dim=1)


def values(networks, rows=None):
    rows = two_squares() if rows is None else rows
    square = torch.rand(2, 300, 2, generator=generator())
    return {k: v.item() for k, v in chart_terms(networks, rows, square, rows[0]).items()}


def test_two_charts_that_are_right_lose_nothing_but_their_size():
    found = values(TwoSheets())
    spread = found.pop("cluster")
    assert spread == pytest.approx(2 / 12, abs=0.01)  # the variance of a unit square
    assert found.pop("surface") < 0.01  # between samples
    assert found == pytest.approx(dict.fromkeys(found, 0.0), abs=1e-5)


def test_a_point_counts_in_each_chart_by_its_probability():
    class Undecided(TwoSheets):
        def log_probabilities(self, points):
            return torch.log(torch.tensor([0.75, 0.25])).expand(len(points), 2)

    class Shifted(Undecided):
        def surface(self, chart, uv):
            return super().surface(chart, uv) + torch.tensor([0.0, 0.0, 2.0 * chart])

    plain, found = values(Undecided()), values(Shifted())
    # t and s of either chart invert each other everywhere; of the shifted one a
    # quarter counts.
    assert plain["three_two_three"] == pytest.approx(0, abs=1e-9)
    assert found["three_two_three"] == pytest.approx(0.25 * 4)
    assert plain["entropy"] == pytest.approx(-(np.log(0.75) + np.log(0.25)) / 2)
    assert plain["cluster"] == pytest.approx(2 / 12 + 2.5**2, abs=0.05)  # no clusters


def test_charts_that_swap_their_places_lose_by_entropy_alone():
    class Swapped(TwoSheets):
        def log_probabilities(self, points):
            return super().log_probabilities(points).flip(1)

    found, right = values(Swapped()), values(TwoSheets())
    assert found["entropy"] > 10
    assert {k for k in found if abs(found[k] - right[k]) > 1e-5} == {"entropy"}


def test_the_terms_of_one_chart_are_those_of_the_single_chart():
    made = ChartNetworks(1, generator())

    class Single:
        sigma = made.sigma[0]

        def texture(self, x):
            return made.texture(0, x)

        def parameterization(self, points):
            return made.texture(0, points[None])[0]

        def surface(self, uv):
            return made.surface(0, uv)

    points = torch.nn.functional.normalize(torch.randn(60, 3, generator=generator()), dim=1)
    frames = torch.as_tensor(tangent_frames(points.double().numpy())).float()
    rows = torch.cat([points[None], frames])
    square = torch.rand(1, 50, 2, generator=generator())
    found = chart_terms(made, rows, square, points)
    trainer = NuvoTrainer.__new__(NuvoTrainer)
    trainer.networks = Single()
    wanted = trainer.terms(rows, 2 * square[0] - 1, points)
    assert found["entropy"].item() == pytest.approx(0, abs=1e-6)
    for name, of in wanted.items():
        torch.testing.assert_close(found[name], of, rtol=1e-4, atol=1e-6)


def test_networks_give_probabilities_and_places_in_the_unit_square():
    made = ChartNetworks(3, generator())
    points = torch.randn(20, 3, generator=generator())
    torch.testing.assert_close(made.log_probabilities(points).exp().sum(1), torch.ones(20))
    uv = made.texture(2, points[None])[0]
    assert ((uv > 0) & (uv < 1)).all()
    assert (made.texture(1, points[None])[0] != uv).any()


def test_two_squares_become_two_charts():
    rows, networks, draws = two_squares(), ChartNetworks(2, generator()), generator()
    rows = torch.cat([(rows[:1] - torch.tensor([3.0, 0.5, 0.0])) / 3.2, rows[1:]])

    def terms():
        chosen = torch.randperm(800, generator=draws)[:64]
        square = torch.rand(2, 32, 2, generator=draws)
        return chart_terms(networks, rows[:, chosen], square, rows[0, chosen])

    list(trained(networks, terms, 1e-2, 80, None))
    with torch.no_grad():
        chart = networks.log_probabilities(rows[0]).argmax(dim=1)
    assert chart[:400].float().mean() == pytest.approx(round(chart[0].item()), abs=0.02)
    assert chart[400:].float().mean() == pytest.approx(1 - round(chart[0].item()), abs=0.02)


@pytest.mark.parametrize("surface", [sphere(), PointCloud(scattered())])
def test_charts_are_packed_apart_and_shared_by_faces(surface):
    result = Nuvo(charts=3, iterations=5, **SMALL).parameterize(surface, seed=0)
    assert result.report["charts"] <= 3
    assert [row.iteration for row in result.trace] == [1, 2, 3, 4, 5]
    assert result.report["losses"] == result.trace[-1].values
    assert np.isfinite(result.uv).all()


def test_several_charts_conform():
    check_method(Nuvo(charts=3, points=120, subset=100, iterations=2), irregular_disk())


def test_a_single_chart_is_as_it_was():
    mesh = irregular_disk()
    uv = [
        Nuvo(points=150, subset=100, iterations=2, **of).parameterize(mesh, seed=0).uv
        for of in ({}, {"charts": 1})
    ]
    np.testing.assert_array_equal(*uv)


@pytest.mark.parametrize(
    "stack",
    [
        NuvoNetworks(generator()).texture_stack,
        NuvoNetworks(generator()).surface_stack,
        ChartNetworks(2, generator()).chooser,
        ChartNetworks(2, generator()).surfaces[1],
    ],
)
def test_between_its_layers_a_network_cuts_what_is_negative(stack):
    x = torch.randn(20, len(stack.layers[0]) - 1, generator=generator())
    with torch.no_grad():
        found = stack(x[None])[0]
        for number, layer in enumerate(stack.layers):
            x = torch.nn.functional.pad(x.clamp(min=0) if number else x, (0, 1), value=1.0) @ layer
    torch.testing.assert_close(found, x)


def test_several_charts_weigh_the_terms_as_one_does():
    assert NuvoTrainer.weights | {"entropy": 0.05, "cluster": 0.1} == WEIGHTS


def test_the_terms_are_weighed_and_their_sum_falls(monkeypatch):
    small = {"charts": 2, "points": 120, "subset": 100}
    totals = [
        row.values["total"]
        for row in Nuvo(**small, iterations=8).parameterize(irregular_disk(), seed=0).trace
    ]
    assert totals[-1] < 0.7 * totals[0]
    monkeypatch.setattr(
        "baselines.neural.nuvo_charts.chart_terms",
        lambda networks, *_: dict.fromkeys(WEIGHTS, 2 * networks.sigma.mean()),  # each is 2
    )
    (row,) = Nuvo(**small, iterations=1).parameterize(irregular_disk(), seed=0).trace
    weighed = {name: 2 * weight for name, weight in WEIGHTS.items()}
    assert row.values == pytest.approx(weighed | {"total": sum(weighed.values())})


def test_sixteen_charts_will_do():
    assert Nuvo(charts=16).charts == 16


@pytest.mark.parametrize("charts", [0, 17])
def test_a_number_of_charts_out_of_range_is_refused(charts):
    with pytest.raises(InputError, match="charts must be a whole number of at least 1 and at most"):
        Nuvo(charts=charts)
