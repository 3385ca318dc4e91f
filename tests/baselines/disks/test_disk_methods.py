"""Known answers and invariances of the methods for disks."""

import igl
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from baselines import registry
from baselines.disks.bff import closed_curve
from baselines.disks.slim import DENSITIES, SLIM, is_minimum, map_energy
from baselines.disks.tutte import Tutte, tutte
from benchmarks.cases import builtin
from parapoint.errors import InputError
from parapoint.method import UnsupportedError
from parapoint.planar.domains import (
    Domain,
    FlatteningError,
    domain,
    far_pair,
    frames,
    is_kept,
    signed_areas,
    singular_values,
)
from parapoint.surfaces.surface import Mesh, PointCloud
from parapoint.testing import irregular_disk, sample_surfaces, sphere

DISK_METHODS = [
    "tutte",
    "harmonic",
    "mean_value",
    "lscm",
    "bff",
    "abf",
    "arap",
    "smith_schaefer",
    "geometry_image(side=9)",
    "slim",
    "slim(energy=conformal)",
    "slim(energy=log_arap)",
    "slim(energy=exp_conformal)",
]
ISOMETRIC = {"arap", "slim", "slim(energy=log_arap)"}


def mapped(spec, mesh):
    return registry.method(spec)[1].parameterize(mesh, seed=0)


def stretches(mesh, result):
    """Singular values of each triangle, (F, 2), the map scaled to the mesh's area."""
    disk = Domain(mesh.vertices, mesh.faces, np.array([0]), mesh.face_areas.sum())
    uv = result.uv[result.corners].reshape(-1, 2)
    corners = np.arange(len(uv)).reshape(-1, 3)
    uv = uv * np.sqrt(disk.area / np.abs(signed_areas(uv, corners)).sum())
    return np.stack(singular_values(frames(disk.vertices, disk.faces), uv, corners), axis=1)


def rolled(mesh):
    """A flat mesh rolled around a half cylinder: an isometry up to its faces' flatness."""
    x, y, _ = mesh.vertices.T
    radius = 2 / np.pi
    return Mesh(
        np.stack([radius * np.cos(x / radius), y, radius * np.sin(x / radius)], 1), mesh.faces
    )


def flat_disk(steps=13):
    """A square of irregular triangles in the plane z = 0, sides of 2."""
    t = np.linspace(-1, 1, steps)
    xy = np.stack(np.meshgrid(t, t), axis=-1)
    rng = np.random.default_rng(3)
    xy[1:-1, 1:-1] += rng.uniform(-0.04, 0.04, (steps - 2, steps - 2, 2))
    corner = np.arange(steps**2).reshape(steps, steps)
    a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]
    faces = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)
    return Mesh(np.column_stack([xy.reshape(-1, 2), np.zeros(steps**2)]), faces)


@pytest.mark.parametrize("spec", DISK_METHODS)
@pytest.mark.parametrize("surface", ["a disk of irregular triangles", "a disk with a hole"])
def test_tame_disks_are_mapped_without_flips_at_their_own_area(spec, surface):
    mesh = sample_surfaces()[surface]
    result = mapped(spec, mesh)
    areas = signed_areas(result.uv, result.corners)
    assert (areas > 0).all()
    # Exact where the method scales its map; SLIM and ARAP are free, and stay close.
    free = spec.startswith(("slim", "arap", "smith"))
    assert_allclose(areas.sum(), mesh.face_areas.sum(), rtol=0.15 if free else 1e-9)


@pytest.mark.parametrize("spec", ["lscm", "bff", "arap(iterations=400)", "slim(iterations=60)"])
def test_flat_square_is_mapped_by_a_similarity(spec):
    # The limits are how far the iterations have come; LSCM and BFF solve for it at once.
    limit = 1e-3 if "iterations" in spec else 1e-9
    mesh = flat_disk()
    assert_allclose(stretches(mesh, mapped(spec, mesh)), 1, atol=limit)


@pytest.mark.parametrize("spec", ["lscm", "bff", "arap", "slim"])
def test_half_cylinder_is_unrolled(spec):
    # The polyhedral cylinder of these irregular triangles is developable to O(h^2): 1 - 0.99.
    mesh = rolled(flat_disk())
    assert_allclose(stretches(mesh, mapped(spec, mesh)), 1, atol=0.05)
    assert np.abs(stretches(mesh, mapped("tutte", mesh)) - 1).max() > 0.3


