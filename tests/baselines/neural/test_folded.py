"""DiffSR, EleStruc, GTIF and TearingNet: what each adds to AtlasNet or FoldingNet."""

import numpy as np
import pytest
import torch

from baselines.neural.atlasnet_networks import AtlasNetworks
from baselines.neural.diffsr import DiffSR
from baselines.neural.diffsr_networks import DiffSRNetworks, deformation, surface_area
from baselines.neural.elestruc import EleStruc
from baselines.neural.elestruc_networks import EleStrucNetworks
from baselines.neural.grids import FAR, Grid, GridNetworks
from baselines.neural.gtif import GTIF
from baselines.neural.gtif_networks import FilteredGrid
from baselines.neural.sheets import fitted, preimages, random_places, with_axes
from baselines.neural.tearingnet import TearingNet
from baselines.neural.tearingnet_networks import STEPS, TornGrid
from parapoint.errors import InputError
from parapoint.learned.losses import wrap_loss
from parapoint.testing import irregular_disk

SIDE = 15
METHODS = [DiffSR, EleStruc, GTIF, TearingNet]


def generator(seed=0):
    return torch.Generator().manual_seed(seed)


def ball(count=200):
    points = torch.randn(count, 3, generator=generator())
    return points / points.norm(dim=1, keepdim=True)


def flat(count=200):
    return torch.nn.functional.pad(random_places(count, generator()), (0, 1))


def train(networks, points, iterations):
    draws = generator()
    steps = fitted(networks, lambda: networks.terms(points, 100, draws), iterations, None)
    return [step.values["total"] for step in steps]


@pytest.mark.parametrize("kind", METHODS)
def test_the_loss_falls(kind):
    mesh = irregular_disk()
    result = kind(points=150, subset=120, iterations=20).parameterize(mesh, seed=0)
    totals = [row.values["total"] for row in result.trace]
    assert totals[-1] < 0.8 * totals[0]
    assert result.corners.shape == mesh.faces.shape
    assert not kind(time_budget=1.0).deterministic


@pytest.mark.parametrize("kind", [DiffSR, EleStruc])
def test_numbers_of_charts_out_of_range_are_refused(kind):
    with pytest.raises(InputError, match="charts must be a whole number"):
        kind(charts=0)


def test_two_dimensions_will_do_and_so_will_ten():
    assert [EleStruc(dimension=of).dimension for of in (2, 10)] == [2, 10]


@pytest.mark.parametrize("dimension", [1, 11])
def test_dimensions_out_of_range_are_refused(dimension):
    with pytest.raises(InputError, match="dimension must be a whole number"):
        EleStruc(dimension=dimension)


def test_the_metric_terms_of_known_maps():
    def found(*axes):
        rows = torch.tensor(axes)[:, None].expand(2, 50, 3)
        return [of.item() for of in deformation(rows)]

    assert found((0.0, 3.0, 0.0), (3.0, 0.0, 0.0)) == pytest.approx([0, 4 * 9])
    assert found((2.0, 0.0, 0.0), (0.0, 0.5, 0.0)) == pytest.approx([3.75**2, 4])
    assert found((1.0, 0.0, 0.0), (1.0, 1.0, 0.0)) == pytest.approx([1 + 1, 4])  # a shear


def test_uneven_stretch_counts_and_the_size_of_a_square_does_not():
    axes = torch.tensor([[1.0, 0, 0], [0, 1, 0]])[:, None] * torch.tensor([1.0, 2.0])[:, None]
    uneven = deformation(axes)[0].item()  # E = G = 1 and 4, A = 2.5
    assert uneven == pytest.approx(2 * (1.5 / 2.5) ** 2)
    assert deformation(0.1 * axes)[0].item() == pytest.approx(uneven, rel=1e-4)


def test_the_area_of_a_surface_is_known_from_its_points():
    assert surface_area(ball(1000)).item() == pytest.approx(4 * np.pi, rel=0.05)
    assert surface_area(flat(1000)).item() == pytest.approx(4, rel=0.15)  # wider at the border


def test_the_metric_terms_make_squares_more_regular():
    """AtlasNet's squares stretch one way or fold up; DiffSR's do less of it, and cover as much."""
    regular, plain = DiffSRNetworks(4, generator()), AtlasNetworks(4, generator())
    worst = []
    for networks in (regular, plain):
        train(networks, flat(), 120)
        rows = [sheet(with_axes(random_places(500, generator()))) for sheet in networks.sheets]
        worst.append(max(deformation(of[1:].detach())[0].item() for of in rows))
    assert worst[0] < 0.5 * worst[1]


