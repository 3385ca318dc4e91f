"""`unwrap` of meshes: the same mesh with new UVs, and what is said of them."""

import contextlib
import io
import json
import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from PIL import Image

from parapoint import InputError, cli, clock
from parapoint.commands.given_seams import read_seams
from parapoint.commands.telling import ADVICE_OF_MESHES, warn
from parapoint.commands.unwrapping import Request, _advice, _one_each, _warn_of_bound, expected
from parapoint.files.meshes.gltf import opened
from parapoint.files.reading import read_parameterized, read_surface
from parapoint.files.writing.mesh_writers import write_npz
from parapoint.surfaces.areas import LEAST_PART, MOST_STARVED
from parapoint.surfaces.parameterization import Charted, Parameterization
from parapoint.surfaces.surface import Mesh
from parapoint.testing import irregular_disk, sphere
from parapoint.unwrapping import unwrap
from parapoint.unwrapping.given import mended_along
from parapoint.unwrapping.quality import quality
from parapoint.unwrapping.unwrap import Unwrap

BOX = """# a box of quads
mtllib colours.mtl
o box
v 0 0 0 1 0 0
v 1 0 0
v 1 1 0
v 0 1 0
v 0 0 2
v 1 0 2
v 1 1 2
v 0 1 2
vt 0 0
vn 0 0 1
g sides
usemtl red
f 1/1/1 4/1/1 3/1/1 2/1/1
f -4//1 6//1 7//1 8//1
g more
f 1 2 6 5
f 2 3 7 6
f 3 4 8 7
f 4 1 5 8
l 1/1 2/1
"""
NET = "1 2\n2 3\n3 4\n5 6  # one upright edge follows at the end\n6 7\n7 8\n1 5\n"
"""Edges along which the box unfolds: two numbers a line."""


def run(arguments: list, capsys) -> tuple[int, str, str]:
    """Exit status, standard output and standard error of a command."""
    with pytest.raises(SystemExit) as end:
        cli.console.run(cli.parapoint, list(map(str, arguments)))
    shown = capsys.readouterr()
    return int(end.value.code or 0), shown.out, shown.err


@pytest.fixture
def box(tmp_path):
    path = tmp_path / "box.obj"
    path.write_text(BOX)
    (tmp_path / "net.txt").write_text(NET)
    (tmp_path / "colours.mtl").write_text("newmtl red\nKd 1 0 0\n")
    return path


def unfold(box, target, capsys, *more):
    return run(["unwrap", box, "--out", target, "--seams", box.parent / "net.txt", *more], capsys)


def test_an_obj_file_keeps_all_its_lines_but_for_the_uvs(box, tmp_path, capsys) -> None:
    target = tmp_path / "deeper" / "out.obj"
    target.parent.mkdir()
    status, out, _ = unfold(box, target, capsys, "--json")
    assert status == 0
    facts = json.loads(out)
    assert facts["polygons_split"] == facts["flipped"] == 0
    assert facts["charts"] == 1
    assert facts["stretch_worst"] < 1.001  # a net is an isometry
    assert facts["angle_worst"] < 0.1
    assert facts["overlap"] == "none"

    def bare(text):
        kept = [line for line in text.splitlines() if not line.startswith(("vt ", "f ", "l "))]
        return [line.replace("../", "") for line in kept]

    written = target.read_text()
    assert bare(written) == bare(BOX)
    faces = [line.split()[1:] for line in written.splitlines() if line.startswith("f ")]
    given = [line.split()[1:] for line in BOX.splitlines() if line.startswith("f ")]
    for after, before in zip(faces, given, strict=True):
        for word, old in zip(after, before, strict=True):
            vertex, _, normal = (*word.split("/"), "")[:3]
            assert vertex == old.split("/")[0]
            assert normal == (*old.split("/"), "", "")[2]
    assert not target.with_suffix(".mtl").exists()
    mesh, own = read_parameterized(target)
    assert np.array_equal(mesh.vertices, read_surface(box).vertices)
    assert own.uv.min() >= 0
    assert own.uv.max() <= 1


