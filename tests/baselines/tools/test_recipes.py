"""Recipes for public programs, on stand-ins that write what the programs' documentation says."""

import stat
import sys

import numpy as np
import pytest
from numpy.testing import assert_allclose

from baselines import registry
from baselines.tools.external import in_order
from baselines.tools.recipes import RECIPES
from parapoint.errors import InputError
from parapoint.method import MissingError
from parapoint.planar.domains import FlatteningError
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import Mesh
from parapoint.testing import irregular_disk

HEAD = f"""#!{sys.executable}
import os, random, sys

def read(path):
    rows = [line.split() for line in open(path)]
    points = [[float(x) for x in row[1:]] for row in rows if row[0] == "v"]
    return points, [[int(k) - 1 for k in row[1:]] for row in rows if row[0] == "f"]

def write(path, points, faces):
    "The vertices in their order, each at its x and y."
    with open(path, "w") as file:
        for x, y, z in points:
            print("v", f"{{x:.6f}} {{y:.6f}} {{z:.6f}}", file=file)
        for x, y, _ in points:
            print("vt", x, y, file=file)
        for face in faces:
            print("f", *(f"{{k + 1}}/{{k + 1}}" for k in face), file=file)

def write_charts(path, points, faces):
    "Faces in another order, corners turned on, a vertex for each corner."
    random.Random(0).shuffle(faces)
    corners = [points[k] for a, b, c in faces for k in (b, c, a)]
    write(path, corners, [[k, k + 1, k + 2] for k in range(0, len(corners), 3)])

words = sys.argv[1:]
"""