def test_squares_that_are_larger_than_the_surface_together_cost_as_much_as_they_are_too_large():
    networks = DiffSRNetworks(2, generator())
    axes = torch.eye(3)[:2]
    networks.sheets = torch.nn.ModuleList([Linear(axes), Linear(axes)])
    points = flat(1000)
    terms = networks.terms(points, 400, generator())
    assert terms["chamfer"].item() < 0.01  # the sheets lie on the points
    cost = terms["overlap"].item()
    assert cost == pytest.approx(1e-2 * (2 * 4 - surface_area(points).item()) ** 2, rel=1e-4)
    uneven = torch.tensor([[2.0], [0.5]]) * axes
    networks.sheets = torch.nn.ModuleList([Linear(uneven), Linear(axes)])
    cost = networks.terms(points, 400, generator())["deformation"].item()
    assert cost == pytest.approx(1e-3 * 3.75**2 / 2)
    networks.sheets = torch.nn.ModuleList([Linear(0.5 * axes), Linear(0.5 * axes)])
    assert networks.terms(points, 400, generator())["overlap"].item() == 0


class Linear(torch.nn.Module):
    """A sheet that is a plane."""

    def __init__(self, axes):
        super().__init__()
        self.axes = axes

    def forward(self, x):
        return x @ self.axes


def test_a_structure_starts_as_the_square_and_learns():
    sheet = EleStrucNetworks(1, 4, generator()).sheets[0]
    x = with_axes(random_places(20, generator()))
    torch.testing.assert_close(sheet.elementary(x), torch.nn.functional.pad(x, (0, 2)))


def test_a_learned_structure_fits_better_than_the_square_in_its_place():
    ends = []
    for is_learned in (True, False):
        networks = EleStrucNetworks(2, 3, generator())
        for sheet in networks.sheets:
            sheet.deformation.requires_grad_(is_learned)
        ends.append(np.mean(train(networks, ball(100), 200)[-10:]))
    assert ends[0] < 0.95 * ends[1]


def test_the_graph_joins_neighbours_in_the_grid_alone_by_weights_that_sum_to_one():
    sheet = FilteredGrid(generator(), SIDE)
    grid = sheet.grid
    folded = sheet.fold(grid.places[None])[0].detach()
    weights = sheet.adjacency(folded).detach()
    torch.testing.assert_close(weights.sum(dim=1), torch.ones(SIDE**2))
    assert (weights[~grid.is_near] == 0).all()
    steps = (grid.places[:, None] - grid.places[grid.near]).abs() * (SIDE - 1) / 2
    assert steps[grid.is_near].max().item() == pytest.approx(2, abs=1e-4)
    assert grid.is_near.sum(dim=1).max() == 24
    moved = folded.clone()
    moved[SIDE * 7 + 7] += 100.0  # where it is far from all, none of them joins it
    away = grid.is_near & (grid.near == SIDE * 7 + 7)
    assert sheet.adjacency(moved)[away].max() < 1e-3 < weights[away].min()


def test_the_filter_is_a_polynomial_of_the_graph_whose_shares_sum_to_one():
    sheet = FilteredGrid(generator(), 5)
    grid = sheet.grid
    with torch.no_grad():
        folded = sheet.fold(grid.places[None])[0]
        graph = torch.zeros(25, 25)
        graph.scatter_add_(1, grid.near, sheet.adjacency(folded))
        powers = torch.stack([folded, graph @ folded, graph @ graph @ folded])
        torch.testing.assert_close(sheet.nodes()[0], powers.mean(dim=0))  # as it starts
        sheet.filter.copy_(torch.tensor([0.5, 0.2]))
        wanted = (torch.tensor([0.3, 0.5, 0.2])[:, None, None] * powers).sum(dim=0)
        torch.testing.assert_close(sheet.nodes()[0], wanted)


def test_filtering_brings_the_folded_grid_nearer_to_the_surface():
    sheet = FilteredGrid(generator(), SIDE)
    train(GridNetworks(sheet), ball(), 150)
    with torch.no_grad():
        coarse = wrap_loss(sheet.fold(sheet.grid.places[None])[0], ball())
        assert wrap_loss(sheet.nodes()[0], ball()) < 0.95 * coarse
        sheet.filter.zero_()
        assert wrap_loss(sheet.nodes()[0], ball()) == coarse


def test_a_sheet_through_a_grid_is_bilinear():
    class Bilinear(FilteredGrid):
        def nodes(self):
            u, v = self.grid.places.T
            return torch.stack([u, v, u * v], dim=1), self.grid.all_cells()

    sheet = Bilinear(generator(), 3)
    x = with_axes(random_places(50, generator()))
    (u, v), made = x[0].T, sheet(x)
    # On each of the four cells, u v is bilinear itself.
    torch.testing.assert_close(made[0], torch.stack([u, v, u * v], dim=1))
    torch.testing.assert_close(made[1, :, 2], v)
    torch.testing.assert_close(made[2, :, 2], u)


