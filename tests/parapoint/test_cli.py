import json
import os

import numpy as np
import pytest

from parapoint import ComputedMap, InputError, Mesh, ParaPoint, PointCloud, cli
from parapoint.commands.fitting import fitted
from parapoint.computed.reconstruction import ReconstructionError
from parapoint.files import reading as files
from parapoint.surfaces.across_seams import MOST_PIECES, edges_across_seam, opened
from parapoint.testing import irregular_disk
from parapoint.textures.checkerboard import checkerboard

SHORT = ["--time-budget", "1"]
TINY = ["--preset", "paper", "--points", "150", "--subset", "100", "--iterations", "4"]


def run(arguments: list[str], capsys) -> tuple[int, str, str]:
    """Exit status, standard output and standard error of a command."""
    with pytest.raises(SystemExit) as end:
        cli.console.run(cli.parapoint, arguments)
    shown = capsys.readouterr()
    return int(end.value.code or 0), shown.out, shown.err


@pytest.fixture
def cloud(tmp_path):
    points = np.random.default_rng(0).normal(size=(300, 3))
    path = tmp_path / "cloud.xyz"
    np.savetxt(path, points / np.linalg.norm(points, axis=1, keepdims=True))
    return path


@pytest.fixture(scope="module")
def ball(tmp_path_factory):
    """A saved model, its points beside it."""
    folder = tmp_path_factory.mktemp("ball") / "model"
    points = np.random.default_rng(0).normal(size=(300, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    np.savetxt(folder.with_suffix(".xyz"), points)
    ComputedMap().fit(points).save(folder)
    return folder


@pytest.fixture
def disk(tmp_path):
    mesh = irregular_disk()
    lines = [f"v {x} {y} {z}" for x, y, z in mesh.vertices]
    lines += [f"f {a} {b} {c}" for a, b, c in mesh.faces + 1]
    path = tmp_path / "disk.obj"
    path.write_text("\n".join(lines))
    return path


def test_fit_then_map_a_cloud(cloud, tmp_path, capsys) -> None:
    model = tmp_path / "model"
    status, out, err = run(["fit", str(cloud), "--out", str(model), *TINY, "--json"], capsys)
    assert (status, err) == (0, "")
    assert json.loads(out)["iterations"] == 4
    target = tmp_path / "map.npz"
    status, out, err = run(["map", str(model), str(cloud), "--out", str(target)], capsys)
    assert (status, err) == (0, "")
    with np.load(target) as written:
        uv = written["uv"]
    fitted = ParaPoint.load(model)
    raw = fitted.transform(files.read_surface(cloud))
    # The map, turned and scaled.
    before, after = (np.linalg.norm(np.diff(of, axis=0), axis=1) for of in (raw, uv))
    assert np.ptp(after / before) < 1e-6 * (after / before).mean()
    assert -0.5 < uv.min() <= uv.max() < 1.5


def test_strays_of_other_points_are_named_and_mapped_nowhere(
    cloud, tmp_path, capsys, caplog
) -> None:
    """Two of three points, of which one alone would be the whole cloud."""
    model, others, target = tmp_path / "model", tmp_path / "others.xyz", tmp_path / "map.ply"
    assert run(["fit", str(cloud), "--out", str(model)], capsys)[0] == 0
    others.write_text("900 0 0\n0 0 1\n0 -1e9 0\n")
    status, out, _ = run(["map", str(model), str(others), "--out", str(target)], capsys)
    assert status == 0
    assert "others.xyz: about 66.7 % of its points lie off the surface" in caplog.text
    assert "1 points mapped" in out
    assert "2 points (66.7 %) lie far from the surface and have no UV: rows [0, 2] come" in out
    _, uv = files.read_point_map(target)
    assert np.isnan(uv.uv).all(axis=1).tolist() == [True, False, True]


@pytest.mark.parametrize(
    ("shift", "scale"),
    [((5e5, 5e6, 100), 1), ((0, 0, 9), 1), ((0, 0, 0), 0.5), ((0, 0, 0), 1e6), ((0, 0, 0), 1e200)],
)
@pytest.mark.parametrize("ending", [".xyz", ".obj"])
def test_what_is_not_on_the_surface_is_not_mapped(shift, scale, ending, ball, capsys) -> None:
    """A cloud or a mesh in another place or unit: refused before anything is written."""
    points = np.loadtxt(ball.with_suffix(".xyz")) * scale + shift
    other, target = ball.with_name(f"other{ending}"), ball.with_name("map.ply")
    if ending == ".xyz":
        np.savetxt(other, points)
    else:
        points /= max(scale / 1e9, 1)  # no mesh is as large as some clouds are
        lines = [f"v {x} {y} {z}" for x, y, z in points]
        other.write_text("\n".join([*lines, "f 1 2 3"]))
    status, out, err = run(["map", str(ball), str(other), "--out", str(target)], capsys)
    assert (status, out) == (2, "")
    assert err.count("\n") == 1
    assert f"other{ending}: does not lie on the surface of the model: all of its points" in err
    assert not target.exists()


@pytest.mark.parametrize("scale", [1, 1 + 1e-3])
def test_what_is_on_the_surface_is_mapped_without_a_word(scale, ball, tmp_path, capsys) -> None:
    np.savetxt(tmp_path / "other.xyz", np.loadtxt(ball.with_suffix(".xyz"))[::7] * scale)
    arguments = ["map", str(ball), str(tmp_path / "other.xyz"), "--out", str(tmp_path / "a.ply")]
    status, out, err = run(arguments, capsys)
    assert (status, err) == (0, "")
    assert "no UV" not in out


def test_unwrap_a_mesh_with_a_checkerboard(disk, tmp_path, capsys) -> None:
    target = tmp_path / "out.obj"
    status, out, err = run(
        ["unwrap", str(disk), "--out", str(target), "--time-budget", "1"], capsys
    )
    assert (status, err) == (0, "")
    assert "0 flipped faces, overlap: none" in out
    mesh, parameterization = files.read_parameterized(target)
    assert np.array_equal(mesh.faces, irregular_disk().faces)
    assert len(parameterization.corners) == len(mesh.faces)
    assert target.with_suffix(".png").is_file()
    assert "map_Kd out.png" in target.with_suffix(".mtl").read_text()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["fit", "missing.ply", "--out", "m"], "missing.ply"),
        (
            ["fit", "CLOUD", "--out", "m", "--preset", "best"],
            "--preset must be one of computed, learned, paper, not 'best'",
        ),
        (["fit", "CLOUD", "--out", "m", "--points", "12"], "--points must be"),
        (
            ["fit", "CLOUD", "--out", "m", "--distortion-weight", "-1", "--preset", "paper"],
            "--distortion-weight must be",
        ),
        (["fit", "CLOUD", "--out", "CLOUD"], "is a file; name a folder"),
        (
            ["fit", "CLOUD", "--out", "m", "--iterations", "9"],
            "--iterations is not used by --preset",
        ),
        (["fit", "CLOUD", "--out", "m", "--branches", "3d"], "--branches is not used by --preset"),
        (["fit", "CLOUD"], "Missing option '--out'"),
        (["unwrap", "CLOUD", "--out", "map.txt"], "cannot write this ending"),
        (["unwrap", "CLOUD", "--out", "no/where.obj"], "there is no such folder"),
        (["map", "m", "CLOUD", "--out", "map.obj"], "no saved model here"),
    ],
)
def test_wrong_use_is_one_line_and_nothing_written(
    arguments, message, cloud, monkeypatch, capsys
) -> None:
    tmp_path = cloud.parent
    monkeypatch.chdir(tmp_path)
    before = sorted(tmp_path.rglob("*"))
    status, out, err = run([str(cloud) if a == "CLOUD" else a for a in arguments], capsys)
    assert (status, out) == (2, "")
    assert message in err
    assert err.count("\n") == 1
    assert sorted(tmp_path.rglob("*")) == before