STAND_INS = {
    "optcuts": (
        "OptCuts_bin",
        """
assert [words[0], *words[2:]] == ["100", "0.999", "1", "0", "4.1", "1", "0"]
assert words[1].endswith(".obj")
folder = "output/input_Tutte_0.999_1_OptCuts"
os.makedirs(folder)
write(folder + "/finalResult_mesh.obj", *read(words[1]))
points, faces = read(words[1])
unit = [[p[0] / 9, p[1] / 9, p[2]] for p in points]
write(folder + "/finalResult_mesh_normalizedUV.obj", unit, faces)
""",
    ),
    "bff": ("bff-command-line", "write(words[1], *read(words[0]))"),
    "uvatlas_tool": (
        "uvatlastool",
        """
assert words[:4] == ["-nologo", "-y", "-wf", "-o"]
write_charts(words[4], *read(words[5]))
""",
    ),
    "surface_nvp": (
        "scripts/train_injective_nvp.py",
        """
assert os.path.isfile("scripts/train_injective_nvp.py")  # started in its own folder
assert words[::2] == ["--input", "--output", "--iters"]
write(words[3], *read(words[1]))
write(words[3].replace(".obj", ".initial.obj"), *read(words[1]))
""",
    ),
    "partuv": (
        "demo/partuv_demo.py",
        """
assert os.path.isfile("demo/partuv_demo.py")
assert words[::2] == ["--mesh_path", "--output_path", "--pack_method"]
folder = words[3] + "/" + os.path.basename(words[1])[:-4]
os.makedirs(folder)
points, faces = read(words[1])
write_charts(folder + "/final_components.obj", [[0, y, z] for _, y, z in points], list(faces))
write_charts(folder + "/final_packed.obj", points, faces)
""",
    ),
}
"""For each recipe the file that it starts, and what a program in its place does."""


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Puts a program where a recipe looks for it, and nothing else."""
    folder = tmp_path / "bin"
    folder.mkdir()
    monkeypatch.setenv("PATH", str(folder))

    def program(path, text):
        path.parent.mkdir(exist_ok=True, parents=True)
        path.write_text(text)
        path.chmod(path.stat().st_mode | stat.S_IXUSR)

    def put(name, body):
        recipe = RECIPES[name]
        file, _ = STAND_INS[name]
        if recipe.home:
            (folder / "python").symlink_to(sys.executable)
            monkeypatch.setenv(recipe.home, str(tmp_path / "home"))
        program((tmp_path / "home" if recipe.home else folder) / file, HEAD + body)

    return put


def made_by(name, mesh):
    return registry.method(f"external(recipe={name})")[1].parameterize(mesh, seed=0)


def test_each_recipe_has_a_stand_in():
    assert STAND_INS.keys() == RECIPES.keys()


@pytest.mark.parametrize("name", sorted(RECIPES))
def test_the_map_that_a_program_writes_is_read_where_it_writes_it(install, name):
    install(name, STAND_INS[name][1])
    mesh = irregular_disk()
    made = made_by(name, mesh)
    assert_allclose(made.uv[made.corners], mesh.vertices[mesh.faces][:, :, :2])


@pytest.mark.parametrize("name", sorted(RECIPES))
def test_a_program_that_is_missing_is_named_with_where_to_get_it(tmp_path, monkeypatch, name):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(MissingError, match=r"^needs .*https://github\.com/\S+"):
        made_by(name, irregular_disk())
    if RECIPES[name].home:
        (tmp_path / "python").symlink_to(sys.executable)
        for home in ("", str(tmp_path)):
            monkeypatch.setenv(RECIPES[name].home, home)
            with pytest.raises(MissingError, match=rf"set {RECIPES[name].home} to its folder"):
                made_by(name, irregular_disk())


@pytest.mark.parametrize("name", sorted(RECIPES))
def test_a_program_that_fails_or_writes_nothing_says_so(install, name):
    install(name, "sys.exit('out of memory')")
    with pytest.raises(FlatteningError, match="ended with status 1: out of memory"):
        made_by(name, irregular_disk())


def test_a_program_that_writes_elsewhere_has_written_no_map(install):
    install("optcuts", "write('mesh.obj', *read(words[1]))")
    with pytest.raises(FlatteningError, match=r"wrote no UV map: .*finalResult_mesh\.obj.*no such"):
        made_by("optcuts", irregular_disk())


def test_the_commands_name_all_that_they_need():
    for recipe in RECIPES.values():
        assert "{input}" in recipe.command
        assert bool(recipe.result) != ("{output}" in recipe.command)
        assert recipe.source.count("https://") == 1
        assert not recipe.home or f"set {recipe.home} to its folder" in recipe.source


def test_a_recipe_must_be_known_and_stand_alone():
    with pytest.raises(InputError, match=r"no recipe 'opt'; there are: optcuts, bff, uvatlas_tool"):
        registry.method("external(recipe=opt)")
    with pytest.raises(InputError, match="a command or a recipe, not both"):
        registry.method("external(recipe=bff, command='tool {input} {output}')")


def test_faces_are_found_again_whatever_their_order():
    mesh = irregular_disk()
    rng = np.random.default_rng(0)
    order = rng.permutation(len(mesh.faces))
    faces = np.stack([np.roll(mesh.faces[face], rng.integers(3)) for face in order])
    points = mesh.vertices[faces.reshape(-1)] + rng.uniform(-5e-5, 5e-5, (3 * len(faces), 3))
    other = Mesh(points, np.arange(3 * len(faces)).reshape(-1, 3))
    made = in_order(other, Parameterization(points[:, :2], other.faces), mesh)
    assert_allclose(made.uv[made.corners], mesh.vertices[mesh.faces][:, :, :2], atol=1e-4)


def test_what_comes_back_in_order_is_kept_corner_by_corner():
    """Two corners of a face without area lie on one place; no search could tell them apart."""
    mesh = Mesh([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0]], [[0, 1, 2], [1, 2, 3]])
    uv = np.array([[0.0, 0], [1, 0], [0, 1], [2, 0]])
    made = in_order(mesh, Parameterization(uv, mesh.faces), mesh)
    assert_allclose(made.uv[made.corners], uv[mesh.faces])


@pytest.mark.parametrize("fault", ["moved", "missing", "another"])
def test_other_faces_are_not_taken_for_the_surface_s(fault):
    mesh = irregular_disk()
    points, faces = mesh.vertices.copy(), mesh.faces[::-1].copy()
    if fault == "moved":
        points[40] += [0, 0, 1e-3]
    elif fault == "missing":
        faces = faces[1:]
    else:
        faces[0] = [0, 1, 80]
    assert in_order(Mesh(points, faces), Parameterization(points[:, :2], faces), mesh) is None