class Gap(torch.nn.Module):
    """A fold to a plane whose half above u = 0 lies `width` farther along."""

    def __init__(self, width):
        super().__init__()
        self.width = width

    def forward(self, x):
        made = torch.nn.functional.pad(x, (0, 1))
        made[0, :, 0] += self.width * (x[0, :, 0] > 0)
        return made


def torn_grid(width):
    sheet = TornGrid(generator(), SIDE + 1)  # no point at u = 0
    sheet.fold = Gap(width)
    return sheet


def test_a_cell_whose_edges_are_pulled_apart_tears_and_has_no_preimages():
    sheet = torn_grid(1.0)
    whole = sheet.nodes()[1]
    assert not whole[SIDE // 2].any()
    assert whole.sum() == SIDE * (SIDE - 1)
    points = torch.tensor([[0.3, 0.2, 0.0], [0.7, 0.2, 0.0], [-0.5, 0.1, 0.0]])
    found, distance = preimages(sheet, points)
    half = 1 / SIDE
    assert found[0, 0] <= -half + 1e-6  # nearest is the border of the tear, on either side
    assert found[1, 0] >= half - 1e-6
    assert distance[:2].min() > 0.2
    np.testing.assert_allclose(found[2], [-0.5, 0.1], atol=1e-4)
    place, *tangents = sheet(with_axes(torch.zeros(1, 2)))
    assert (place == FAR).all()
    assert not torch.stack(tangents).any()  # no way leads out of it


def test_a_sheet_that_is_folded_flat_still_has_nearest_places():
    """It is a line, and so large that nothing added to its squares is felt."""

    def line(x: torch.Tensor) -> torch.Tensor:
        return torch.nn.functional.pad(1000 * x.sum(dim=2, keepdim=True), (0, 2))

    points = torch.tensor([[0.0, 0.0, 0.0], [500.0, 3.0, 0.0]])
    found, distance = preimages(line, points)
    assert found.isfinite().all()
    np.testing.assert_allclose(distance, [0, 3], atol=1000 / 16)


@pytest.mark.parametrize(("medians", "is_torn"), [(1.9, False), (2.1, True)])
def test_an_edge_tears_where_it_is_longer_than_two_medians(medians, is_torn):
    width = (medians - 1) * 2 / SIDE
    assert torn_grid(width).nodes()[1].all() != is_torn


def test_edges_of_median_length_weigh_as_much_as_a_standard_deviation():
    sheet = torn_grid(0.0)
    weights = sheet.weights(3 * sheet.grid.places)
    is_near = sheet.grid.is_near
    torch.testing.assert_close(weights, torch.exp(torch.tensor(-0.5)) * is_near, rtol=1e-3, atol=0)


def test_without_tears_the_sheet_bridges_the_gap():
    sheet = torn_grid(1.0)
    points = torch.tensor([[0.5, 0.2, 0.0]])
    assert preimages(sheet, points)[1].item() > 0.3
    sheet.whole_cells = lambda _: sheet.grid.all_cells()
    assert preimages(sheet, points)[1].item() < 1e-3
    assert torn_grid(0.0).nodes()[1].all()


def test_the_tearing_network_sees_the_fold_and_moves_the_grid_before_the_second_one():
    sheet = torn_grid(1.0)
    assert torch.equal(sheet.torn(), sheet.grid.places)

    class Half(torch.nn.Module):
        def forward(self, seen):
            return 0.5 * seen[:, :, 2:4]  # of where the point was folded to

    sheet.tear = Half()
    places = sheet.grid.places
    right = (places[:, :1] > 0) * torch.tensor([0.5, 0.0])
    torch.testing.assert_close(sheet.torn(), 1.5 * places + right)


def test_the_filter_smooths_along_kept_edges_alone():
    sheet = torn_grid(1.0)
    before = sheet.fold(sheet.grid.places[None])[0]
    after = sheet.nodes()[0]
    inside = sheet.grid.is_near.all(dim=1)
    beside = sheet.grid.places[:, 0].abs() < 0.1
    torch.testing.assert_close(after[inside & ~beside], before[inside & ~beside])
    gap = (after - before)[inside & beside]
    # Away from the tear, by 0.3 of the way to the mean of the three neighbours left.
    away = 0.3 * 2 / SIDE / 3 * sheet.grid.places[inside & beside][:, 0].sign()
    torch.testing.assert_close(gap, torch.nn.functional.pad(away[:, None], (0, 2)))


def test_edges_lead_one_step_along_the_axes():
    grid = Grid.of_steps(STEPS, 4)
    assert grid.near[5].tolist() == [9, 6, 1, 4]
    assert grid.is_near[0].tolist() == [True, True, False, False]
