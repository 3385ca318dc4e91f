"""What a person wants to know of a map, with numbers worked out by hand."""

import numpy as np
import pytest

from parapoint import Mesh, Parameterization
from parapoint.surfaces.parameterization import Charted
from parapoint.testing import irregular_disk, sphere
from parapoint.textures.packing import packed
from parapoint.unwrapping.given import mended_along
from parapoint.unwrapping.quality import quality
from parapoint.unwrapping.unwrap import Unwrap


def test_quality_by_hand() -> None:
    # Two right triangles of a unit square; the second is shrunk to a tenth.
    vertices = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    mesh = Mesh(vertices, [[0, 1, 2], [0, 2, 3]])
    uv = np.array([[0, 0], [0.5, 0], [0.5, 0.5], [0.6, 0.6], [0.65, 0.65], [0.6, 0.65]])
    found = quality(Charted(mesh, Parameterization(uv, [[0, 1, 2], [3, 4, 5]])), 1000)
    assert found.starved == pytest.approx(0.5)
    assert found.smallest_part == pytest.approx(2 / 101)
    assert found.flipped == 0
    assert found.charts == 2
    assert found.seam == pytest.approx(2**0.5)
    assert found.filled == pytest.approx(0.12625)
    assert found.angle_worst == pytest.approx(0, abs=1e-9)
    assert found.texels_per_unit == pytest.approx(1000 * 0.12625**0.5)
    scale = (1 / 0.12625) ** 0.5
    assert found.stretch_worst == pytest.approx(1 / (0.05 * scale))
    assert found.stretch_mean == pytest.approx((0.5 * scale + 1 / (0.05 * scale)) / 2)
    # Sheared by one: the right angle becomes one of 45 degrees.
    sheared = Parameterization([[0, 0], [1, 0], [2, 1], [1, 1]], mesh.faces)
    assert quality(Charted(mesh, sheared), 1).angle_worst == pytest.approx(45)
    assert quality(Charted(mesh, sheared), 1).charts == 1
    mirrored = Parameterization([[0, 0], [-1, 0], [-1, 1], [0, 1]], mesh.faces)
    assert quality(Charted(mesh, mirrored), 1).flipped == 2


def moebius(around: int = 40, across: int = 4) -> Mesh:
    """A strip whose ends are joined upside down."""
    turn, off = np.meshgrid(
        np.arange(around) * 2 * np.pi / around, np.linspace(-0.3, 0.3, across), indexing="ij"
    )
    out = 1 + off * np.cos(turn / 2)
    points = np.stack([out * np.cos(turn), out * np.sin(turn), off * np.sin(turn / 2)], axis=2)
    row = np.arange(around * across).reshape(around, across)
    row = np.concatenate([row, row[:1, ::-1]])
    a, b, c, d = (of.ravel() for of in (row[:-1, :-1], row[1:, :-1], row[1:, 1:], row[:-1, 1:]))
    return Mesh(points.reshape(-1, 3), np.stack([a, b, c, a, c, d], axis=1).reshape(-1, 3))


@pytest.mark.parametrize("made", [moebius, irregular_disk])
@pytest.mark.parametrize("share", [0, 0.3, 0.5])
def test_faces_that_turn_against_their_neighbours_are_not_flipped(made, share) -> None:
    """Their images turn as they do; what is one to one stays so however faces are wound."""
    mesh = made()
    turned = np.random.default_rng(0).random(len(mesh.faces)) < share
    wound = Mesh(mesh.vertices, np.where(turned[:, None], mesh.faces[:, ::-1], mesh.faces))
    placed = packed(Charted(wound, Unwrap().unwrapped(wound)), 0.01)
    found = quality(placed, 64)
    assert (found.flipped, found.overlap, found.charts) == (0, "none", 1)
    folded = placed.map.uv.copy()
    folded[placed.map.corners[0]] = folded[placed.map.corners[0]].mean(axis=0)
    assert quality(Charted(wound, Parameterization(folded, placed.map.corners)), 64).flipped


