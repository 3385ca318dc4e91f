"""Where a cloud is cut open: to an even scale, and to what would be starved."""

import numpy as np
import pytest

from benchmarks.cases import builtin
from parapoint.computed import seams
from parapoint.computed.flattening import flattened
from parapoint.computed.layout import scaled_layout
from parapoint.computed.scale import even_scale
from parapoint.computed.seams import evened, fed, joined_loops, seamed
from parapoint.planar.bijection import bijective_map
from parapoint.planar.descent import sound
from parapoint.surfaces.areas import signed_areas, starved_share
from parapoint.surfaces.surface import Mesh


def grid(side: int) -> Mesh:
    """A square of side² vertices; vertex side · y + x, diagonals up to the right."""
    x, y = (of.ravel() for of in np.meshgrid(np.arange(side), np.arange(side)))
    corner = (side * np.arange(side - 1)[:, None] + np.arange(side - 1)).ravel()
    sides = [0, 1, side + 1], [0, side + 1, side]
    faces = np.concatenate([corner[:, None] + np.array(of) for of in sides])
    return Mesh(np.stack([x, y, 0 * x], axis=1), faces)


def plate_with_pins(side: int, pins: list[tuple[int, int]]) -> Mesh:
    """A square of side² vertices, with a tube of six sides and rows on each vertex given."""
    plate, faces, count = grid(side).vertices.copy(), grid(side).faces, side**2
    points = [plate]
    for middle, rows in pins:
        faces = faces[(faces != middle).all(axis=1)]
        below = middle + np.array([-side - 1, -side, 1, side + 1, side, -1])
        foot = plate[below]
        for height in range(1, rows + 1):
            above, count = count + np.arange(6), count + 6
            points.append(foot + np.array([0, 0, height]))
            to, up = np.roll(below, -1), np.roll(above, -1)
            walls = np.stack([below, to, up], axis=1), np.stack([below, up, above], axis=1)
            faces, below = np.concatenate([faces, *walls]), above
        plate[middle, 2] = rows
        tip = np.stack([below, np.roll(below, -1), np.full(6, middle)], axis=1)
        faces = np.concatenate([faces, tip])
    return Mesh(np.concatenate(points), faces)


def test_of_two_pins_that_is_cut_whose_cut_gains_more_for_each_edge() -> None:
    # A pin's area goes by its rows: 24 and 14. A cut to its tip takes these, two edges over the tip
    # and its foot, and the way from the rim: 24 + 10 = 34 and 14 + 2 = 16. So the high pin gains
    # 24 / 34 an edge and the low one more, 14 / 16, though all in all less. There the cut goes
    # first, and it makes the scale even enough.
    mesh = plate_with_pins(21, [(10 * 21 + 10, 24), (10 * 21 + 3, 14)])
    cut = evened(mesh, 34)
    copied = cut.vertices[len(mesh.vertices) :]
    assert len(copied) == 16
    assert (copied[:, 0] <= 4).all()


def test_a_tip_is_far_from_the_boundary_and_in_its_scale_from_the_mean(monkeypatch) -> None:
    # The log scale falls by the row of a pin: the one near the rim, of 22 rows, is the more extreme
    # of the two, but its tip is 24 edges from the boundary, that of the other, of 20 rows, 30.
    # 20 · 30 is more than 22 · 24, so the one tip that is tried is in the middle.
    monkeypatch.setattr(seams, "TIPS", 1)
    mesh = plate_with_pins(21, [(220, 20), (213, 22)])
    copied = evened(mesh, 30).vertices[len(mesh.vertices) :]
    assert len(copied) == 30
    assert np.abs(copied[copied[:, 2] > 0, :2] - 10).max() <= 1


def flat_ring() -> Mesh:
    """A ring in a plane, whose hole is a star with the longer boundary."""
    turn = 2 * np.pi * np.arange(24) / 24
    rows = [np.where(np.arange(24) % 2, 1.9, 1.0), np.full(24, 2.2), np.full(24, 2.5)]
    ring = np.concatenate([np.stack([r * np.cos(turn), r * np.sin(turn)], axis=1) for r in rows])
    a = np.arange(48)
    b = a - a % 24 + (a + 1) % 24
    faces = np.concatenate(
        [np.stack([a, b + 24, b], axis=1), np.stack([a, a + 24, b + 24], axis=1)]
    )
    return Mesh(np.pad(ring, ((0, 0), (0, 1))), faces)


