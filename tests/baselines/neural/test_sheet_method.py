"""From charts of known sheets to a map: which part lies where, how large, and in which unit."""

import numpy as np
import pytest
import torch

from baselines.neural.nuvo import Nuvo
from baselines.neural.nuvo_charts_training import ChartNetworks
from baselines.neural.sheet_method import SheetMethod
from baselines.neural.sheets import Sheets
from parapoint.surfaces.surface import Mesh, PointCloud

LOWER = np.array([[-1.0, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1]])
UPPER = np.array([[-1.0, -1, 1], [1, -1, 1], [1, 0, 1], [-1, 0, 1]])
"""A square and half a square above it, in a cube whose corners are √3 from its middle."""
FACES = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
HEIGHT = 3**-0.5
"""Of the upper half square, in a ball of radius 1."""
TURNS = np.array([[[1.0, 0], [0, 1]], [[0, 1], [-1, 0]]])
"""From the sides of each chart's square to the axes."""


def moved(points):
    """Somewhere, in another unit."""
    return 3 * points + [7, 8, 9]


def plates(kind):
    """The two as a mesh, or as a cloud with three times as many points above, in this order."""
    if kind == "mesh":
        return Mesh(moved(np.concatenate([LOWER, UPPER])), FACES)
    share = np.random.default_rng(0).dirichlet([1, 1, 1, 1], 392)
    inside = [share[:96] @ LOWER, share[96:] @ UPPER]
    return PointCloud(moved(np.concatenate([LOWER, inside[0], UPPER, inside[1]])))


class Plane(torch.nn.Module):
    """A square at a height, its sides along the axes or turned by a quarter."""

    def __init__(self, height, turn):
        super().__init__()
        self.height = torch.tensor([0.0, 0.0, height])
        self.turn = torch.as_tensor(turn).float()

    def forward(self, x):
        made = torch.nn.functional.pad(x @ self.turn, (0, 1))
        return torch.cat([made[:1] + self.height, made[1:]])


class Planes(Sheets):
    """One below the lower square and one above the upper half square; they do not learn."""

    def __init__(self):
        super().__init__([Plane(-HEIGHT - 0.1, TURNS[0]), Plane(HEIGHT + 0.2, TURNS[1])])
        self.unused = torch.nn.Parameter(torch.zeros(()))

    def terms(self, given, count, _):
        self.given, self.count = given, count
        return {"none": 0 * self.unused}


class Held(SheetMethod):
    """Maps with `Planes`, which it keeps."""

    planes = Planes()

    def networks(self, _):
        return self.planes


def assert_each_part_is_in_its_square(result, surface, shares):
    """Squares from -1 to 1 in the ball become squares of their shares, the larger one first."""
    lower, upper = slice(4), slice(4, 8)
    if isinstance(surface, PointCloud):
        lower, upper = slice(100), slice(100, 400)
        points, uv = surface.points, result.uv
    else:
        points, uv = surface.vertices, np.empty((8, 2))
        uv[surface.faces] = result.uv[result.corners]
    radius = 3 * np.sqrt(3)
    apart = []
    for part, share, turn in zip((lower, upper), shares, TURNS, strict=True):
        place = (points[part, :2] - [7, 8]) / radius @ turn.T
        apart.append(uv[part] - radius * (place + 1) / 2 * np.sqrt(share))
        np.testing.assert_allclose(apart[-1], apart[-1][:1].repeat(len(place), axis=0), atol=1e-4)
    np.testing.assert_allclose(apart[np.argmax(shares)], 0, atol=1e-4)
    boxes = [(uv[part].min(axis=0), uv[part].max(axis=0)) for part in (lower, upper)]
    assert (boxes[0][1] < boxes[1][0]).any() or (boxes[1][1] < boxes[0][0]).any()


KINDS = pytest.mark.parametrize(
    ("kind", "shares"), [("mesh", (2 / 3, 1 / 3)), ("cloud", (1 / 4, 3 / 4))]
)


@KINDS
def test_each_part_lies_on_its_sheet_as_large_as_its_share_of_the_surface(kind, shares):
    surface = plates(kind)
    method = Held(points=400, subset=150, iterations=1)
    result = method.parameterize(surface, seed=0)
    assert_each_part_is_in_its_square(result, surface, shares)
    below = {"mesh": 4 / 8, "cloud": 100 / 400}[kind]  # at 0.1 from their sheet, the others at 0.2
    wanted = np.sqrt(below * 0.1**2 + (1 - below) * 0.2**2)
    assert result.report["rms_distance"] == pytest.approx(wanted, rel=1e-4)
    assert result.report["charts"] == 2
    assert result.report["points_of_a_step"] == 150


@pytest.mark.parametrize(("subset", "count"), [(150, 150), (1000, 400)])
def test_the_sheets_are_fitted_in_a_ball_of_radius_1_to_as_many_points_as_are_said(subset, count):
    method = Held(points=400, subset=subset, iterations=1)
    method.parameterize(plates("cloud"), seed=0)
    assert method.planes.given.shape == (count, 3)
    assert method.planes.count == count
    if count == 400:
        low, high = method.planes.given.amin(dim=0), method.planes.given.amax(dim=0)
        np.testing.assert_allclose([*high, *-low], HEIGHT, rtol=1e-6)


@KINDS
def test_each_part_lies_in_its_most_probable_chart_as_large_as_its_share(monkeypatch, kind, shares):
    """Several charts of Nuvo, whose networks know the way."""

    def known(_, points):
        is_upper = (points[:, 2] > 0).float()
        return torch.stack([1 - is_upper, is_upper], dim=1).clamp(min=1e-9).log()

    def texture(_, chart, x):  # to the square from 0 to 1
        turned = x[:, :, :2] @ torch.as_tensor(TURNS[chart].T).float()
        return torch.cat([(turned[:1] + 1) / 2, turned[1:] / 2])

    monkeypatch.setattr(ChartNetworks, "log_probabilities", known)
    monkeypatch.setattr(ChartNetworks, "texture", texture)
    surface = plates(kind)
    result = Nuvo(charts=2, points=400, subset=150, iterations=1).parameterize(surface, seed=0)
    assert_each_part_is_in_its_square(result, surface, shares)
    assert result.report["charts"] == 2
    assert result.report["points_of_a_step"] == 128  # at most