def test_a_seam_through_a_polygon_makes_it_triangles_and_says_so(
    box, tmp_path, capsys, caplog
) -> None:
    # The quads are cut along 1-3, 5-7, ...: a cut that takes the diagonal 1-3 instead of 1-2-3.
    (tmp_path / "net.txt").write_text("1 3\n3 4\n5 6\n6 7\n7 8\n1 5\n")
    status, out, _ = unfold(box, tmp_path / "out.obj", capsys, "--json")
    assert status == 0
    assert json.loads(out)["polygons_split"] == 1
    assert "they became triangles" in caplog.text
    assert (tmp_path / "out.obj").read_text().count("\nf ") == 7


def soup(path) -> None:
    """Write a sphere whose faces have three vertices each of their own."""
    ball = sphere()
    lines = [f"v {x} {y} {z}" for x, y, z in ball.vertices[ball.faces].reshape(-1, 3)]
    lines += [f"f {k} {k + 1} {k + 2}" for k in range(1, ball.faces.size, 3)]
    path.write_text("\n".join(lines))


def test_seams_join_the_vertices_that_lie_at_one_place(tmp_path, capsys) -> None:
    """Each end of an edge is named by another of the vertices there than a face of it has."""
    soup(tmp_path / "soup.obj")
    ball = sphere()
    last = {vertex: k + 1 for k, vertex in enumerate(ball.faces.reshape(-1).tolist())}
    a, b = ball.edges[0].tolist()
    c = next(of for of in ball.edges.tolist() if b == of[0] and a not in of)[1]
    (tmp_path / "seams.txt").write_text(f"{last[a]} {last[b]}\n{last[b]} {last[c]}\n")
    arguments = ["unwrap", tmp_path / "soup.obj", "--out", tmp_path / "out.obj", "--json"]
    status, out, _ = run([*arguments, "--seams", tmp_path / "seams.txt"], capsys)
    assert status == 0
    facts = json.loads(out)
    assert (facts["charts"], facts["components"], facts["overlap"]) == (1, 1, "none")
    assert facts["welded"] == ball.faces.size - len(ball.vertices)
    ends = ball.vertices[[a, b, c]]
    length = np.linalg.norm(np.diff(ends, axis=0), axis=1).sum()
    assert facts["seam"] == pytest.approx(length / np.sqrt(ball.face_areas.sum()), rel=1e-3)
    vertices = [
        line for line in (tmp_path / "out.obj").read_text().splitlines() if line[:2] == "v "
    ]
    assert vertices == (tmp_path / "soup.obj").read_text().splitlines()[: len(vertices)]


def test_the_seams_of_a_map_are_followed(box, tmp_path, capsys) -> None:
    """The box unfolds along its net again, whatever file the map is in and how it is scaled."""
    unfold(box, tmp_path / "net.obj", capsys)
    unfold(box, tmp_path / "net.glb", capsys)
    for kept in ("net.obj", "net.glb"):
        again = ["unwrap", box, "--out", tmp_path / "again.obj", "--seams", tmp_path / kept]
        status, out, _ = run([*again, "--json"], capsys)
        facts = json.loads(out)
        assert (status, facts["charts"]) == (0, 1)
        assert facts["stretch_worst"] < 1.001
        assert facts["seam"] == pytest.approx((6 + 2) / math.sqrt(10), rel=1e-3)


def test_a_map_of_another_surface_has_no_seams_for_this_one(box, tmp_path, capsys) -> None:
    unfold(box, tmp_path / "net.obj", capsys)
    open_box = BOX.replace("f 1 2 6 5\n", "").replace("f 4 1 5 8\n", "")
    (tmp_path / "other.obj").write_text(open_box)
    seams = ["--seams", tmp_path / "net.obj"]
    status, _, err = run(
        ["unwrap", tmp_path / "other.obj", "--out", tmp_path / "a.obj", *seams], capsys
    )
    assert status == 2
    assert "net.obj: has a seam near [" in err
    assert err.count("\n") == 1
    status, _, err = run(["unwrap", box, "--out", tmp_path / "a.obj", "--seams", box], capsys)
    assert status == 2
    assert "have no UV; each must have one" in err
    assert not (tmp_path / "a.obj").exists()


