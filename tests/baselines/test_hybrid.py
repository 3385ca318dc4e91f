"""SLIM along learned and given seams, and whether a map is one to one."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from baselines import registry
from benchmarks.cases import builtin
from benchmarks.metrics.evaluation import evaluate
from parapoint.errors import InputError
from parapoint.method import UnsupportedError
from parapoint.planar.crossing import crossing_vertices
from parapoint.planar.descent import Run
from parapoint.planar.growth import Need, grown
from parapoint.surfaces.across_seams import learned_seam
from parapoint.surfaces.areas import signed_areas
from parapoint.surfaces.cutting import cut_along, cut_to_disk, disk_cut, edge_lengths
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.preparation import prepared
from parapoint.surfaces.surface import Mesh
from parapoint.testing import irregular_disk, sphere
from parapoint.unwrapping import unwrap


def torn(mesh, cut):
    """(V, 2) a flat map of the mesh cut along the edges `cut`, one uv a vertex, as ParaPoint's."""
    disk = cut_along(mesh, mesh.edges[cut])
    uv = registry.method("slim")[1].parameterize(disk, seed=0).uv
    origin = np.empty(len(disk.vertices), dtype=np.int64)
    origin[disk.faces] = mesh.faces
    chosen = np.empty(len(mesh.vertices), dtype=np.int64)
    chosen[origin[::-1]] = np.arange(len(origin))[::-1]  # the first copy stands for all
    return uv[chosen]


@pytest.mark.parametrize("make", [lambda: builtin.sphere(3), lambda: builtin.torus(16)])
def test_the_seam_of_a_map_is_found_again_as_a_clean_path(make):
    mesh = make()
    # Not the automatic cut, but one that is as good as any other.
    cost = edge_lengths(mesh) * np.random.default_rng(4).uniform(1, 2, len(mesh.edges))
    cut = disk_cut(mesh, cost)
    uv = torn(mesh, cut)
    seam = learned_seam(mesh, uv)
    disk = cut_along(mesh, mesh.edges[seam])
    assert disk.topology == "disk"
    length = edge_lengths(mesh)
    assert length[seam].sum() < 1.3 * length[cut].sum()
    # Every vertex of it lies on the true cut or one edge beside it.
    on_cut = np.zeros(len(mesh.vertices), dtype=bool)
    on_cut[mesh.edges[cut]] = True
    near = on_cut.copy()
    near[mesh.edges[on_cut[mesh.edges].any(axis=1)]] = True
    assert near[mesh.edges[seam]].mean() > 0.95


def test_a_map_without_a_tear_has_no_seam():
    disk = irregular_disk()
    assert not learned_seam(disk, disk.vertices[:, :2]).any()
    # A sphere must be cut all the same: automatically.
    ball = sphere()
    assert_array_equal(learned_seam(ball, ball.vertices[:, :2]), disk_cut(ball))


def test_a_seam_that_ends_inside_a_disk_is_a_slit():
    mesh = builtin.saddle(20)
    x, y, _ = mesh.vertices.T
    uv = np.stack([x + 3 * ((y > 0.02) & (x > 0.12)), y], axis=1)
    seam = learned_seam(mesh, uv)
    middle = mesh.vertices[mesh.edges[seam]].reshape(-1, 3)
    assert seam.any()
    assert np.abs(middle[:, 1]).max() < 0.3 or np.abs(middle[:, 0] - 0.12).max() < 0.3
    assert cut_along(mesh, mesh.edges[seam]).topology == "disk"


def test_crossing_vertices_by_hand():
    # A strip of four quads bent to a ring whose ends overlap, touch, or stay apart.
    angle = np.linspace(0, 1, 9)
    faces = [[2 * k, 2 * k + 1, 2 * k + 3] for k in range(8)]
    faces += [[2 * k, 2 * k + 3, 2 * k + 2] for k in range(8)]
    strip = Mesh(
        np.stack([np.repeat(angle, 2), np.tile([0, 0.1], 9), 0 * angle.repeat(2)], 1), faces
    )

    def ring(turn):
        t = turn * np.repeat(angle, 2)
        radius = np.tile([2.0, 1.0], 9)
        return np.stack([radius * np.cos(t), radius * np.sin(t)], axis=1)

    assert len(crossing_vertices(strip, ring(6.0))) == 0
    assert {0, 1} < set(crossing_vertices(strip, ring(6.6)).tolist())
    touching = ring(6.0)
    touching[16:] = touching[:2]
    assert {0, 1, 16, 17} <= set(crossing_vertices(strip, touching).tolist())
    # What it says is what the exact overlap of the faces says.
    for turn in (6.0, 6.6):
        found = evaluate(strip, Parameterization(ring(turn), strip.faces))["overlap_area"]
        assert (found > 0) == (turn > 2 * np.pi)


def test_a_map_stays_one_to_one_where_free_steps_do_not():
    mesh = slit_ruffle()
    free = registry.method("slim")[1].parameterize(mesh, seed=0)
    assert len(crossing_vertices(mesh, free.uv)) > 0
    run = Run(mesh)
    run.begin()
    run.improve()
    assert len(crossing_vertices(mesh, run.uv)) == 0
    assert (signed_areas(run.uv, mesh.faces) > 0).all()
    # More than the free map's, which is an isometry that overlaps, and not stuck far above it.
    assert free.trace[-1].values["symmetric_dirichlet"] < run.energy < 5