def test_a_flat_ring_stays_a_ring_though_its_hole_has_the_longer_boundary() -> None:
    # Its outer loop turns by 2π, the star in its middle by −2π: so they are, and nothing is joined.
    mesh = flat_ring()
    assert mesh.boundary_loops[0].max() < 24  # the star
    assert joined_loops(mesh) is mesh


def test_a_handle_is_cut_open_and_a_hole_in_a_plane_is_not() -> None:
    assert seamed(flat_ring()).topology == "genus 0 with 2 boundary loops"
    torus = builtin.torus(12)
    holed = Mesh(torus.vertices, torus.faces[1:])
    assert (holed.genus, len(holed.boundary_loops)) == (1, 1)
    opened = seamed(holed)
    assert opened.genus == 0
    assert opened.is_connected_surface


def test_cuts_are_at_most_2_2_percent_of_the_faces_of_an_open_surface() -> None:
    # Cuts to all three pins would pay, and take 40 edges. But the plate has 800 faces and the pins
    # 12 (16 + 14 + 14), so 29 are cut at most.
    mesh = plate_with_pins(21, [(220, 16), (213, 14), (227, 14)])
    assert len(mesh.faces) == 1328
    assert 16 <= len(seamed(mesh).vertices) - len(mesh.vertices) <= 29


def test_cuts_are_at_most_3_7_percent_of_the_faces_of_a_closed_surface() -> None:
    # The same plate, closed by 80 triangles to a point below, has 1,408 faces, so 52 edges are cut
    # at most, those that open it to a disk among them. Cuts to all pins would take 74.
    plate = plate_with_pins(21, [(220, 16), (213, 14), (227, 14)])
    (rim,) = plate.boundary_loops
    below = len(plate.vertices)
    fan = np.stack([np.roll(rim, -1), rim, np.full(len(rim), below)], axis=1)
    points = np.concatenate([plate.vertices, [[10.0, 10, -5]]])
    mesh = Mesh(points, np.concatenate([plate.faces, fan]))
    assert mesh.topology == "sphere"
    assert len(mesh.faces) == 1408
    assert 32 <= len(seamed(mesh).vertices) - len(mesh.vertices) <= 52


def test_a_short_pin_is_cut_only_where_angles_and_parts_are_to_be_kept() -> None:
    # The pin has 54 of 450 units of area, so the scale is even enough though it shrinks by e² for
    # each of its 8 rows. A cut from the rim to its tip takes 9 edges to the foot and 9 up the pin.
    mesh = plate_with_pins(21, [(220, 8)])
    for distortion in ("conformal", "isometric"):
        assert len(seamed(mesh, distortion).vertices) == len(mesh.vertices)
    copied = seamed(mesh, "balanced").vertices[len(mesh.vertices) :]
    assert len(copied) == 18
    assert copied[:, 2].max() == 8
    assert (np.abs(copied[:, :2] - 10).max(axis=1) == 10).any()


def test_no_part_is_fed_once_the_time_is_up() -> None:
    mesh = plate_with_pins(21, [(220, 8)])
    assert fed(mesh, deadline=0.0) is mesh


def test_each_starved_part_is_fed() -> None:
    mesh = plate_with_pins(31, [(480 - 8, 8), (480 + 8, 8), (480 - 8 * 31, 8)])
    copied = fed(mesh).vertices[len(mesh.vertices) :]
    tops = copied[copied[:, 2] == 8, :2]
    for middle in ([7, 15], [23, 15], [15, 7]):
        assert (np.abs(tops - middle).max(axis=1) <= 1).any()


def test_what_no_cut_helps_is_given_up(monkeypatch) -> None:
    mesh = plate_with_pins(21, [(220, 8)])
    tried = []

    def hopeless(of: Mesh) -> seams.Prediction:
        tried.append(of)
        return seams.Prediction(of, np.ones(len(of.vertices)), 1.0, is_good=False)

    monkeypatch.setattr(seams, "_starvation", hopeless)
    assert fed(mesh) is mesh
    assert 1 < len(tried) <= 1 + seams.TIPS * seams.TRIALS