@pytest.mark.parametrize("scale", [1000, 1.1, 0.5])
def test_seams_of_a_map_lie_on_the_mesh(scale, box, tmp_path) -> None:
    """Nearest vertices of a mesh of another size may have the same edges, and mean nothing."""
    mesh = read_surface(box)
    uv = np.arange(72.0).reshape(36, 2)
    corners = np.arange(36).reshape(12, 3)
    charted = Charted(Mesh(scale * mesh.vertices, mesh.faces), Parameterization(uv, corners))
    write_npz(tmp_path / "far.npz", charted)
    with pytest.raises(InputError, match=r"far\.npz: has a seam that is .* off the vertices"):
        read_seams(str(tmp_path / "far.npz"), mesh)
    write_npz(tmp_path / "near.npz", charted._replace(mesh=Mesh(1.001 * mesh.vertices, mesh.faces)))
    assert len(read_seams(str(tmp_path / "near.npz"), mesh)) == 18


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-32"])
def test_seams_are_read_in_any_encoding(encoding, box) -> None:
    """As other texts are."""
    path = box.parent / "net.txt"
    path.write_text(NET, encoding=encoding)
    assert read_seams(str(path), read_surface(box))[0].tolist() == [0, 1]


def test_the_file_of_seams_is_not_replaced(box, tmp_path, capsys) -> None:
    unfold(box, tmp_path / "net.obj", capsys)
    before = (tmp_path / "net.obj").read_text()
    seams = ["--seams", tmp_path / "net.obj"]
    status, _, err = run(["unwrap", box, "--out", tmp_path / "net.obj", *seams], capsys)
    assert status == 2
    assert "net.obj: is the input, which is not replaced" in err
    assert (tmp_path / "net.obj").read_text() == before


def test_the_largest_component_is_found_across_split_vertices(tmp_path, capsys) -> None:
    """A square of two triangles, each with its own vertices, and a triangle apart."""
    corners = [(0, 0), (1, 0), (1, 1), (0, 0), (1, 1), (0, 1), (5, 5), (6, 5), (5, 6)]
    lines = [f"v {x} {y} 0" for x, y in corners] + ["f 1 2 3", "f 4 5 6", "f 7 8 9"]
    (tmp_path / "square.obj").write_text("\n".join(lines))
    arguments = ["unwrap", tmp_path / "square.obj", "--out", tmp_path / "out.obj", "--json"]
    _, out, _ = run([*arguments, "--components", "largest"], capsys)
    facts = json.loads(out)
    assert [facts[name] for name in ("faces", "charts", "components", "seam")] == [2, 1, 1, 0]


def test_seams_share_the_clock_of_the_time_budget(box, tmp_path, capsys, monkeypatch) -> None:
    deadlines = []

    def noted(mesh, seams, deadline):
        deadlines.append(deadline - clock.worked())
        return mended_along(mesh, seams, deadline)

    monkeypatch.setattr("parapoint.commands.unwrapping.mended_along", noted)
    for more in ([], ["--time-budget", 50]):
        assert unfold(box, tmp_path / "out.obj", capsys, *more)[0] == 0
    assert deadlines == [math.inf, pytest.approx(50, abs=1)]