def test_conformal_slim_keeps_the_angles_of_a_half_cylinder():
    mesh = rolled(flat_disk())
    ratios = {
        spec: np.divide(*stretches(mesh, mapped(spec, mesh)).T).max() for spec in DISK_METHODS
    }
    assert ratios["slim(energy=conformal)"] < 1.1
    assert ratios["tutte"] > 1.5


def test_cone_is_unrolled_by_bff_to_its_sector():
    # A cone over a circle, slit: developable triangle by triangle (the apex is cut), so exact.
    angle = np.linspace(0, 2 * np.pi, 17)
    rim = np.stack([np.cos(angle), np.sin(angle), np.zeros(17)], axis=1)
    around = np.arange(1, 17)
    mesh = Mesh(
        np.vstack([[[0, 0, 1.0]], rim]), np.stack([np.zeros(16, int), around, around + 1], axis=1)
    )
    for spec in ("bff", "lscm"):
        assert_allclose(stretches(mesh, mapped(spec, mesh)), 1, atol=1e-9)


@pytest.mark.parametrize("unit", [1e3, 1e-6])
@pytest.mark.parametrize("spec", [*DISK_METHODS, "meshlab_lscm", "meshlab_harmonic"])
def test_moving_turning_and_scaling_the_surface_only_scales_its_stretches(spec, unit):
    pytest.importorskip("pymeshlab") if "meshlab" in spec else None
    mesh = irregular_disk()  # sheared, so that no two corners are equally far
    mesh = Mesh(mesh.vertices @ [[1, 0, 0], [0.3, 1.2, 0], [0, 0, 1]], mesh.faces)
    turn, _ = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    moved = Mesh(unit * (mesh.vertices @ turn.T + [0.5, 0.6, 0.7]), mesh.faces)
    # SLIM's line search decides by floating-point comparisons; MeshLab rounds to float32.
    limit = 1e-2 if "meshlab" in spec else 1e-5
    assert_allclose(
        stretches(moved, mapped(spec, moved)), stretches(mesh, mapped(spec, mesh)), atol=limit
    )


def test_slim_takes_surfaces_of_any_unit():
    # libigl's own line search does not move this spiral ramp by a step where it is so small.
    turn, radius = (of.ravel() for of in np.meshgrid(np.linspace(0, 9, 60), np.linspace(1, 2, 8)))
    ramp = np.stack([radius * np.cos(turn), radius * np.sin(turn), 0.02 * turn], axis=1)
    corner = (np.arange(7)[:, None] * 60 + np.arange(59)).ravel()
    faces = np.concatenate([corner[:, None] + side for side in ([0, 61, 1], [0, 60, 61])])
    energies = [
        SLIM().parameterize(Mesh(unit * ramp, faces), seed=0).report["end_energy"]
        for unit in (1.0, 1e-6)
    ]
    assert energies[0] < 4.2
    assert energies[1] == pytest.approx(energies[0], rel=1e-3)


@pytest.mark.parametrize("spec", DISK_METHODS)
def test_unreferenced_vertices_and_their_numbering_change_nothing(spec):
    mesh = irregular_disk()  # sheared, so that no two corners are equally far
    mesh = Mesh(mesh.vertices @ [[1, 0, 0], [0.3, 1.2, 0], [0, 0, 1]], mesh.faces)
    order = np.random.default_rng(4).permutation(len(mesh.vertices) + 5)
    vertices = np.full((len(order), 3), 77.0)
    vertices[order[: len(mesh.vertices)]] = mesh.vertices
    other = Mesh(vertices, order[mesh.faces])
    # Sums are taken in another order, and ARAP holds another vertex.
    assert_allclose(
        stretches(other, mapped(spec, other)), stretches(mesh, mapped(spec, mesh)), atol=1e-5
    )


@pytest.mark.parametrize("spec", DISK_METHODS)
def test_other_surfaces_are_refused(spec):
    for surface in (sphere(), PointCloud(sphere().vertices), sample_surfaces()["two components"]):
        with pytest.raises(UnsupportedError, match="needs"):
            mapped(spec, surface)