def test_too_few_points_are_one_line(tmp_path, capsys) -> None:
    path = tmp_path / "few.xyz"
    np.savetxt(path, np.random.default_rng(0).normal(size=(99, 3)))
    status, _, err = run(["fit", str(path), "--out", str(tmp_path / "m"), *TINY], capsys)
    assert status == 2
    assert "99 distinct points; a fit needs at least 100" in err
    assert not (tmp_path / "m").exists()


def strip() -> tuple[Mesh, np.ndarray]:
    """A flat strip of 2 x 20 squares and its map, the columns right of the tenth moved far away."""
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(21.0), np.arange(3.0), indexing="ij"))
    corner = np.arange(63).reshape(21, 3)
    a, b, c, d = corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]
    faces = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)
    uv = np.stack([x, y], axis=1)
    uv[x > 10] += [30.0, 50.0]
    return Mesh(np.stack([x, y, 0 * x], axis=1), faces), uv


def test_edges_across_the_seam_are_those_across_the_tear() -> None:
    mesh, uv = strip()
    across = np.isclose(mesh.vertices[mesh.edges][:, :, 0].sum(axis=1), 21)
    assert np.array_equal(edges_across_seam(mesh, uv), across)
    assert across.sum() == 5  # three straight ones and two diagonals


def test_a_long_edge_is_seen_to_cross_the_seam_twice() -> None:
    x, y = (axis.ravel() for axis in np.meshgrid([0.0, 9.0, 18.0], [0.0, 1.0], indexing="ij"))
    faces = np.array([[0, 2, 3], [0, 3, 1], [2, 4, 5], [2, 5, 3]])
    mesh = Mesh(np.stack([x, y, 0 * x], axis=1), faces)

    def transform(points: np.ndarray) -> np.ndarray:
        away = np.abs(points[:, 0] - 5) < 1
        return points[:, :2] + np.where(away[:, None], [0.0, 30.0], 0.0)

    uv = transform(mesh.vertices)
    assert np.array_equal(uv, mesh.vertices[:, :2])
    assert not edges_across_seam(mesh, uv).any()
    across = np.isclose(np.sort(mesh.vertices[mesh.edges][:, :, 0], axis=1), [0, 9]).all(axis=1)
    assert np.array_equal(edges_across_seam(mesh, uv, transform, 0.5), across)
    assert across.sum() == 3