@pytest.mark.parametrize("ending", ["obj", "ply", "glb", "npz"])
def test_each_vertex_gets_one_uv_and_faces_and_figures_are_of_that(
    ending, tmp_path, capsys, caplog
) -> None:
    """A tetrahedron is cut to a net of its four faces; two of them cannot keep their places."""
    (tmp_path / "four.off").write_text(
        "OFF\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 0 3\n"
    )
    (tmp_path / "net.txt").write_text("1 2\n1 3\n1 4\n")
    out = tmp_path / f"new.{ending}"
    arguments = ["unwrap", tmp_path / "four.off", "--seams", tmp_path / "net.txt", "--out", out]
    status, said, _ = run([*arguments, "--per-vertex", "--texture", 64, "--json"], capsys)
    facts = json.loads(said)
    assert (status, facts["seam"], "energy" in facts) == (0, 0, False)
    assert facts["overlap"] == "unknown"
    assert "with --per-vertex, faces across a seam span the map" in caplog.text
    mesh, held = read_parameterized(out)
    assert len(mesh.vertices) == len(np.unique(held.corners)) == 4
    assert np.array_equal(held.corners, mesh.faces)
    found = quality(Charted(mesh, held), 64).facts()
    for name in ("angle_mean", "angle_worst", "stretch_worst", "flipped", "filled"):
        assert facts[name] == pytest.approx(found[name], rel=1e-3)
    if ending == "npz":
        assert "no texture is written: this format has none" in caplog.text
    elif ending != "glb":
        with Image.open(tmp_path / "new.png") as picture:
            assert picture.size == (64, 64)


def test_of_the_uvs_of_a_vertex_one_is_chosen_and_without_any_the_middle() -> None:
    points = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [9, 9, 9]])
    uv = np.array([[0.1, 0.1], [0.4, 0.1], [0.4, 0.4], [0.6, 0.6], [0.9, 0.9], [0.6, 0.9]])
    placed = Charted(
        Mesh(points, [[0, 1, 2], [0, 2, 3]]), Parameterization(uv, [[0, 1, 2], [3, 4, 5]])
    )
    assert_allclose(_one_each(placed).map.uv, [*uv[:3], uv[5], [0.5, 0.5]])


def test_a_texture_that_an_obj_file_has_no_use_for_is_said(box, tmp_path, capsys, caplog) -> None:
    unfold(box, tmp_path / "out.obj", capsys, "--texture", 64)
    assert "no texture is written: its own colours and materials stay" in caplog.text
    assert not (tmp_path / "out.png").exists()


def test_other_formats(box, tmp_path, capsys, caplog) -> None:
    unfold(box, tmp_path / "out.npz", capsys)
    assert (
        "left out: old UVs, polygons, normals, objects, groups, materials, lines. A" in caplog.text
    )
    with np.load(tmp_path / "out.npz") as held:
        assert held["vertices"].shape == (8, 3)
        assert held["uv"].shape == (14, 2)
        assert held["corners"].shape == held["faces"].shape == (12, 3)
    unfold(box, tmp_path / "out.glb", capsys)
    assert len(read_surface(tmp_path / "out.glb").faces) == 12


def test_a_copy_of_a_face_is_not_flipped(tmp_path, capsys) -> None:
    path = tmp_path / "twice.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\nf 2 3 1\n")
    status, out, _ = run(["unwrap", path, "--out", tmp_path / "a.obj", "--json"], capsys)
    facts = json.loads(out)
    assert (status, facts["flipped"], facts["overlap"]) == (0, 0, "unknown")


@pytest.mark.parametrize("faces", ["f 1 2 3", "f 1 2 3\nf 1 3 4", "f 1 2 3 4"])
def test_the_two_sides_of_a_sheet_keep_their_own_colours(faces, tmp_path, capsys, caplog) -> None:
    """A leaf: each face twice, wound the other way, with a material of its own."""
    path = tmp_path / "leaf.obj"
    (tmp_path / "leaf.mtl").write_text("newmtl front\nKd 1 0 0\nnewmtl back\nKd 0 0 1\n")
    back = "\n".join(f"f {' '.join(reversed(face.split()[1:]))}" for face in faces.split("\n"))
    corners = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
    path.write_text(f"mtllib leaf.mtl\n{corners}usemtl front\n{faces}\nusemtl back\n{back}\n")
    out = tmp_path / "out.glb"
    status, _, _ = run(["unwrap", path, "--out", out, "--texture", 64, "--json"], capsys)
    assert status == 0
    assert not caplog.messages or "left out" in caplog.text
    picture = np.asarray(Image.open(io.BytesIO(opened(out).image(0))), dtype=int)
    mesh, held = read_parameterized(out)
    side = np.sign(
        np.cross(
            *(mesh.vertices[mesh.faces[:, k]] - mesh.vertices[mesh.faces[:, 0]] for k in (1, 2))
        )[:, 2]
    )
    middle = held.uv[held.corners].mean(axis=1)
    rows, columns = ((1 - middle[:, 1]) * 64).astype(int), (middle[:, 0] * 64).astype(int)
    wanted = np.where(side[:, None] > 0, [255, 0, 0], [0, 0, 255])
    assert np.abs(picture[rows, columns, :3] - wanted).max() <= 2