@pytest.mark.parametrize("spec", DISK_METHODS[1:])
@pytest.mark.parametrize("far", [False, True], ids=["two equal corners", "corners on a line"])
def test_triangles_without_area_are_named(spec, far):
    mesh = irregular_disk()
    vertices = mesh.vertices.copy()
    a, b, c = mesh.faces[60]
    vertices[a] = (vertices[b] + vertices[c]) / 2 if far else vertices[b]
    with pytest.raises(InputError, match=r"face \d+ has no area \(one of \d+ such faces\)"):
        mapped(spec, Mesh(vertices, mesh.faces))


def test_tutte_takes_triangles_without_area():
    mesh = irregular_disk()
    vertices = mesh.vertices.copy()
    vertices[mesh.faces[60, 0]] = vertices[mesh.faces[60, 1]]
    assert Tutte().parameterize(Mesh(vertices, mesh.faces), seed=0).report["flipped"] == 0


def test_tutte_puts_the_longest_loop_on_a_circle_and_each_vertex_amid_its_neighbours():
    mesh = sample_surfaces()["a disk with a hole"]
    disk = domain(mesh)
    uv = Tutte().parameterize(mesh, seed=0).uv
    radius = np.linalg.norm(uv[disk.loop], axis=1)
    assert_allclose(radius, radius[0])
    assert (np.linalg.norm(uv, axis=1) <= radius[0] * (1 + 1e-12)).all()
    lengths = np.linalg.norm(
        disk.vertices[disk.loop] - np.roll(disk.vertices[disk.loop], -1, axis=0), axis=1
    )
    angle = np.unwrap(np.arctan2(*uv[disk.loop].T[::-1]))
    assert_allclose(np.diff(angle), 2 * np.pi * lengths[:-1] / lengths.sum())  # and to the left
    inner = np.setdiff1d(np.arange(len(uv)), disk.loop)
    edges = Mesh(disk.vertices, disk.faces).edges
    for vertex in inner:
        near = edges[(edges == vertex).any(axis=1)].sum(axis=1) - vertex
        assert_allclose(uv[vertex], uv[near].mean(axis=0), atol=1e-12)


def test_bff_keeps_lengths_on_the_boundary():
    # Scale factors are zero there, so all boundary edges are scaled alike (to second order).
    cap = irregular_disk()
    disk = domain(cap)
    for spec, most in (("bff", 0.06), ("tutte", 1.0)):
        uv = mapped(spec, cap).uv
        ratio = np.linalg.norm(
            uv[disk.loop] - np.roll(uv[disk.loop], -1, axis=0), axis=1
        ) / np.linalg.norm(
            disk.vertices[disk.loop] - np.roll(disk.vertices[disk.loop], -1, axis=0), axis=1
        )
        assert np.ptp(ratio) / ratio.mean() < most


def test_slim_energies_by_hand_and_their_fall():
    one = np.ones(2)
    weight = np.array([0.25, 0.75])
    s1, s2 = 2 * one, one
    assert map_energy("symmetric_dirichlet", weight, s1, s2) == pytest.approx(6.25)
    assert map_energy("conformal", weight, s1, s2) == pytest.approx(1.25)
    assert map_energy("log_arap", weight, s1, s2) == pytest.approx(np.log(2) ** 2)
    assert map_energy("exp_conformal", weight, s1, s2) == pytest.approx(1.25)
    # exp(1e6 / 2) would overflow; the triangle's share of a quarter is left.
    far = map_energy("exp_conformal", weight, np.array([1e3, 1]), np.array([1e-3, 1]))
    assert far == pytest.approx(5e5 + 5e-7 + np.log(0.25))
    for flat in (0.0, -0.1):
        assert map_energy("conformal", weight, s1, np.array([1, flat])) == np.inf