@pytest.mark.parametrize("size", [1, 30])
def test_lengths_are_told_in_the_size_of_the_surface(size: float) -> None:
    """A square cut along its diagonal: the cut is √2 of the side, in any unit."""
    corners = size * np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    mesh = Mesh(corners, [[0, 1, 2], [0, 2, 3]])
    halves = np.array([[0, 0], [0.4, 0], [0.4, 0.4], [0.5, 0.5], [0.9, 0.9], [0.5, 0.9]])
    found = quality(Charted(mesh, Parameterization(halves, [[0, 1, 2], [3, 4, 5]])), 100)
    assert found.seam == pytest.approx(2**0.5)
    assert found.texels_per_unit == pytest.approx(40 / size)
    assert (found.stretch_mean, found.stretch_worst) == pytest.approx((1, 1))


def test_angles_count_by_area_and_flat_images_as_flips() -> None:
    """Nine tenths of a strip are kept, the last tenth is sheared by one, or flattened."""
    points = np.array([[0.0, 0, 0], [9, 0, 0], [0, 1, 0], [9, 1, 0], [10, 0, 0], [10, 1, 0]])
    faces = [[0, 1, 2], [1, 3, 2], [1, 4, 3], [4, 5, 3]]
    kept, end = points[:, :2] / 20, np.array([[9.0, 0], [10, 0], [10, 1], [9, 1]]) / 20
    rows = [[0, 1, 2], [1, 3, 2], [6, 7, 9], [7, 8, 9]]
    found = {}
    for name, moved in {"sheared": end + end[:, 1:] * [1, 0], "flat": end * [1, 0]}.items():
        uv = np.concatenate([kept, moved])
        found[name] = quality(Charted(Mesh(points, faces), Parameterization(uv, rows)), 64)
    # The two sheared triangles swap an angle of 45 degrees for one of 90; the third stays.
    assert found["sheared"].angle_worst == pytest.approx(45)
    assert found["sheared"].angle_mean == pytest.approx(0.1 * (45 + 45 + 0) / 3)
    assert (found["sheared"].flipped, found["flat"].flipped) == (0, 2)


@pytest.mark.parametrize(("share", "is_seen"), [(0.05, True), (0.005, False)])
def test_a_starved_part_is_seen_from_a_hundredth_of_the_surface_on(share, is_seen) -> None:
    """A strip whose last part is ten times narrower in the plane."""
    end = 1 - share
    points = np.array([[0.0, 0, 0], [end, 0, 0], [end, 1, 0], [0, 1, 0], [1, 0, 0], [1, 1, 0]])
    faces = [[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]]
    uv = points[:, :2].copy()
    uv[4:, 0] = end + share / 10
    found = quality(Charted(Mesh(points, faces), Parameterization(uv, faces)), 64)
    assert found.starved == pytest.approx(share)
    ratio = 0.1 / (1 - 0.9 * share)
    assert found.smallest_part == pytest.approx(ratio if is_seen else 1)


@pytest.mark.parametrize(("width", "starved"), [(1 / 8, 0.0), (0.12, 0.5)])
def test_a_part_with_a_quarter_of_its_fair_area_is_not_starved(width, starved) -> None:
    """Half of a square is drawn an eighth as wide as the square, or a little less."""
    points = np.array([[0.0, 0, 0], [0.5, 0, 0], [0.5, 1, 0], [0, 1, 0], [1, 0, 0], [1, 1, 0]])
    faces = [[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]]
    uv = points[:, :2].copy()
    uv[1:3, 0] = width
    found = quality(Charted(Mesh(points, faces), Parameterization(uv, faces)), 64)
    assert found.starved == starved
    assert found.smallest_part == pytest.approx(2 * width if starved else 1)


SQUARE = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
RING = [[0, 1, 5], [0, 5, 4], [1, 2, 6], [1, 6, 5], [2, 3, 7], [2, 7, 6], [3, 0, 4], [3, 4, 7]]
"""The faces between two squares, the outer one first."""