def slit_ruffle(rings=8):
    """A cone of more than a full turn, slit from its rim to its apex: unrolled, it overlaps."""
    points, faces = builtin.disk_points(rings)
    angle = np.arctan2(points[:, 1], points[:, 0])
    height = 0.6 * np.linalg.norm(points, axis=1) * np.sin(4 * angle)
    first = [0, *(1 + 3 * k * (k - 1) for k in range(1, rings + 1))]  # of each ring, at angle 0
    mesh = Mesh(np.column_stack([points, height]), faces)
    return cut_along(mesh, np.stack([first[:-1], first[1:]], axis=1))


def test_the_hybrid_on_a_torus_is_one_to_one_and_better_than_the_automatic_cut():
    mesh = builtin.torus(20)
    result = registry.method("unwrap")[1].parameterize(mesh, seed=0)
    found = evaluate(mesh, result)
    assert result.report["bijective"]
    assert found["flipped_fraction"] == 0
    assert found["overlap_area"] == 0
    assert found["chart_count"] == 1
    cut = cut_to_disk(mesh)
    other = registry.method("slim(iterations=10)")[1].parameterize(cut, seed=0)
    energy = [evaluate(mesh, of)["symmetric_dirichlet"] for of in (result, other)]
    assert energy[0] < energy[1]


def test_the_automatic_cut_grows_and_stays_one_to_one_too():
    mesh = sphere()
    cut = cut_to_disk(mesh)
    energies = {}
    for price in (None, 0.05):
        result = registry.method(f"automatic+slim(price={price})")[1].parameterize(cut, seed=0)
        found = evaluate(mesh, result)
        assert result.report["bijective"]
        assert found["overlap_area"] == found["flipped_fraction"] == 0
        assert found["symmetric_dirichlet"] == pytest.approx(result.report["end_energy"], rel=1e-3)
        energies[price] = found["symmetric_dirichlet"]
    assert result.report["branches_added"] > 0
    assert energies[0.05] < energies[None]


def test_a_branch_must_pay():
    cap = builtin.sphere_cap(150, rings=10)
    energies = []
    for price in (1e9, 0.05):
        run = Run(cap)
        run.begin()
        run.improve()
        run = grown(run, Need(price))
        energies.append(run.energy)
        assert (run.branches > 0) == (price < 1)
        assert len(crossing_vertices(run.mesh, run.uv)) == 0
    assert energies[1] < energies[0] - 0.05


def test_the_price_of_a_seam_is_the_same_at_every_scale():
    cap = builtin.sphere_cap(150, rings=5)
    found = []
    for scale in (1, 2.0**10):  # exact: the two runs differ by nothing but the unit
        run = Run(Mesh(scale * cap.vertices, cap.faces))
        run.begin()
        run.improve()
        run = grown(run, Need(0.05))
        found.append((run.branches, run.energy))
    assert found[0][0] > 0
    assert found[1] == pytest.approx(found[0], rel=1e-3)


def test_the_artist_s_charts_are_kept_and_packed_apart():
    mesh = sphere()
    disk = cut_to_disk(mesh)
    z = mesh.vertices[mesh.faces].mean(axis=1)[:, 2]
    # The equator: two charts.
    order = np.argsort(mesh.edge_of_halfedge, kind="stable").reshape(-1, 2) // 3
    equator = mesh.edges[(z[order] > 0).sum(axis=1) == 1]
    result = registry.method("artist+slim")[1].parameterize(
        Mesh(mesh.vertices, mesh.faces, equator), seed=0
    )
    assert result.report == {"charts": 2, "charts_cut_to_disks": 0}
    assert_array_equal(result.charts() == result.charts()[0], (z > 0) == (z[0] > 0))
    found = evaluate(mesh, result)
    assert found["overlap_area"] == found["flipped_fraction"] == 0
    length = np.linalg.norm(np.diff(mesh.vertices[equator], axis=1), axis=2).sum()
    assert_allclose(found["seam_length"], length / np.sqrt(mesh.face_areas.sum()))
    # A slit that opens nothing: the one chart is cut to a disk.
    slit = registry.method("artist+slim")[1].parameterize(
        Mesh(mesh.vertices, mesh.faces, equator[:1]), seed=0
    )
    assert slit.report["charts_cut_to_disks"] == 1
    assert len(slit.uv) == len(disk.vertices)


def test_a_seam_is_computed_only_where_a_mesh_has_to_be_opened(monkeypatch):
    asked = []

    def stop(mesh, _):
        asked.append(mesh)
        raise InterruptedError

    monkeypatch.setattr(unwrap, "map_of_faces", stop)
    bent, cap = irregular_disk(), builtin.sphere_cap(150, rings=5)
    flat = Mesh(bent.vertices * [1, 1, 0], bent.faces)
    made = registry.method("unwrap")[1].parameterize(flat, seed=0)
    assert_allclose(made.report["end_energy"], 4, atol=1e-4)
    assert made.report["first_cut_edges"] == 0
    assert not asked
    ball = builtin.sphere()
    for spec, mesh in (
        ("unwrap", builtin.torus(4)),
        ("unwrap", ball),
        ("unwrap", cap),  # whose map without a seam gets one
        ("unwrap(price=None)", flat),  # the learned seam, whatever it costs
        ("unwrap(distortion=conformal)", flat),  # angles, along the first seam
        ("unwrap(max_distortion=4.01)", cap),  # a bound that its map without a seam misses
    ):
        with pytest.raises(InterruptedError):
            registry.method(spec)[1].parameterize(mesh, seed=0)
    assert len(asked) == 6


def test_what_is_refused():
    artist = registry.method("artist+slim")[1]
    with pytest.raises(UnsupportedError, match="needs a mesh that came with a UV map"):
        prepared(irregular_disk(), artist.requires)
    with pytest.raises(InputError, match="price must be a number of at least 0, not -1"):
        registry.method("unwrap(price=-1)")