@pytest.mark.parametrize(
    "energy", ["symmetric_dirichlet", "conformal", "log_arap", "exp_conformal"]
)
def test_slim_trace_has_the_energy_of_each_step(energy):
    mesh = irregular_disk()
    result = SLIM(energy, 12).parameterize(mesh, seed=0)
    values = [point.values[energy] for point in result.trace]
    assert [point.iteration for point in result.trace] == list(range(13))
    assert values == sorted(values, reverse=True)
    assert result.report["start_energy"] == values[0] > values[-1] == result.report["end_energy"]
    kept = [point.iteration for point in result.trace if point.uv is not None]
    assert kept == [0, 1, 2, 5, 10, 12]
    assert_array_equal(result.trace[-1].uv, result.uv)
    # An evaluation of its own: singular values from J^T J by way of each triangle's edge lengths.
    p, q = mesh.vertices[mesh.faces], result.uv[result.corners]
    first = [np.stack([s[:, 1] - s[:, 0], s[:, 2] - s[:, 0]], axis=2) for s in (p, q)]
    gram = [s.transpose(0, 2, 1) @ s for s in first]
    squares = np.sort(np.linalg.eigvals(np.linalg.solve(*gram)).real, axis=1)
    share = mesh.face_areas / mesh.face_areas.sum()
    again = map_energy(energy, share, *np.sqrt(squares[:, ::-1].T))
    assert again == pytest.approx(values[-1], rel=1e-9)


@pytest.mark.parametrize("energy", sorted(DENSITIES))
@pytest.mark.parametrize(
    ("sides", "height"), [(3, 1), (4, 0.5**0.5), (5, 0.5), (6, 0), (8, 2), (48, 1)]
)
def test_slim_at_its_minimum_is_no_failure(sides, height, energy):
    """Tutte's embedding of a regular cone is its minimum already, whatever the unit.

    Faces keep their bases and lose of their heights: singular values k and k times `lost`, with the
    best k for all faces.
    """
    around = np.arange(sides)
    angle = 2 * np.pi * around / sides
    rim = np.stack([np.cos(angle), np.sin(angle), np.zeros(sides)], axis=1)
    faces = np.stack([np.full(sides, sides), around, (around + 1) % sides], axis=1)
    inner = np.cos(np.pi / sides)
    lost = inner / np.hypot(inner, height)
    known = {
        "symmetric_dirichlet": 2 * (lost + 1 / lost),
        "conformal": (lost + 1 / lost) / 2,
        "log_arap": np.log(lost) ** 2 / 2,
        "exp_conformal": (lost + 1 / lost) / 2,
    }
    if (sides, height) == (4, 0.5**0.5):
        assert known["symmetric_dirichlet"] == pytest.approx(4.2426, abs=1e-4)
    for unit in (1e-3, 1, 1e3):
        mesh = Mesh(unit * np.vstack([rim, [[0, 0, height]]]), faces)
        report = SLIM(energy).parameterize(mesh, seed=0).report
        assert report["end_energy"] == pytest.approx(report["start_energy"], rel=1e-6, abs=1e-12)
        assert report["end_energy"] == pytest.approx(known[energy], rel=1e-6, abs=1e-9)


def test_slim_on_a_pyramid():
    """Equal faces, each stretched by √2 more in one direction: 2 (√2 + 1/√2) at the best scale."""
    rim = np.array([[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]])
    faces = [[4, 0, 1], [4, 1, 2], [4, 2, 3], [4, 3, 0]]
    mesh = Mesh(np.vstack([rim, [[0, 0, 1]]]), faces)
    assert mapped("slim", mesh).report["end_energy"] == pytest.approx(18**0.5, rel=1e-9)


def test_a_start_that_could_fall_is_not_the_minimum(monkeypatch):
    """A solver that gives its start back is found out, whatever the energy."""
    monkeypatch.setattr("baselines.disks.slim.stepper", lambda _disk, uv, _energy: lambda _: uv)
    for energy in DENSITIES:
        with pytest.raises(FlatteningError, match="did not fall"):
            SLIM(energy).parameterize(irregular_disk(), seed=0)


def test_slim_says_what_is_wrong_with_a_start():
    mesh = irregular_disk()
    start = Tutte().parameterize(mesh, seed=0).uv.copy()
    start[0] = 3 * start[-1]
    with pytest.raises(FlatteningError, match="symmetric_dirichlet energy did not fall in 20"):
        SLIM().improved(domain(mesh), start, 0.0)


def test_slim_refuses_a_start_with_flips(monkeypatch):
    monkeypatch.setattr("baselines.disks.slim.tutte", lambda disk: tutte(disk) * [1, -1])
    with pytest.raises(FlatteningError, match="128 flipped or degenerate triangles of 128"):
        mapped("slim", irregular_disk())


