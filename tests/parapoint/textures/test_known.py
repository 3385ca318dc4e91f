"""Points that know nothing have no say in a texture, and normals face outwards."""

import numpy as np
import pytest

from parapoint import InputError, Mesh, Parameterization, PointCloud
from parapoint.surfaces.parameterization import Charted
from parapoint.textures.baking import baked
from parapoint.textures.known import facing_outwards, knowing
from parapoint.textures.thinning import thinned

RNG = np.random.default_rng(0)
CORNERS = np.array([[0.0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0]])
FACES = np.array([[0, 1, 2], [0, 2, 3]])
SQUARE = CORNERS[:, :2] / 5 + 0.1
PLATE = Charted(Mesh(CORNERS, FACES), Parameterization(SQUARE, FACES))
POINTS = np.column_stack([4 * RNG.random((2000, 2)), np.zeros(2000)])
UNKNOWN = RNG.random(2000) < 0.1
UP = np.tile([0.0, 0.6, 0.8], (2000, 1))


def cloud(kind: str, unknown: float) -> PointCloud:
    """Points of which a tenth have `unknown` in place of a value."""
    blank = UNKNOWN[:, None]
    if kind == "normal":
        return PointCloud(POINTS, np.where(blank, unknown, UP))
    if kind == "colour":
        return PointCloud(POINTS, attributes={"colours": np.where(blank, unknown, UP)})
    values = np.where(UNKNOWN, unknown, 100 + POINTS[:, 0])
    return PointCloud(POINTS, attributes={"intensity": values})


@pytest.mark.parametrize(
    ("kind", "unknown"), [("colour", np.nan), ("intensity", np.nan), ("intensity", np.inf)]
)
def test_a_map_is_that_of_the_points_that_have_a_value(kind, unknown, caplog) -> None:
    check_without_say(kind, unknown, caplog)


def test_a_normal_map_is_that_of_the_points_that_have_a_normal(caplog) -> None:
    check_without_say("normal", 0.0, caplog)


def check_without_say(kind: str, unknown: float, caplog) -> None:
    whole = cloud(kind, unknown)
    made = baked(PLATE, whole, kind, 32, 2)
    said = f"points without a known {kind}, which are left out: {UNKNOWN.sum()}"
    assert caplog.messages == [said]
    known = baked(PLATE, whole.chosen(~UNKNOWN), kind, 32, 2)
    np.testing.assert_array_equal(made.pixels, known.pixels)
    assert made.text == known.text
    caplog.clear()
    pieces = [whole.chosen(np.arange(2000) // 300 == k) for k in range(7)]
    found, count = thinned(pieces, kind, PLATE, 512)
    wanted, _ = thinned([whole.chosen(~UNKNOWN)], kind, PLATE, 512)
    assert count == 2000
    np.testing.assert_array_equal(found.points, wanted.points)
    assert caplog.messages == [said]
    none = whole.chosen(UNKNOWN)
    with pytest.raises(InputError, match=f"no {kind} is known at any of its points"):
        knowing(none, kind)
    with pytest.raises(InputError, match=f"no {kind} is known at any of its points"):
        thinned([none], kind, PLATE, 512)


@pytest.mark.parametrize(
    ("sides", "says"),
    [
        (np.ones(2000), []),
        (np.where(RNG.random(2000) < 0.1, -1.0, 1.0), []),  # a few of an overhang stay
        (-np.ones(2000), ["normals point into the surface of the model: all are turned"]),
        (
            RNG.choice([-1.0, 1.0], 2000),
            ["normals point to either side by chance: each is turned to the model's outside"],
        ),
    ],
)
def test_normals_face_as_the_model_does(sides, says, caplog) -> None:
    normals = sides[:, None] * UP
    found = facing_outwards(PointCloud(POINTS, normals), PLATE.mesh).normals
    np.testing.assert_array_equal(found, UP if says else normals)
    assert caplog.messages == says
    other = Mesh(CORNERS, FACES[:, ::-1])
    caplog.clear()
    found = facing_outwards(PointCloud(POINTS, -normals), other).normals
    np.testing.assert_array_equal(found, -UP if says else -normals)


@pytest.mark.parametrize("away", [1e3, 5e5, 1e9])
def test_a_stray_does_not_stretch_the_range_of_a_position_map(away) -> None:
    far = np.array([[away, -away, 0.0]])
    alone = baked(PLATE, PointCloud(POINTS), "position", 32)
    beside = baked(PLATE, PointCloud(np.concatenate([POINTS, far])), "position", 32)
    np.testing.assert_array_equal(alone.pixels, beside.pixels)
    assert alone.text == beside.text
    with pytest.raises(InputError, match="does not lie on the surface"):
        baked(PLATE, PointCloud(far), "position", 32)


def test_a_stray_does_not_stretch_the_range_of_intensities() -> None:
    values = np.append(100 + POINTS[:, 0], 1e6)
    points = np.concatenate([POINTS, [[2.0, 2.0, 50.0]]])
    made = baked(PLATE, PointCloud(points, attributes={"intensity": values}), "intensity", 32)
    assert float(made.text["intensity of white"]) == pytest.approx(104, abs=0.01)


def test_normals_count_alike_whatever_their_length() -> None:
    lengths = np.random.default_rng(1).uniform(0.01, 9, (2000, 1))
    wanted = baked(PLATE, PointCloud(POINTS, UP), "normal", 32).pixels
    assert np.array_equal(
        baked(PLATE, PointCloud(POINTS, lengths * UP), "normal", 32).pixels, wanted
    )
