"""The registry against the files, names, the mirror, the network that is not there."""

import contextlib
import hashlib
import http.server
import os
import re
import threading
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import igl
import numpy as np
import pytest
import requests
from numpy.testing import assert_allclose

from benchmarks.cases import derived, models
from benchmarks.cases.builtin import BUILTIN
from benchmarks.cases.models import MissingModelError
from benchmarks.metrics.table import METRICS
from parapoint import InputError, Mesh, PointCloud
from parapoint.files.reading import read_parameterized

MODELS = list(models.registry().values())


@pytest.fixture
def no_network(monkeypatch, tmp_path):
    """No mirror, an empty cache, and a network that refuses; the list of addresses asked for."""
    asked = []

    def refuse(url, **_):
        asked.append(url)
        raise requests.exceptions.ConnectionError

    monkeypatch.delenv(models.MIRROR, raising=False)
    monkeypatch.setattr(models, "cache_folder", lambda: tmp_path / "cache")
    monkeypatch.setattr(models, "_unreachable", {})
    monkeypatch.setattr(requests, "get", refuse)
    return asked


@pytest.fixture
def mirror(monkeypatch, tmp_path):
    """An empty mirror."""
    folder = tmp_path / "mirror"
    folder.mkdir()
    monkeypatch.setenv(models.MIRROR, str(folder))
    return folder


def test_registry_is_complete_and_consistent():
    assert len(MODELS) == 67
    assert len({model.file for model in MODELS}) == 67
    assert not set(models.registry()) & set(BUILTIN)
    for model in MODELS:
        assert Path(model.file).parent.name == model.set
        assert Path(model.file).stem == model.name
        assert re.fullmatch(r"[0-9a-f]{64}", model.sha256)
        assert re.search(r"/([0-9a-f]{40}|v5\.5\.1)/", model.url), "an address at a commit or tag"
        assert model.licence
        assert (model.faces == 0) == (model.topology == "point cloud")
        assert bool(model.paper_name) == bool(model.claim) == bool(model.claim_reason)
        assert model.claim in {None, "same model", "likely", "stand-in"}


def test_claims_of_the_paper_suite():
    claims = {model.name: (model.paper_name, model.claim) for model in MODELS if model.claim}
    assert claims["beetle_igl"] == ("beetle", "likely")
    assert claims["hand_1_i_f5000"] == ("hand", "likely")
    assert claims["max_planck_i_f8000"] == ("maxplanck", "likely")
    assert claims["nefertiti-lowres_odedstein"] == ("nefertiti", "likely")
    assert claims["keenan-ogre"] == ("keegan", "stand-in")
    assert claims["mannequin-devil"] == ("fear-face", "stand-in")
    assert claims["camelhead"] == ("camel-head", "same model")


def test_published_figures_are_those_of_the_papers():
    def figures(name):
        return {row.method: row.value for row in models.registry()[name].published}

    assert figures("beetle_igl") == {"SLIM": 0.410, "ParaPoint": 0.066, "FAM": 0.037}
    assert figures("mannequin-devil") == {"SLIM": 0.635, "ParaPoint": 0.120, "FAM": 0.074}
    assert figures("keenan-ogre") == {"SLIM": 0.063, "ParaPoint": 0.059}
    assert figures("hand_1_i_f5000") == {"SLIM": 0.609, "ParaPoint": 0.182, "FAM": 0.145}
    assert figures("max_planck_i_f8000") == {"SLIM": 0.307, "ParaPoint": 0.117}
    assert figures("nefertiti-lowres_odedstein") == {
        "SLIM": 0.089,
        "ParaPoint": 0.124,
        "FAM": 0.117,
    }
    assert figures("camelhead") == {"SLIM": 0.349, "FAM": 0.088}
    assert figures("tooth") == {}
    names = {model.paper_name for model in MODELS}
    for row in models.published_figures():
        assert row.paper_name in names
        assert row.metric in METRICS
        assert row.unit == METRICS[row.metric].unit
        assert row.tolerance == max(0.1 * row.value, 0.005)
        assert row.source.startswith("Zhang, Hou, ")
        assert row.trust.startswith(("as printed", "second hand"))


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.name)
def test_every_model_loads_as_registered(model):
    if not os.environ.get(models.MIRROR):
        pytest.skip(f"set {models.MIRROR} to check the real models")
    try:
        surface = models.load(model.name)
    except MissingModelError as error:
        pytest.skip(str(error))
    if isinstance(surface, PointCloud):
        assert (len(surface.points), 0, "point cloud") == (
            model.vertices,
            model.faces,
            model.topology,
        )
        return
    assert len(surface.vertices) == model.vertices
    assert len(surface.faces) == model.faces
    assert surface.topology == model.topology
    assert (~surface.referenced).sum() == model.facts["unreferenced_vertices"]
    if surface.is_manifold and surface.is_oriented:
        assert surface.euler_characteristic == model.facts["euler"]
        assert len(surface.boundary_loops) == model.facts["boundary_loops"]
    if model.has_uv:
        mesh, parameterization = read_parameterized(models.path(model.name))
        np.testing.assert_array_equal(mesh.faces, surface.faces)
        # The registry joins charts that touch in one UV point; only the bottle has such.
        expected = {"fuze_trimesh": 8}.get(model.name, model.facts["uv_charts"])
        assert parameterization.charts().max() + 1 == expected