def test_ear_in_a_hole_is_embedded():
    # Vertex 16 hangs in the hole of a ring, on the edge 8-9: free, it would land on that edge.
    angle = np.arange(8) * np.pi / 4
    ring = np.stack([np.cos(angle), np.sin(angle), np.zeros(8)], axis=1)
    k, n = np.arange(8), (np.arange(8) + 1) % 8
    faces = [*np.stack([k, n, 8 + k], 1), *np.stack([n, 8 + n, 8 + k], 1), [8, 9, 16]]
    mesh = Mesh(np.vstack([2 * ring, ring, [[0.5, 0.2, 0]]]), faces)
    assert mesh.topology == "genus 0 with 2 boundary loops"
    result = mapped("tutte", mesh)
    assert (signed_areas(result.uv, result.corners) > 0).all()
    assert mapped("slim", mesh).report["end_energy"] < 4.2


@pytest.mark.parametrize("spec", ["slim(iterations=0)", "arap(iterations=-1)"])
def test_no_iterations_are_refused(spec):
    with pytest.raises(InputError, match="iterations must be at least 1"):
        registry.method(spec)


def test_slim_refuses_energies_that_do_not_work():
    with pytest.raises(InputError, match="must be one of symmetric_dirichlet"):
        SLIM(energy="arap")


def test_steps_that_a_trace_keeps():
    assert [n for n in range(1, 131) if is_kept(n, 130)] == [1, 2, 5, 10, 20, 50, 100, 130]


def test_arap_traces_some_steps_and_the_last():
    result = mapped("arap(iterations=12)", irregular_disk())
    assert [point.iteration for point in result.trace] == [1, 2, 5, 10, 12]
    assert_array_equal(result.trace[-1].uv, result.uv)
    energies = [point.values["arap"] for point in result.trace]
    assert energies == sorted(energies, reverse=True)
    assert result.report["end_energy"] == energies[-1]


def test_arap_takes_as_many_steps_as_its_trace_says():
    """A run that ends at a step has the map that a longer one keeps of that step."""
    longer = mapped("arap(iterations=12)", irregular_disk()).trace
    for point in longer[:-1]:
        shorter = mapped(f"arap(iterations={point.iteration})", irregular_disk())
        assert_allclose(shorter.uv, point.uv, atol=1e-9)
    apart = igl_steps(irregular_disk(), 12)
    assert_allclose(longer[-1].uv, apart, atol=1e-9)


def igl_steps(mesh, count):
    """The map after that many calls of libigl, a step each."""
    disk = domain(mesh)
    held, solver, uv = disk.loop[:1], igl.ARAPData(), tutte(disk)
    place = uv[held]
    igl.arap_precomputation(disk.vertices, disk.faces, 2, held.astype(np.int32), solver)
    solver.max_iter = 1
    for _ in range(count):
        uv = igl.arap_solve(place, solver, uv)
    return uv


@pytest.mark.parametrize("start", range(4))
def test_a_closed_curve_is_turned_onto_its_longest_axis(start):
    """A parallelogram of sides 2 and 1, at 60 degrees, from each of its corners."""
    lengths = np.roll([2.0, 1, 2, 1], start)
    turning = np.roll(np.radians([120, 60, 120, 60]), start)
    curve = closed_curve(lengths, turning)
    along = np.roll(curve, -1, axis=0) - curve
    assert_allclose(np.linalg.norm(along, axis=1), lengths)
    assert signed_areas(curve, np.array([[0, 1, 2], [0, 2, 3]])).sum() == pytest.approx(np.sqrt(3))
    u, v = (curve - curve.mean(axis=0)).T
    assert u @ v == pytest.approx(0, abs=1e-12)
    assert u @ u > v @ v