def test_cuts_that_hardly_help_are_given_up(monkeypatch) -> None:
    # Each cut takes away a share of what is left: 36 of them in all, none as good as LEAST_GAIN.
    mesh, least = plate_with_pins(21, [(220, 8)]), seams.LEAST_GAIN

    def hardly(of: Mesh) -> seams.Prediction:
        edges = len(of.vertices) - len(mesh.vertices)
        fault = np.exp(-share * edges / np.sqrt(len(mesh.faces)))
        return seams.Prediction(of, np.ones(len(of.vertices)), fault, is_good=edges > 60)

    monkeypatch.setattr(seams, "_starvation", hardly)
    share = least / 2
    assert fed(mesh) is mesh
    share = 2 * least
    assert len(fed(mesh).vertices) > len(mesh.vertices) + 60


def vase(mouth: float, neck: float, around: int = 24) -> Mesh:
    """A ball of radius 0.5 that is open at its top and hangs by its neck on a disk of radius 1."""
    foot, step = np.arcsin(2 * neck), 2 * np.pi * 0.3 / around
    angle = np.linspace(foot, np.pi - np.arcsin(2 * mouth), int(0.5 * np.pi / step))
    floor = np.linspace(1, neck, int(1 / step))[:-1]
    radius = np.concatenate([floor, np.sin(angle) / 2])
    height = np.concatenate([0 * floor, (np.cos(foot) - np.cos(angle)) / 2])
    turn = 2 * np.pi * np.arange(around) / around
    points = [np.outer(radius, np.cos(turn)), np.outer(radius, np.sin(turn))]
    points.append(np.repeat(height[:, None], around, axis=1))
    i, j = np.divmod(np.arange((len(radius) - 1) * around), around)
    a, b = i * around + j, i * around + (j + 1) % around
    faces = np.stack([a, a + around, b], axis=1), np.stack([b, a + around, b + around], axis=1)
    return Mesh(np.stack(points, axis=2).reshape(-1, 3), np.concatenate(faces))


@pytest.mark.parametrize("mouth", [0.05, 0.3])
@pytest.mark.parametrize("neck", [0.05, 0.2])
def test_a_vase_on_a_floor_is_opened_from_the_rim_of_the_floor(mouth, neck) -> None:
    mesh = vase(mouth, neck)
    assert len(mesh.boundary_loops) == 2
    disk = fed(mesh)
    assert len(disk.boundary_loops) == 1
    assert seams._starvation(disk).is_good
    assert starved_share(disk, bijective_map(disk, None)) < 0.01


def test_a_sheet_keeps_its_holes_where_a_short_cut_feeds_a_part_of_it() -> None:
    whole = plate_with_pins(41, [(8 * 41 + 20, 8)])
    holes = [41 * y + x for y in (20, 26, 32) for x in (8, 14, 20, 26, 32)]
    mesh = sound(Mesh(whole.vertices, whole.faces[~np.isin(whole.faces, holes).any(axis=1)]))
    disk = fed(mesh)
    assert len(disk.boundary_loops) == len(mesh.boundary_loops) == 16
    assert seams._starvation(disk).is_good
    assert 14 <= len(disk.vertices) - len(mesh.vertices) <= 20  # from the rim to the pin's tip


def test_objects_on_a_floor_have_a_map_that_starves_nothing() -> None:
    # Where a ball touches the floor, the triangulation leaves a hole beside its foot.
    rng = np.random.default_rng(3)
    points = [np.column_stack([rng.uniform(-1, 1, (1500, 2)), np.zeros(1500)])]
    for middle in ([-0.5, -0.3, 0.35], [0.5, 0.3, 0.35]):
        away = rng.normal(size=(577, 3))
        points.append(0.35 * away / np.linalg.norm(away, axis=1, keepdims=True) + middle)
    flat = flattened(np.concatenate(points), distortion="balanced")
    assert len(flat.mesh.boundary_loops) > 1
    assert len(flat.disk.boundary_loops) == 1
    assert starved_share(flat.disk, flat.uv) < 0.01


def test_the_predicted_shares_are_those_of_the_map() -> None:
    mesh = seamed(builtin.finger(), "balanced")
    uv = bijective_map(mesh, scaled_layout(mesh, even_scale(mesh)))
    area = signed_areas(uv, mesh.faces)
    share = area / area.sum() * mesh.face_areas.sum() / mesh.face_areas
    assert np.median(np.abs(np.log(share / seams._fair_ratios(mesh)))) < 0.1