@pytest.mark.parametrize("ending", [".npz", ".ply", ".obj", ".glb"])
def test_colours_that_no_texture_shows_are_said_to_be_left_out(
    ending, tmp_path, capsys, caplog
) -> None:
    """Two components, of which the largest is written in the last two runs."""
    path = tmp_path / "coloured.off"
    corners = "0 0 0 255 0 0\n1 0 0 0 255 0\n0 1 0 0 0 255\n"
    more = "9 0 0 1 2 3\n9.1 0 0 1 2 3\n9 0.1 0 1 2 3\n"
    path.write_text(f"COFF\n6 2 0\n{more}{corners}3 0 1 2\n3 3 4 5\n")
    out = tmp_path / f"out{ending}"
    assert run(["unwrap", path, "--out", out, "--components", "largest"], capsys)[0] == 0
    shown = ending in {".obj", ".glb"}
    assert ("left out: colours" in caplog.text) == (not shown)
    if ending == ".obj":
        picture = np.asarray(Image.open(tmp_path / "out.png"), dtype=int)
        mesh, held = read_parameterized(out)
        assert len(mesh.faces) == 1
        middle = held.uv[held.corners[0]].mean(axis=0)
        row, column = ((1 - middle[1]) * len(picture), middle[0] * len(picture))
        assert np.abs(picture[int(row), int(column)] - 85).max() <= 2


def test_the_margin_is_in_texels_of_the_texture_that_is_written(
    box, tmp_path, capsys, monkeypatch
) -> None:
    """An old picture that is larger than TEXTURE sets the size."""
    monkeypatch.setattr("parapoint.commands.mesh_output.TEXTURE", 64)
    monkeypatch.setattr("parapoint.commands.unwrap.TEXTURE", 64)
    (tmp_path / "colours.mtl").write_text("newmtl red\nmap_Kd large.png\n")
    Image.new("RGB", (256, 256), (9, 9, 9)).save(tmp_path / "large.png")
    unfold(box, tmp_path / "out.glb", capsys, "--margin", 8)
    assert read_parameterized(tmp_path / "out.glb")[1].uv.min() == pytest.approx(8 / 256, abs=1e-3)


@pytest.mark.parametrize(
    ("seams", "more", "message"),
    [
        ("1 7\n", [], "line 1 is no edge of the mesh"),
        ("1 2\n0 1\n", [], "line 2 is no edge of the mesh; numbers count from 1"),
        ("2 99\n", [], "line 1 is no edge of the mesh"),
        ("1 2 3\n", [], "line 1 is not two vertex numbers"),
        ("# none\n", [], "has no edge"),
        (NET, ["--max-distortion", "4.1"], "--max-distortion does not go with --seams"),
        (NET, ["--components", "largest"], "--components largest does not go with --seams"),
        (NET, ["--components", "some"], "--components must be one of"),
    ],
)
def test_wrong_use_is_one_line(seams, more, message, box, capsys) -> None:
    (box.parent / "net.txt").write_text(seams)
    target = box.parent / "out.obj"
    status, out, err = unfold(box, target, capsys, *more)
    assert (status, out) == (2, "")
    assert message in err
    assert err.count("\n") == 1
    assert "--seams" in err or err.count(str(box.parent)) <= 1
    assert not target.exists()