def test_names():
    assert models.canonical_name("hand_1") == "hand_1_i_f5000"
    assert models.canonical_name("max_planck") == "max_planck_i_f8000"
    assert models.canonical_name("nefertiti-lowres") == "nefertiti-lowres_odedstein"
    assert models.canonical_name("torus") == "torus"  # built in, though torus_odedstein begins so
    assert models.canonical_name("half_cyl") == "half_cylinder"
    assert models.info("torus") is None
    info = models.info("hand_1")
    assert info is not None
    assert info.name == "hand_1_i_f5000"
    assert set(BUILTIN) < set(models.names())


@pytest.mark.parametrize(
    ("case", "says"),
    [
        ("hand", "may be any of hand_1_i_f5000, hand_lowres_odedstein"),
        ("camelhed", "camelhead"),
        ("", "no model ''"),
        ("zzzzzz", "`list cases`"),
        ("no/such.obj", "no such file"),
        ("such.obj", "no such file"),
    ],
)
def test_unknown_names(case, says):
    with pytest.raises(InputError, match=re.escape(says)):
        models.load(case)


def test_a_users_file_is_a_case(tmp_path, monkeypatch):
    file = tmp_path / "mine.obj"
    file.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert models.canonical_name(str(file)) == str(file)
    assert len(models.load(str(file)).faces) == 1
    assert models.info(str(file)) is None
    monkeypatch.chdir(tmp_path)
    file.rename("hand_1")  # a file goes before a beginning ...
    assert models.canonical_name("hand_1") == "hand_1"
    Path("camelhead").touch()  # ... and a full name before a file
    assert models.info("camelhead") is not None


@pytest.mark.parametrize("ending", [".obj", ".off"])
@pytest.mark.parametrize("is_soup", [False, True], ids=["split along a seam", "soup"])
def test_doubled_vertices_of_a_users_file_are_one(tmp_path, caplog, ending, is_soup):
    ball = models.load("sphere")
    vertices, faces = ball.vertices[ball.faces].reshape(-1, 3), np.arange(ball.faces.size)
    if not is_soup:  # the corners of the first 100 faces have vertices of their own
        first = ball.faces[100:].reshape(-1)
        vertices = np.vstack([ball.vertices, vertices[:300]])
        faces = np.concatenate([len(ball.vertices) + np.arange(300), first])
    path = tmp_path / f"split{ending}"
    rows = [f"{'v ' * (ending == '.obj')}{x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()]
    corners = faces.reshape(-1, 3) + (ending == ".obj")
    rows += [f"{'f' if ending == '.obj' else 3} {i} {j} {k}" for i, j, k in corners]
    head = [] if ending == ".obj" else ["OFF", f"{len(vertices)} {len(corners)} 0"]
    path.write_text("\n".join([*head, *rows]) + "\n")
    found = models.load(str(path))
    np.testing.assert_array_equal(found.vertices[found.faces], ball.vertices[ball.faces])
    assert found.topology == ball.topology == "sphere"
    count = len(np.unique(faces)) - len(ball.vertices)
    assert caplog.messages == [f"{path}: doubled vertices taken as one: {count}"]


def test_builtin_surfaces_load():
    assert isinstance(models.load("saddle"), Mesh)
    with pytest.raises(InputError, match="has no file"):
        models.path("saddle")


@pytest.mark.usefixtures("no_network")
def test_a_missing_model_says_how_to_get_it(tmp_path):
    with pytest.raises(MissingModelError) as caught:
        models.load("beetle_igl")
    message = str(caught.value)
    assert "\n" not in message
    assert models.registry()["beetle_igl"].url in message
    assert "PARAPOINT_DATA to a folder that holds paper/beetle_igl.off" in message
    assert str(tmp_path / "cache/paper/beetle_igl.off") in message
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]


