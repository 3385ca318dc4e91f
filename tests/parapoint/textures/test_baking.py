"""What is baked is what the cloud knows: colours, normals, places, intensities."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from parapoint import InputError, Mesh, Parameterization, PointCloud
from parapoint.surfaces.parameterization import Charted
from parapoint.textures.baking import APART, baked, check_size, check_together
from parapoint.textures.tangents import corner_tangents

RNG = np.random.default_rng(0)
CORNERS = np.array([[0.0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0]])
FACES = np.array([[0, 1, 2], [0, 2, 3]])
UV = np.array([[0.1, 0.1], [0.9, 0.1], [0.9, 0.9], [0.1, 0.9]])
PLATE = Charted(Mesh(CORNERS, FACES), Parameterization(UV, FACES))
POINTS = np.column_stack([4 * RNG.random((4000, 2)), np.zeros(4000)])


def texel(uv, size: int) -> tuple[int, int]:
    return int((1 - uv[1]) * size), int(uv[0] * size)


@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.float32])
def test_colours_stay_as_they_are(kind) -> None:
    most = 1 if kind is np.float32 else np.iinfo(kind).max
    ramp = np.column_stack([POINTS[:, 0] / 4, POINTS[:, 1] / 4, np.full(4000, 0.2)])
    cloud = PointCloud(POINTS, attributes={"colours": (most * ramp).astype(kind)})
    made = baked(PLATE, cloud, "colour", 64, 4)
    assert made.pixels.shape == (64, 64, 3)
    assert made.pixels.dtype == np.uint8
    assert made.fill == pytest.approx(0.64, abs=0.03)
    for u, v in [(0.3, 0.3), (0.7, 0.2), (0.15, 0.85)]:
        column, line = texel((u, v), 64)[::-1]
        place = np.array([(column + 0.5) / 64, 1 - (line + 0.5) / 64])
        wanted = 255 * np.append((place - 0.1) / 0.8, 0.2)
        assert_allclose(made.pixels[line, column], wanted, atol=2)


def test_the_margin_repeats_the_edge_and_the_mean_is_elsewhere() -> None:
    colours = np.tile(np.array([[200, 10, 60]], dtype=np.uint8), (4000, 1))
    colours[POINTS[:, 0] > 2] = [0, 10, 60]
    cloud = PointCloud(POINTS, attributes={"colours": colours})
    pixels = baked(PLATE, cloud, "colour", 100, 5).pixels
    assert pixels[50, 4].tolist() == [200, 10, 60]
    assert pixels[50, 95].tolist() == [0, 10, 60]
    assert pixels[50, 1, 0] == pytest.approx(100, abs=5)
    bare = baked(PLATE, cloud, "colour", 100, 0).pixels
    assert bare[50, 6, 0] == pytest.approx(100, abs=5)
    assert bare[50, 9].tolist() == [200, 10, 60]  # the rim, which bilinear sampling reads


def test_a_position_map_is_a_geometry_image() -> None:
    height = 0.05 * np.sin(POINTS[:, 0])
    cloud = PointCloud(np.column_stack([POINTS[:, :2], height]))
    made = baked(PLATE, cloud, "position", 64)
    assert made.pixels.dtype == np.uint16
    low, high = (
        np.array(made.text[f"position of {end}"].split(), float) for end in ("black", "white")
    )
    shown = made.pixels[..., 3] == 65535
    assert shown.mean() == pytest.approx(0.64, abs=0.03)
    points = low + (high - low) * made.pixels[..., :3][shown] / 65535
    assert_allclose(points[:, 2], 0.05 * np.sin(points[:, 0]), atol=1e-3)
    line, column = np.nonzero(shown)
    u, v = (column + 0.5) / 64, 1 - (line + 0.5) / 64
    assert_allclose(
        points[:, :2], 5 * np.column_stack([u, v]) - 0.5, atol=0.1
    )  # a spacing, at the border


def test_intensities_are_grey_from_the_least_to_the_greatest() -> None:
    values = 1000 + 50 * POINTS[:, 1]
    made = baked(PLATE, PointCloud(POINTS, attributes={"intensity": values}), "intensity", 64)
    assert made.pixels.shape == (64, 64, 1)
    low, high = (float(made.text[f"intensity of {end}"]) for end in ("black", "white"))
    assert (low, high) == (values.min(), values.max())
    read = low + (high - low) * made.pixels[32, 32, 0] / 65535
    assert read == pytest.approx(1000 + 50 * 4 * (1 - 32.5 / 64 - 0.1) / 0.8, abs=2)


@pytest.mark.parametrize(
    ("tilt", "colour"),
    [
        ([0, 0, 1], [128, 128, 255]),
        ([0.6, 0, 0.8], [204, 128, 230]),
        ([0, 0.6, 0.8], [128, 204, 230]),
    ],
)
def test_normal_maps_are_red_along_u_and_green_along_v(tilt, colour) -> None:
    cloud = PointCloud(POINTS, np.tile(tilt, (4000, 1)))
    pixels = baked(PLATE, cloud, "normal", 32).pixels
    assert_allclose(pixels[16, 16], colour, atol=1)


def test_normal_maps_turn_with_the_map_and_are_mirrored_with_it() -> None:
    cloud = PointCloud(POINTS, np.tile([0.6, 0, 0.8], (4000, 1)))
    quarter = np.column_stack([UV[:, 1], 1 - UV[:, 0]])  # x runs against v
    pixels = baked(
        Charted(PLATE.mesh, Parameterization(quarter, FACES)), cloud, "normal", 32
    ).pixels
    assert_allclose(pixels[16, 16], [128, 51, 230], atol=1)
    mirrored = Parameterization(UV * [-1, 1] + [1, 0], FACES)
    pixels = baked(Charted(PLATE.mesh, mirrored), cloud, "normal", 32).pixels
    assert_allclose(pixels[16, 16], [51, 128, 230], atol=1)


def test_tangents_point_where_u_grows_and_know_their_hand() -> None:
    tangents, hand = corner_tangents(PLATE, np.tile([0.0, 0, 1], (4, 1)))
    assert_allclose(tangents.reshape(-1, 3), np.tile([1.0, 0, 0], (6, 1)), atol=1e-12)
    assert hand.tolist() == [1, 1]
    _, hand = corner_tangents(
        Charted(PLATE.mesh, Parameterization(UV[:, ::-1].copy(), FACES)),
        np.tile([0.0, 0, 1], (4, 1)),
    )
    assert hand.tolist() == [-1, -1]


@pytest.mark.parametrize(
    ("kind", "message"),
    [("colour", "no colours"), ("intensity", "no intensity"), ("normal", "no normals")],
)
def test_what_the_cloud_does_not_know_is_not_baked(kind, message) -> None:
    with pytest.raises(InputError, match=message):
        baked(PLATE, PointCloud(POINTS), kind, 32)


def test_a_map_that_leaves_the_square_is_refused() -> None:
    wide = Charted(PLATE.mesh, Parameterization(2 * UV, FACES))
    with pytest.raises(InputError, match="leave the unit square"):
        baked(wide, PointCloud(POINTS), "position", 32)


def test_a_cloud_elsewhere_is_refused() -> None:
    check_together(PLATE, PointCloud(POINTS))
    with pytest.raises(InputError, match="does not lie on the surface"):
        check_together(PLATE, PointCloud(POINTS + np.array([0, 0, 1])))


@pytest.mark.parametrize(("size", "margin"), [(0, 0), (100_000, 0), (64, -1), (64, 17)])
def test_sizes_out_of_range_are_refused(size, margin) -> None:
    with pytest.raises(InputError, match="must be from"):
        check_size(size, margin)


@pytest.mark.parametrize("away", [0.9, 1.1])
def test_a_cloud_may_lie_so_far_from_a_model_as_its_diagonal_says(away) -> None:
    # A strip of 3 by 4: its diagonal is 5. Two thirds of the points lie beside it.
    mesh = Mesh([[0, 0, 0], [3, 0, 0], [3, 4, 0], [0, 4, 0]], [[0, 1, 2], [0, 2, 3]])
    uv = np.array([[0.0, 0], [0.75, 0], [0.75, 1], [0, 1]])
    points = np.array([[1, 1, 0], [1, 2, 0], [2, 1, 0], [2, 2, 0], [1, 3, 0], [2, 3, 0]])
    points = points + np.outer([0, 0, 1, 1, 1, 1], [0, 0, away * APART * 5])
    charted, cloud = Charted(mesh, Parameterization(uv, mesh.faces)), PointCloud(points)
    if away < 1:
        check_together(charted, cloud)
    else:
        with pytest.raises(InputError, match=r"does not lie on .* which is 5 across"):
            check_together(charted, cloud)