@pytest.mark.parametrize(
    ("second", "overlap"),
    [
        (SQUARE / 4 + 1.5, "none"),  # beside the ring
        (SQUARE / 4 + 0.375, "none"),  # in its hole
        (SQUARE + 0.5, "some"),  # across it
        (SQUARE * 2 - 0.5, "some"),  # around it
        (SQUARE / 16 + 0.05, "some"),  # within its band
        (SQUARE[::-1] + 5, "unknown"),  # turned over
    ],
)
def test_overlap_is_seen_wherever_one_chart_lies_on_another(second, overlap) -> None:
    uv = np.concatenate([SQUARE, SQUARE / 2 + 0.25, second])
    faces = np.array([*RING, [8, 9, 10], [8, 10, 11]])
    points = np.pad(uv, ((0, 0), (0, 1)))
    points[8:] = np.pad(SQUARE, ((0, 0), (0, 1))) + 9
    found = quality(Charted(Mesh(points, faces), Parameterization(uv, faces)), 64)
    assert found.overlap == overlap


def test_the_least_part_is_the_one_that_hangs_together() -> None:
    """Two starved islands, in the middle of a sheet and at its rim, are two parts, not one.

    Each is a twentieth of the surface. The first keeps a tenth of its fair area, the second a
    fifth; faces that touch at an edge are one part, whichever corner the edge begins at.
    """
    x = np.array([0.0, 0.45, 0.5, 0.95, 1.0])
    width = np.diff(x)
    kept = width * [1, 0.1, 1, 0.2]
    at = np.concatenate([[0], np.cumsum(kept)])
    points = np.array([[a, b, 0] for a in x for b in (0, 1)])
    uv = np.array([[a, b] for a in at for b in (0.0, 1)])
    for turn in range(3):
        faces = np.array(
            [
                np.roll(f, turn)
                for k in range(0, 8, 2)
                for f in ([k, k + 2, k + 3], [k, k + 3, k + 1])
            ]
        )
        found = quality(Charted(Mesh(points, faces), Parameterization(uv, faces)), 64)
        assert found.smallest_part == pytest.approx(0.1 / kept.sum())
        assert found.starved == pytest.approx(0.1)


def test_a_map_has_the_same_quality_however_its_vertices_are_split() -> None:
    """A sphere that is cut open: each face, or each side of the cut, has vertices of its own."""
    mesh = sphere()
    charted = packed(Charted(mesh, mended_along(mesh, mesh.edges[:0])))
    whole = quality(charted, 64)
    assert (whole.charts, whole.overlap) == (1, "none")
    assert whole.seam > 0.5
    held = charted.map
    own = np.arange(mesh.faces.size).reshape(-1, 3)
    soup = Mesh(mesh.vertices[mesh.faces].reshape(-1, 3), own)
    points = np.empty((len(held.uv), 3))
    points[held.corners] = mesh.vertices[mesh.faces]
    for split, rows in (
        (soup, held),
        (soup, Parameterization(held.uv[held.corners].reshape(-1, 2), own)),
        (Mesh(points, held.corners), held),
    ):
        assert quality(Charted(split, rows), 64).facts() == whole.facts()


@pytest.mark.parametrize("turn", [1, -1])
def test_what_faces_fill_together_counts_once(turn) -> None:
    """Half of the square twice, the second time perhaps turned over; and a quarter beside it."""
    half, quarter = [[0, 1, 2], [0, 2, 3]], [[1, 4, 5], [1, 5, 6]]
    uv = [[0.0, 0], [0.5, 0], [0.5, 1], [0, 1], [1, 0], [1, 0.5], [0.5, 0.5]]
    faces = np.array([*half, *(np.array(half)[:, ::turn]), *quarter])
    mesh = Mesh(np.pad(uv, ((0, 0), (0, 1))), faces)
    found = quality(Charted(mesh, Parameterization(uv, faces)), 64)
    assert found.overlap == "unknown"
    assert found.filled == pytest.approx(0.75, rel=1e-3)