def test_a_silent_host_is_asked_once(no_network):
    reasons = models.missing(["beetle_igl", "sphere", "hand_1", "camelhead"])
    assert list(reasons) == ["beetle_igl", "hand_1", "camelhead"]
    assert len(no_network) == 1


def test_an_absent_page_is_no_silent_host(no_network, monkeypatch):
    def absent(url, **_):
        no_network.append(url)
        response = requests.Response()
        response.status_code, response.url = 404, url
        return response

    monkeypatch.setattr(requests, "get", absent)
    assert set(models.missing(["beetle_igl", "hand_1"])) == {"beetle_igl", "hand_1"}
    assert len(no_network) == 2


def serve(monkeypatch, content):
    def answer(url, **_):
        response = requests.Response()
        response.status_code, response.url = 200, url
        response._content = content
        response.iter_content = lambda **_: iter([content])
        return response

    monkeypatch.setattr(requests, "get", answer)


def register(monkeypatch, content):
    """Let cylinder_cgal be `content` for once."""
    model = replace(models.registry()["cylinder_cgal"], sha256=hashlib.sha256(content).hexdigest())
    monkeypatch.setitem(models.registry(), "cylinder_cgal", model)


OFF = b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"


@pytest.mark.usefixtures("no_network")
def test_a_download_is_checked_and_kept(monkeypatch, tmp_path, capfd):
    serve(monkeypatch, OFF)
    with pytest.raises(InputError, match="not the registered one"):
        models.load("cylinder_cgal")
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]
    register(monkeypatch, OFF)
    assert len(models.load("cylinder_cgal").faces) == 1
    assert models.path("cylinder_cgal") == tmp_path / "cache/paper/cylinder_cgal.off"
    serve(monkeypatch, b"never asked for")
    assert models.missing(["cylinder_cgal"]) == {}
    captured = capfd.readouterr()
    assert captured.out == ""
    assert re.fullmatch(r"(downloading cylinder_cgal, 0\.\d MB\n){2}", captured.err)  # no bar


class Endless(http.server.BaseHTTPRequestHandler):
    """Sends bytes for as long as anybody takes them."""

    sent = 0

    def do_GET(self):
        self.send_response(200)
        self.end_headers()
        with contextlib.suppress(OSError):
            while True:
                Endless.sent += self.wfile.write(bytes(1 << 16))

    def log_message(self, *_):
        """Say nothing."""


def test_a_download_takes_no_more_than_the_registered_size(monkeypatch, tmp_path):
    monkeypatch.delenv(models.MIRROR, raising=False)
    monkeypatch.setattr(models, "cache_folder", lambda: tmp_path)
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Endless) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        address = f"http://127.0.0.1:{server.server_port}/endless"
        model = replace(models.registry()["cylinder_cgal"], url=address, size=300_000)
        monkeypatch.setitem(models.registry(), "cylinder_cgal", model)
        with pytest.raises(InputError, match="has more than 300000 bytes"):
            models.load("cylinder_cgal")
        server.shutdown()
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]
    assert Endless.sent < 20_000_000  # what lay in buffers


@pytest.mark.parametrize(("more", "fits"), [(0, True), (1, False)])
def test_a_download_may_have_all_of_its_bytes_and_not_one_more(more: int, fits: bool) -> None:
    model = replace(models.registry()["cylinder_cgal"], size=1000)
    response = SimpleNamespace(
        iter_content=lambda size: iter([bytes(size), bytes(1000 - size + more)]), close=bool
    )
    models._bound(model, response)
    with contextlib.nullcontext() if fits else pytest.raises(InputError, match="more than 1000"):
        assert sum(map(len, response.iter_content(600))) == 1000


def test_the_mirror_is_used_and_checked(no_network, mirror, monkeypatch):
    file = mirror / "paper" / "cylinder_cgal.off"
    file.parent.mkdir()
    file.write_bytes(OFF)
    with pytest.raises(InputError, match="its sha256 is") as caught:
        models.load("cylinder_cgal")
    assert not isinstance(caught.value, MissingModelError)
    register(monkeypatch, OFF)
    assert len(models.load("cylinder_cgal").faces) == 1
    assert no_network == []
    assert list(models.missing(["cylinder_cgal", "camelhead"])) == ["camelhead"]


