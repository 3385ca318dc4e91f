"""The picture of a textured mesh, part by part, with known answers."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from benchmarks.cases import builtin
from parapoint import Mesh, Parameterization
from parapoint.surfaces.parameterization import Charted
from parapoint.textures import preview as room
from parapoint.textures.checkerboard import checkerboard

GOLDEN = Path(__file__).parents[2] / "golden" / "preview.txt"

RED, GREEN, BLUE, GREY = [255, 0, 0], [0, 255, 0], [0, 0, 255], [90, 90, 90]
TEXTURE = np.array([[RED, GREEN], [BLUE, GREY]], dtype=np.uint8)
"""Red at the top left, grey at the bottom right."""
UV = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
SQUARE = Charted(
    Mesh(np.column_stack([UV, np.zeros(4)]), [[0, 1, 2], [0, 2, 3]]),
    Parameterization(UV, [[0, 1, 2], [0, 2, 3]]),
)


@pytest.fixture(autouse=True)
def small(monkeypatch):
    monkeypatch.setattr(room, "SIDE", 64)
    monkeypatch.setattr(room, "SAMPLES", 40_000)


def test_v_runs_upwards_in_a_texture() -> None:
    uv = np.array([[0.25, 0.75], [0.75, 0.75], [0.25, 0.25], [0.75, 0.25], [1.0, 1.0], [0.0, 0.0]])
    wanted = [RED, GREEN, BLUE, GREY, GREEN, BLUE]
    assert_array_equal(room._looked_up(TEXTURE, uv), wanted)


def test_a_layout_that_fills_the_square_is_its_texture() -> None:
    layout = room._layout(SQUARE, TEXTURE)
    assert_array_equal(layout, np.repeat(np.repeat(TEXTURE, 32, axis=0), 32, axis=1))


def test_points_are_spread_evenly_over_and_within_the_faces() -> None:
    """A corner's half of a triangle, seen from that corner, holds a quarter of its points."""
    mesh = Mesh([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 3, 0]], [[0, 1, 2], [1, 3, 2]])
    face, weights = room._evenly_spread(mesh)
    assert_allclose(np.bincount(face) / len(face), [1 / 3, 2 / 3], atol=1e-4)
    for of in range(2):
        own = weights[face == of]
        assert_allclose(own.sum(axis=1), 1)
        assert own.min() >= 0
        assert_allclose((own > 0.5).mean(axis=0), 1 / 4, atol=3e-3)


def test_the_nearest_point_is_seen_in_its_light() -> None:
    """Seen along x, with y to the right and z up: light falls from the eye, and from all sides."""
    frame = [[0.0, -1, -1], [0, 1, -1], [0, 1, 1], [0, -1, 1]]
    points = np.array([*frame, [2, 0.5, 0.5], [-2, 0.5, 0.5], [0, -0.5, 0.5], [0, -0.5, -0.5]])
    normals = np.array([[1.0, 0, 0]] * 6 + [[0, 1, 0], [0, 0, -1]])
    colours = np.array([[0, 0, 0]] * 4 + [RED, GREEN, [200] * 3, [100] * 3], dtype=np.uint8)
    picture = room._seen(points, normals, colours, np.array([3.0, 0, 0]))

    def seen(y: float, z: float) -> list[int]:
        column, line = (64 * (0.5 + 0.46 * y), 64 * (0.5 - 0.46 * z))
        return picture[int(line), int(column)].tolist()

    assert seen(0.5, 0.5) == RED
    assert seen(-0.5, 0.5) == [70] * 3
    assert seen(-0.5, -0.5) == [35] * 3
    assert seen(0.0, 0.0) == [255] * 3
    behind = room._seen(points, normals, colours, np.array([-1.0, 0, 0]))
    assert behind[int(64 * (0.5 - 0.46 * 0.5)), int(64 * (0.5 - 0.46 * 0.5))].tolist() == GREEN