def test_arap_energy_and_flips_by_a_second_route():
    # Nearly a whole sphere: what Tutte's embedding squeezes around the pole, ARAP turns over.
    mesh = builtin.sphere_cap(170, rings=8)
    result = mapped("arap(iterations=5)", mesh)
    areas = signed_areas(result.uv, result.corners)
    assert result.report["flipped"] == (areas <= 0).sum() > 0
    # Of each Jacobian J: (s1 - 1)² + (s2 - 1)² = |J|² + 2 - 2 (s1 + s2), and (s1 + s2)² =
    # |J|² + 2 det J, where s2 has the sign of the determinant.
    p, q = mesh.vertices[mesh.faces], result.uv[result.corners]
    first = [np.stack([s[:, 1] - s[:, 0], s[:, 2] - s[:, 0]], axis=2) for s in (p, q)]
    gram = [s.transpose(0, 2, 1) @ s for s in first]
    norm = np.trace(np.linalg.solve(*gram), axis1=1, axis2=2)
    determinant = areas / mesh.face_areas
    both = np.sqrt(np.maximum(norm + 2 * determinant, 0))
    share = mesh.face_areas / mesh.face_areas.sum()
    assert share @ (norm + 2 - 2 * both) == pytest.approx(result.report["end_energy"], rel=1e-6)


def test_slim_refuses_a_start_with_a_triangle_without_area(monkeypatch):
    on_a_line = np.array([[0.0, 0], [1, 0], [2, 0]])
    monkeypatch.setattr("baselines.disks.slim.tutte", lambda _: on_a_line)
    with pytest.raises(FlatteningError, match="has 1 flipped or degenerate triangles of 1"):
        mapped("slim", Mesh(np.eye(3), [[0, 1, 2]]))


def test_a_start_whose_energy_has_no_number_is_no_minimum():
    disk = domain(irregular_disk())
    frame = frames(disk.vertices, disk.faces)
    weight = np.full(len(disk.faces), 1 / len(disk.faces))
    flipped = tutte(disk) * [1, -1]
    for name in DENSITIES:
        assert not is_minimum(name, weight, frame, flipped, disk.faces)
        # Nor is one so narrow that the exponential of its energy is beyond all numbers.
        assert not is_minimum(name, weight, frame, tutte(disk) * [1, 1e-3], disk.faces)
    # Where nothing pulls, as on a triangle mapped to itself, the slope is 0 and it is one.
    one = domain(Mesh([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]))
    assert is_minimum(
        "conformal", np.ones(1), frames(one.vertices, one.faces), one.vertices[:, :2], one.faces
    )


def test_lscm_lays_its_far_vertices_on_the_first_axis_from_the_origin():
    mesh = rolled(flat_disk())
    disk = domain(mesh)
    one, other = far_pair(disk.vertices[disk.loop])
    first, second = mapped("lscm", mesh).uv[disk.loop[[one, other]]]
    assert_allclose(first, 0, atol=1e-9)
    assert second[1] == pytest.approx(0, abs=1e-9)
    assert second[0] > 1


@pytest.mark.parametrize(
    ("spec", "embedding"),
    [("tutte", "tutte.tutte"), ("mean_value", "mean_value.embedded")],
)
def test_flips_and_triangles_without_area_are_counted_apart(monkeypatch, spec, embedding):
    """A fan whose first triangle is drawn on a line; in the mirror the others are turned over."""
    angle = np.radians([0, 60, 120, 180, 240])
    rim = np.stack([np.cos(angle), np.sin(angle), np.zeros(5)], axis=1)
    faces = np.stack([np.full(5, 5), np.arange(5), (np.arange(5) + 1) % 5], axis=1)
    mesh = Mesh(np.vstack([rim, [[0, 0, 0.5]]]), faces)
    flat = np.array([[1, 0], [2, 0], [0, 1], [-1, 0], [0, -1], [0, 0.0]])
    monkeypatch.setattr(f"baselines.disks.{embedding}", lambda *_: flat)
    assert mapped(spec, mesh).report == {"flipped": 0, "degenerate": 1}
    flat = flat * [1, -1]
    assert mapped(spec, mesh).report == {"flipped": 4, "degenerate": 1}


def test_the_cotangents_of_a_harmonic_map_balance_inside_and_at_holes():
    mesh = sample_surfaces()["a disk with a hole"]
    disk = domain(mesh)
    uv = mapped("harmonic", mesh).uv
    pull = igl.cotmatrix(disk.vertices, disk.faces) @ uv
    assert_allclose(np.delete(pull, disk.loop, axis=0), 0, atol=1e-10)
    assert_allclose(np.linalg.norm(uv[disk.loop], axis=1), np.linalg.norm(uv[disk.loop[0]]))