def test_options_of_meshes_are_refused_for_clouds(tmp_path, capsys) -> None:
    np.savetxt(tmp_path / "a.xyz", np.random.default_rng(0).random((200, 3)))
    with contextlib.chdir(tmp_path):
        status, _, err = run(["unwrap", "a.xyz", "--out", "b.npz", "--per-vertex"], capsys)
    assert status == 2
    assert "--per-vertex is for meshes" in err


def test_a_bound_that_is_missed_is_said(tmp_path, capsys, caplog) -> None:
    mesh = irregular_disk()
    lines = [f"v {x} {y} {z}" for x, y, z in mesh.vertices * [1, 1, 3]]
    lines += [f"f {a} {b} {c}" for a, b, c in mesh.faces + 1]
    (tmp_path / "disk.obj").write_text("\n".join(lines))
    arguments = ["unwrap", tmp_path / "disk.obj", "--out", tmp_path / "out.obj"]
    status, out, _ = run(
        [*arguments, "--max-distortion", "4.000001", "--time-budget", "0.1"], capsys
    )
    assert status == 0
    assert "overlap: none" in out
    assert "above --max-distortion" in caplog.text


@pytest.mark.parametrize(("name", "is_y_up"), [("box.obj", True), ("square.off", False)])
def test_a_picture_of_a_mesh_is_opaque_and_upright(name, is_y_up, box, capsys, monkeypatch) -> None:
    folder = box.parent
    (folder / "colours.mtl").write_text("newmtl red\nmap_Kd clear.png\n")
    Image.new("RGBA", (2, 2)).save(folder / "clear.png")
    square = "OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n"
    (folder / "square.off").write_text(square)
    seen = []
    monkeypatch.setattr(
        "parapoint.commands.unwrapping.write_preview",
        lambda _, __, picture, *, is_y_up: seen.append((picture.shape[2], is_y_up)),
    )
    arguments = ["unwrap", folder / name, "--out", folder / "out.glb", "--texture", 16]
    status, *_ = run([*arguments, "--preview", folder / "seen.png"], capsys)
    assert status == 0
    assert seen == [(3, is_y_up)]


@pytest.mark.parametrize(
    ("asked", "word"),
    [
        (Request(Unwrap(), 0.0), "--seam-price"),
        (Request(Unwrap(), 0.0, seams="net.txt"), "a longer seam helps"),
        (Request(Unwrap(max_distortion=4.1), 0.0), "--max-distortion"),
        (Request(Unwrap(distortion="conformal"), 0.0), "--distortion balanced"),
    ],
)
def test_no_advice_names_an_option_that_is_excluded(asked, word) -> None:
    advice = _advice(asked)["starved"]
    assert word in advice
    assert ("--seam-price" in advice) == (word == "--seam-price")


@pytest.mark.parametrize("more", [0.0, 1e-4])
def test_a_map_at_a_bound_is_within_it(more, caplog) -> None:
    facts = {"file": "a.obj", "flipped": 0, "overlap": "none"}
    facts |= {"starved": MOST_STARVED + more, "energy": 4.1 + more}
    warn(facts, ADVICE_OF_MESHES)
    _warn_of_bound(facts, Request(Unwrap(max_distortion=4.1), border=0.0))
    words = ["less than a quarter of its fair area", "above --max-distortion 4.1"] if more else []
    assert len(caplog.messages) == len(words)
    assert all(word in text for word, text in zip(words, caplog.messages, strict=True))


def test_a_lower_bound_makes_a_longer_seam(monkeypatch) -> None:
    from benchmarks.cases import builtin

    monkeypatch.setattr(unwrap, "ENOUGH_POINTS", 400)
    cap = builtin.sphere_cap(150, rings=8)
    seam = []
    for bound in (None, 4.2):
        made = Unwrap(price=1e9, max_distortion=bound).unwrapped(cap)
        report = made.report["parts"][0]
        assert bound is None or report["end_energy"] <= bound
        ends = cap.vertices[made.seams(cap)]
        seam.append(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).sum())
    assert seam[1] > seam[0]