def test_a_mirror_that_is_no_folder_is_said(no_network, monkeypatch, tmp_path):
    monkeypatch.setenv(models.MIRROR, str(tmp_path / "nowhere"))
    with pytest.raises(InputError, match="which is no folder"):
        models.load("camelhead")
    assert no_network == []


def test_sampled_clouds_are_cases():
    assert models.canonical_name("swiss@noise=0.01") == "swiss_roll@noise=0.01"
    cloud = models.load("swiss_roll@noise=0.01")
    exact = models.exact_points("swiss_roll@noise=0.01")
    assert isinstance(cloud, PointCloud)
    assert (cloud.points != exact.points).any()
    roll = models.load("swiss_roll")
    squared = igl.point_mesh_squared_distance(exact.points, roll.vertices, roll.faces)[0]
    assert_allclose(squared, 0, atol=1e-20)
    assert models.exact_points("swiss_roll@noise=0") is None
    assert models.exact_points("swiss_roll@uneven") is None
    assert models.exact_points("swiss_roll") is None
    assert models.info("swiss_roll@uneven") is None
    assert models.missing(["swiss_roll@uneven", "swiss_roll"]) == {}


def test_a_model_is_cut_along_the_seam_drawn_on_it(tmp_path, monkeypatch):
    """A seam along an edge path of a ball, from a file with a remark and repeated, turned edges."""
    ball = models.load("sphere")
    a, b, c = ball.faces[0]
    file = tmp_path / "sphere.txt"
    file.write_text(f"# drawn by a child\n{a} {b}\n{c} {b}\n{b} {a}\n")
    monkeypatch.setattr(derived, "seam_file", lambda model: tmp_path / f"{model}.txt")
    mesh = models.load("sphere@drawn")
    assert mesh.topology == "disk"
    assert len(mesh.vertices) == len(ball.vertices) + 1  # the middle vertex has two copies
    assert (mesh.vertices[mesh.faces] == ball.vertices[ball.faces]).all()
    assert models.exact_points("sphere@drawn") is None
    assert len(models.load("sphere@uneven").points) == 8_000
    with pytest.raises(
        InputError, match="nobody has drawn a seam on torus; there is one on sphere"
    ):
        models.load("torus@drawn")


def test_a_seam_may_be_a_single_edge(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """From the rim of a sheet inwards it opens a slit, whose end on the rim has two copies."""
    sheet = models.load("wavy_sheet")
    assert isinstance(sheet, Mesh)
    rim = set(sheet.boundary_loops[0].tolist())
    edges = np.concatenate([sheet.faces[:, :2], sheet.faces[:, 1:]]).tolist()
    a, b = next((a, b) for a, b in edges if a in rim and b not in rim)
    (tmp_path / "wavy_sheet.txt").write_text(f"{a} {b}\n")
    monkeypatch.setattr(derived, "seam_file", lambda model: tmp_path / f"{model}.txt")
    cut = models.load("wavy_sheet@drawn")
    assert isinstance(cut, Mesh)
    assert len(cut.vertices) == len(sheet.vertices) + 1


def test_each_drawn_seam_opens_its_model_to_a_disk():
    if not os.environ.get(models.MIRROR):
        pytest.skip(f"set {models.MIRROR} to check the real models")
    files = sorted(derived.seam_file("").parent.glob("*.txt"))
    assert files
    for file in files:
        model = models.load(file.stem)
        assert model.topology != "disk"
        assert derived.derived(file.stem, model, "drawn")[0].topology == "disk"


@pytest.mark.usefixtures("no_network")
def test_a_sampled_cloud_of_a_model_that_is_not_at_hand_is_missing():
    assert "camelhead" in models.missing(["camelhead@uneven"])["camelhead@uneven"]


@pytest.mark.parametrize(
    ("case", "fault"),
    [
        ("swiss_roll@noise=x", "not by @noise=x"),
        ("swiss_roll@noise=0.2", "0.1 at most"),
        ("swiss_roll@dense", "MODEL@smooth or @fine, not by @dense"),
        ("nothing_of_it@uneven", "there is no model 'nothing_of_it'"),
    ],
)
def test_a_bad_sampling_says_what_would_do(case, fault):
    with pytest.raises(InputError, match=fault):
        models.load(case)


def test_a_cloud_is_not_sampled(tmp_path):
    file = tmp_path / "scan.xyz"
    file.write_text("0 0 0\n1 0 0\n0 1 0\n")
    with pytest.raises(InputError, match="has no faces to sample"):
        models.load(f"{file}@uneven")