def test_a_mesh_far_larger_than_the_spacing_is_divided_no_further_than_can_be_mapped() -> None:
    mesh, uv = strip()
    seen: list[int] = []

    def transform(points: np.ndarray) -> np.ndarray:
        seen.append(len(points))
        return points[:, :2]

    edges_across_seam(mesh, uv, transform, 1e-12)
    assert sum(seen) <= MOST_PIECES + 2 * len(mesh.edges)


def test_a_face_across_the_seam_keeps_its_shape_on_one_side() -> None:
    mesh, uv = strip()
    result = opened(mesh, uv, edges_across_seam(mesh, uv))
    images, real = result.uv[result.corners], mesh.vertices[mesh.faces][:, :, :2]
    # The map is an isometry on each side, so every face now has its own shape.
    sides = np.roll(images, -1, axis=1) - images
    np.testing.assert_allclose(
        np.linalg.norm(sides, axis=2), np.linalg.norm(np.roll(real, -1, axis=1) - real, axis=2)
    )
    assert len(result.uv) == len(uv) + 4
    assert np.array_equal(result.uv[:63], uv)
    moved = (result.corners != mesh.faces).any(axis=1)
    assert moved.sum() == 4
    assert len(result.seams(mesh)) == 3  # two of the five edges across are on the boundary


def test_a_face_of_three_edges_across_the_seam_becomes_a_chart() -> None:
    mesh, _ = strip()
    x, y = mesh.vertices[:, 0], mesh.vertices[:, 1]
    uv = mesh.vertices[:, :2].copy()
    uv[(x > 10) & (y < 2)] += [300, 0]
    uv[(x > 10) & (y == 2)] += [0, 500]
    spans = edges_across_seam(mesh, uv)[mesh.edge_of_halfedge].reshape(-1, 3)
    assert spans.all(axis=1).sum() == 1  # where the three parts meet
    result = opened(mesh, uv, edges_across_seam(mesh, uv))
    corners = result.corners[spans.all(axis=1)][0]
    assert not set(corners) & set(range(63))
    a, b, c = result.uv[corners]
    sides = sorted(float(np.linalg.norm(edge)) for edge in (a - b, b - c, c - a))
    np.testing.assert_allclose(sides, [1, 1, np.sqrt(2)])