@pytest.mark.parametrize("is_backed", [True, False])
def test_a_pixel_that_no_point_of_a_sheet_fell_on_is_filled(is_backed: bool) -> None:
    """The sheet is red, with a point for each of 60 by 60 pixels; behind is green, or nothing."""
    y, z = (of.reshape(-1) for of in np.meshgrid(*2 * [np.linspace(-1, 1, 60)]))
    sheet = np.stack([np.ones(3600), y, z], axis=1)
    is_missed = np.zeros((60, 60), dtype=bool)
    is_missed[5::10, 3:57:7] = True
    front, back = sheet[~is_missed.reshape(-1)], sheet[: 3600 * is_backed] * [-1, 1, 1]

    def seen(*parts: np.ndarray) -> np.ndarray:
        colours = [
            np.tile(of, (len(part), 1)) for of, part in zip((RED, GREEN), parts, strict=False)
        ]
        points = np.concatenate(parts)
        normals = np.tile([1.0, 0, 0], (len(points), 1))
        return room._seen(points, normals, np.concatenate(colours), np.array([1.0, 0, 0]))

    assert_array_equal(seen(front, back), seen(sheet))
    assert (seen(front, back) == RED).all(axis=2).sum() == 3600


def test_the_picture_shows_both_sides_and_the_layout() -> None:
    picture = room.preview(SQUARE, TEXTURE)
    assert picture.shape == (64, 192, 3)
    assert_array_equal(picture[:, 128:], room._layout(SQUARE, TEXTURE))
    for begin in (0, 64):  # the square fills part of each picture, and white is around it
        white = (picture[:, begin : begin + 64] == 255).all(axis=2).mean()
        assert 0.2 < white < 0.9


def test_what_points_upwards_is_seen_above() -> None:
    """A slab whose y axis points upwards is seen as the one that is laid with z upwards."""
    points = np.array([[0.0, 0, 0], [2, 0, 0], [2, 1, 0.5], [0, 1, 0.5]])
    laid = points[:, [0, 2, 1]] * [1, -1, 1]
    of_y, of_z = (Charted(Mesh(at, SQUARE.mesh.faces), SQUARE.map) for at in (points, laid))
    seen = room.preview(of_y, TEXTURE, is_y_up=True)
    assert_array_equal(seen, room.preview(of_z, TEXTURE))
    assert (seen != room.preview(of_y, TEXTURE)).any()


@pytest.mark.parametrize("turn", [1, -1])
def test_of_a_sheet_with_two_sides_the_one_that_faces_the_viewer_is_seen(turn) -> None:
    """The front shows red, the texture's top left; the back grey, its bottom right."""
    mesh = builtin.wavy_sheet(4)
    both = Mesh(mesh.vertices, np.concatenate([mesh.faces, mesh.faces[:, ::-1]])[::turn])
    corners = np.repeat([[0, 0, 0], [1, 1, 1]], len(mesh.faces), axis=0)[::turn]
    held = Parameterization(np.array([[0.1, 0.9], [0.9, 0.1]]), corners)
    picture = room.preview(Charted(both, held), TEXTURE).astype(int)
    above, below = picture[:, :64].reshape(-1, 3), picture[:, 64:128].reshape(-1, 3)
    for seen, is_red in ((above, True), (below, False)):
        drawn = seen[(seen < room.PAPER).any(axis=1)]
        assert len(drawn) > 500
        is_right = (drawn[:, 0] > 2 * drawn[:, 1]) == is_red
        assert is_right.mean() > 0.95  # but where no point of the front fell into a pixel


def test_a_preview_looks_as_it_did_when_somebody_looked(monkeypatch) -> None:
    """Mean tones of 8 by 24 parts of the picture of a torus, within three levels of 255."""
    monkeypatch.setattr(room, "SIDE", 96)
    monkeypatch.setattr(room, "SAMPLES", 200_000)
    mesh = builtin.torus(24)
    x, y, z = (0.5 + 0.3 * of for of in mesh.vertices[mesh.faces].reshape(-1, 3).T)
    uv = np.column_stack([x, np.where(z > 0.5, y, 1 - y)])
    apart = np.arange(len(uv)).reshape(-1, 3)
    monkeypatch.setattr("parapoint.textures.checkerboard.SQUARES", 8)
    shown = room.preview(Charted(mesh, Parameterization(uv, apart)), checkerboard(32))
    assert shown.shape == (96, 288, 3)
    tones = shown.reshape(8, 12, 24, 12, 3).mean(axis=(1, 3, 4))
    assert_allclose(tones, np.loadtxt(GOLDEN), atol=3)