def test_no_price_lengthens_a_seam_that_meets_its_bound() -> None:
    from benchmarks.cases import builtin

    cap = builtin.sphere_cap(150, rings=8)
    whole = Unwrap(price=1e9).unwrapped(cap).report["parts"][0]
    assert Unwrap().unwrapped(cap).report["parts"][0]["branches_added"] > 0
    bounded = Unwrap(max_distortion=1.01 * whole["end_energy"]).unwrapped(cap)
    assert bounded.report["parts"][0]["branches_added"] == whole["branches_added"]


@pytest.fixture(scope="module")
def bump():
    """A sphere but for a cap: along no cut, angles and areas are not to be had together."""
    from benchmarks.cases import builtin

    return builtin.sphere_cap(150, rings=8)


@pytest.mark.parametrize("distortion", ["conformal", "balanced"])
def test_a_map_that_is_to_keep_angles_keeps_them_better(bump, distortion) -> None:
    from benchmarks.metrics.evaluation import evaluate

    made = {
        name: evaluate(bump, Unwrap(price=1e9, distortion=name).unwrapped(bump))
        for name in ("isometric", distortion)
    }
    off = {name: found["angle_difference_mean"] for name, found in made.items()}
    assert off[distortion] < 0.8 * off["isometric"]
    if distortion == "balanced":  # along the same seam; the conformal map has one of its own
        assert made["isometric"]["symmetric_dirichlet"] < made[distortion]["symmetric_dirichlet"]
    for found in made.values():
        assert found["flipped_fraction"] == found["overlap_area"] == 0
    if distortion == "balanced":
        assert made["balanced"]["starved_area_fraction"] <= LEAST_PART


@pytest.mark.parametrize("distortion", ["isometric", "balanced"])
@pytest.mark.parametrize("height", [0.15, 0.2])
def test_no_part_collapses_however_dear_the_seam_is(distortion, height) -> None:
    """A map may not starve what sticks out of a sheet, were it but 1 % of its area."""
    from benchmarks.cases import builtin
    from benchmarks.metrics.evaluation import evaluate
    from benchmarks.metrics.grades import grade

    finger = builtin.finger()
    finger = Mesh(finger.vertices * [1, 1, height], finger.faces)
    made = Unwrap(price=1e9, distortion=distortion).unwrapped(finger)
    assert grade(evaluate(finger, made), of_cloud=False) == "usable"


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (
            ["--distortion", "conformal", "--max-distortion", 4.5],
            "--max-distortion bounds an energy",
        ),
        (["--distortion", "conformal", "--seam-price", 1], "--seam-price does not go"),
        (["--max-distortion", 4.5, "--seam-price", 1], "--max-distortion, which alone says"),
        (["--distortion", "wavy"], "isometric"),
    ],
)
def test_options_that_do_not_go_together_are_refused(box, tmp_path, capsys, options, words) -> None:
    status, _, said = run(["unwrap", box, "--out", tmp_path / "new.glb", *options], capsys)
    assert status == 2
    assert words in said
    assert len(said.strip().splitlines()) == 1
    assert not (tmp_path / "new.glb").exists()


def test_a_distortion_does_not_go_with_seams_that_are_given(box, tmp_path, capsys) -> None:
    status, _, said = unfold(box, tmp_path / "new.glb", capsys, "--distortion", "balanced")
    assert status == 2
    assert "--distortion does not go with --seams" in said


@pytest.mark.parametrize(
    ("method", "faces", "seconds"),
    [
        (Unwrap(), [100_000], 70.07),
        (Unwrap(), 500 * [4], 35.2),
        (Unwrap(time_budget=20.0), [100_000], 20.0),
        (Unwrap(time_budget=90.0), [100_000], 70.07),
        (Unwrap(max_distortion=4.1), [100_000], None),
        (Unwrap(max_distortion=4.1, time_budget=90.0), [100_000], 90.0),
    ],
)
def test_what_unwrapping_should_take_is_told(method, faces, seconds) -> None:
    """By the faces of each component, and for each component."""
    told = expected(method, np.array(faces))
    assert told == (seconds and pytest.approx(seconds, rel=1e-3))