def test_a_map_without_a_seam_stays_as_it_is() -> None:
    mesh, _ = strip()
    uv = mesh.vertices[:, :2]
    result = opened(mesh, uv, edges_across_seam(mesh, uv))
    assert np.array_equal(result.corners, mesh.faces)


def test_where_no_map_can_be_computed_one_is_trained_and_a_line_says_so(
    tmp_path, capsys, caplog
) -> None:
    rng = np.random.default_rng(0)
    parts = [np.column_stack([rng.uniform(0, 1, (150, 2)), np.zeros(150)]) for _ in range(3)]
    path = tmp_path / "three.xyz"
    np.savetxt(
        path, np.concatenate([part + np.array([100 * k, 0, 0]) for k, part in enumerate(parts)])
    )
    target = tmp_path / "out.npz"
    arguments = ["unwrap", str(path), "--out", str(target), "--time-budget", "2", "--json"]
    status, out, _ = run(arguments, capsys)
    assert status == 0
    assert json.loads(out)["preset"] == "learned"
    assert "no map could be computed, so one is trained" in caplog.text


def test_the_training_that_stands_in_takes_what_was_asked_of_the_map(monkeypatch) -> None:
    fitted_ones = []

    def fit(self, *_, **__):
        fitted_ones.append(self.get_params())
        if isinstance(self, ComputedMap):
            raise ReconstructionError("no surface")
        return self

    monkeypatch.setattr("parapoint.estimator.Estimator.fit", fit)
    cloud = PointCloud(np.eye(3))
    for model in (ComputedMap(), ComputedMap(700, "isometric", 9.0, "each", 5)):
        fitted("a", cloud, model, lambda _: None)
    names = ("preset", "points", "distortion", "time_budget", "components", "seed")
    assert [[one[name] for name in names] for one in fitted_ones[1::2]] == [
        ["learned", None, None, 300.0, "together", 0],
        ["learned", 700, "isometric", 9.0, "each", 5],
    ]


def test_the_checkerboard_alternates() -> None:
    for size in (256, 100):
        board = checkerboard(size)
        assert board.shape == (size, size, 3)
        for row, column in np.ndindex(32, 32):
            at = board[(2 * row + 1) * size // 64, (2 * column + 1) * size // 64]
            assert (at == board[0, 0]).all() == ((row + column) % 2 == 0)


def test_a_diverged_fit_is_one_line(cloud, tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.setattr(
        "parapoint.learned.trainer.Trainer._step", lambda _: {"total": float("nan")}
    )
    status, _, err = run(["fit", str(cloud), "--out", str(tmp_path / "m"), *TINY], capsys)
    assert status == 2
    assert "diverged twice" in err


def test_bad_input_is_an_input_error() -> None:
    assert issubclass(InputError, ValueError)


@pytest.mark.parametrize("command", ["fit", "unwrap"])
@pytest.mark.parametrize(
    ("option", "value"),
    [("--time-budget", value) for value in ("1e308", "1e10", "nan", "inf", "0", "-1")]
    + [("--seed", value) for value in (str(10**23), str(2**63), "-1")],
)
def test_numbers_out_of_range_are_one_line(command, option, value, cloud, capsys) -> None:
    """Nothing is written."""
    out = cloud.parent / ("model" if command == "fit" else "map.obj")
    status, said, err = run([command, str(cloud), "--out", str(out), option, value], capsys)
    assert (status, said, err.count("\n")) == (2, "", 1)
    assert list(cloud.parent.iterdir()) == [cloud]


@pytest.mark.parametrize(("given", "kept"), [(None, "passive"), ("active", "active")])
def test_threads_sleep_while_they_wait_unless_the_user_says_otherwise(given, kept, monkeypatch):
    monkeypatch.setenv("OMP_WAIT_POLICY", given or "")
    if given is None:
        monkeypatch.delenv("OMP_WAIT_POLICY")
    seen: list[str | None] = []
    monkeypatch.setattr(
        cli.console, "run", lambda _: seen.append(os.environ.get("OMP_WAIT_POLICY"))
    )
    cli.main()
    assert seen == [kept]
