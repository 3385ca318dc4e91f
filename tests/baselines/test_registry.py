import importlib
import os
import subprocess
import sys
import textwrap
import tomllib
import types
import zipfile
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import pytest

import baselines
from baselines import registry
from baselines.disks.slim import SLIM
from parapoint import sources
from parapoint.errors import InputError
from parapoint.testing import check_method

DOCUMENTED = baselines.__doc__.split("the file `planar.py`:\n\n")[1].split("\n\nRun it")[0]
EXAMPLE = textwrap.dedent(DOCUMENTED) + "\n"
PYPROJECT = textwrap.dedent(
    baselines.__doc__.split("`planar` is then a method like any other:\n\n")[1].split("\n\nWhat")[0]
)


@pytest.fixture
def _no_plugins(monkeypatch):
    """An empty table of plugins for one test."""
    monkeypatch.setattr(registry, "_plugins", {})


def test_specs():
    assert registry.method("slim") == ("slim", SLIM())
    spec = " slim ( energy = conformal , iterations = 5 ) "
    assert registry.method(spec) == ("slim", SLIM("conformal", 5))
    assert registry.method("slim(energy='conformal')")[1] == SLIM("conformal")
    assert registry.method("xatlas(max_cost=3)")[1].max_cost == 3.0
    assert isinstance(registry.method("xatlas(max_cost=3)")[1].max_cost, float)


@pytest.mark.parametrize(
    ("spec", "fault"),
    [
        ("slin", "no method 'slin'; did you mean slim"),
        ("quux", "no method 'quux'; there are: tutte, "),
        ("slim(iteration=3)", "slim has no parameter 'iteration'; did you mean iterations"),
        ("lscm(x=3)", "lscm has no parameter 'x'; it has none"),
        ("slim(iterations=many)", "slim: iterations must be int, not 'many'"),
        ("slim(iterations=2.5)", "slim: iterations must be int, not 2.5"),
        ("slim(iterations=True)", "slim: iterations must be int, not True"),
        ("slim(energy=arap)", "energy must be one of symmetric_dirichlet, conformal"),
        ("slim(iterations=1, iterations=2)", "slim: parameter 'iterations' is given twice"),
        ("slim(iterations=f())", "iterations=f\\(\\) is no plain value"),
        ("slim(3)", "name or name\\(key=value"),
        ("slim(**{})", "name or name\\(key=value"),
        ("slim(iterations=3", "name or name\\(key=value"),
        ("slim(iterations=3))(", "name or name\\(key=value"),
        ("", "name or name\\(key=value"),
        ("xatlas(fix_winding=1)", "fix_winding must be bool, not 1"),
    ],
)
def test_bad_specs_say_what_would_do(spec, fault):
    with pytest.raises(InputError, match=fault):
        registry.method(spec)


@pytest.mark.parametrize(
    ("value", "hint", "checked"),
    [
        (3, float, 3.0),
        (None, int | None, None),
        (3, int | None, 3),
        ([1, 2], tuple[int, ...], (1, 2)),
        ([1, 2], tuple[float, float], (1.0, 2.0)),
        ("a", Literal["a", "b"], "a"),
        ({"any": 1}, dict, {"any": 1}),
    ],
)
def test_values_become_the_type_of_their_field(value, hint, checked):
    assert registry._checked(value, hint, "x") == checked


@pytest.mark.parametrize(
    ("value", "hint"),
    [
        ("3", int),
        (True, float),
        ([1, 2, 3], tuple[int, int]),
        ("x", int | None),
        (["a"], tuple[int, ...]),
    ],
)
def test_values_of_another_type_are_refused(value, hint):
    with pytest.raises(InputError, match="x must be"):
        registry._checked(value, hint, "x")


def test_importing_the_registry_imports_no_method():
    code = """
import sys
from baselines import registry
assert "torch" not in sys.modules
others = [m for m in sys.modules if m.startswith("baselines.")]
others = set(others) - {"baselines.registry", "baselines.credits"}
assert not others, others
registry.names()
registry.method("tutte")
for name in ("torch", "xatlas", "pymeshlab", "uvunwrap", "baselines.disks.slim"):
    assert name not in sys.modules, name
"""
    subprocess.run([sys.executable, "-c", code], check=True)


def test_every_built_in_method_is_described():
    for name in registry.METHODS:
        about = registry.describe(name)
        assert about.summary.endswith((".", ")", "."))
    about = registry.describe("slim")
    assert about.requires == ("disk_after_cut", "faces")
    assert about.parameters == {"energy": "'symmetric_dirichlet'", "iterations": "20"}


def test_source_hash_follows_the_method_s_own_modules_and_its_libraries(monkeypatch):
    hashes = {
        name: registry.source_hash(registry.method(name)[1]) for name in ("lscm", "slim", "tutte")
    }
    assert len(set(hashes.values())) == 3
    assert registry.source_hash(SLIM(iterations=5)) == hashes["slim"]  # parameters stand elsewhere
    monkeypatch.setattr(sources, "version", lambda package: f"{package} of tomorrow")
    assert registry.source_hash(SLIM()) != hashes["slim"]


BESIDE_THE_MAP = {
    "parapoint.surfaces.",  # what a surface is; it counts, compares and copies
    "parapoint.files.",
    "parapoint.method",  # asks torch for a GPU
    "parapoint.estimator",
    "parapoint.picturing",
    "parapoint.saving",
    "parapoint.planar.domains",  # asks libigl for areas
    "baselines.neural.method",  # asks libigl for normals
    # A computed map has these only because a trained one is opened by the same commands.
    "parapoint.learned.devices",
    "parapoint.learned.features",
    "parapoint.learned.networks",
    "parapoint.learned.trained_map",
}
"""Modules whose libraries decide no map, or the same one in every version."""
EXACT = {"scipy.sparse", "scipy.sparse.csgraph", "scipy.spatial.cKDTree"}
"""Matrices, graphs and nearest points, where nothing is rounded."""


@pytest.mark.parametrize("name", registry.METHODS)
def test_a_method_names_every_library_that_decides_its_map(name):
    module, _, kind = registry.METHODS[name].partition(":")
    kind = getattr(importlib.import_module(module), kind)
    if registry.environment(kind):
        return  # the run says which versions that one has
    needed = set()
    for source, path in sources.sources(module).items():
        if source != module and source.startswith(tuple(BESIDE_THE_MAP)):
            continue
        package = source if path.name == "__init__.py" else source.rpartition(".")[0]
        names = sources.imported(path.read_text(encoding="utf-8"), package)
        whole = {name for name in names if not any(n.startswith(f"{name}.") for n in names)}
        if source != module:
            whole -= EXACT
        needed |= {name.partition(".")[0] for name in whole}
    needed -= {"numpy", *sources.PROJECT, *sys.stdlib_module_names}
    assert {"libigl" if name == "igl" else name for name in needed} <= {*kind.packages}


def test_source_hash_covers_the_preparation_of_those_that_need_one(monkeypatch):
    def hashes():
        specs = ("lscm", "external(command='tool {input} {output}')")
        return [registry.source_hash(registry.method(spec)[1]) for spec in specs]

    lscm, external = hashes()
    found = sources.sources

    def without_preparation(*modules):
        return found(*(name for name in modules if name != "parapoint.surfaces.preparation"))

    monkeypatch.setattr(sources, "sources", without_preparation)
    changed, same = hashes()
    assert changed != lscm
    assert same == external


@pytest.mark.usefixtures("_no_plugins")
def test_source_hash_of_a_plugin_does_not_depend_on_its_folder(tmp_path):
    made = []
    for folder in ("a", "b", "c"):
        (tmp_path / folder).mkdir()
        file = tmp_path / folder / "planar.py"
        file.write_text(EXAMPLE + "# changed" * (folder == "c"))
        registry._plugins.clear()
        registry.register_plugin(f"{file}:Planar")
        made.append(registry.source_hash(registry.method("planar")[1]))
    assert made[0] == made[1] != made[2]


@pytest.mark.usefixtures("_no_plugins")
def test_example_of_the_documentation_is_short_and_runs_as_it_stands(tmp_path):
    assert len(EXAMPLE.strip().splitlines()) <= 20
    file = tmp_path / "planar.py"
    file.write_text(EXAMPLE)
    assert registry.register_plugin(f"{file}:Planar") == "planar"
    assert registry.register_plugin(f"{file}:Planar") == "planar"  # again: the same one
    assert "planar" in registry.names()
    name, method = registry.method("planar(scale=2)")
    assert (name, method.scale) == ("planar", 2.0)
    check_method(method)
    assert registry.describe("planar").parameters == {"scale": "1.0"}


def test_example_is_a_method_where_it_is_installed_as_a_package(tmp_path):
    pytest.importorskip("pip")
    project = tomllib.loads(PYPROJECT)["project"]
    points = [
        f"[{group}]\n" + "".join(f"{name} = {place}\n" for name, place in entries.items())
        for group, entries in project["entry-points"].items()
    ]
    stem = f"{project['name']}-{project['version']}"
    metadata = f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n"
    wheel = tmp_path / f"{stem}-py3-none-any.whl"  # what pip builds of the folder, with no network
    with zipfile.ZipFile(wheel, "w") as file:
        file.writestr("planar.py", EXAMPLE)
        file.writestr(f"{stem}.dist-info/METADATA", metadata)
        file.writestr(f"{stem}.dist-info/WHEEL", "Wheel-Version: 1.0\nTag: py3-none-any\n")
        file.writestr(f"{stem}.dist-info/entry_points.txt", "\n".join(points))
        file.writestr(f"{stem}.dist-info/RECORD", "")
    site = tmp_path / "site"
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-index", "--no-deps"]
    subprocess.run([*pip, "--target", site, wheel], check=True)
    code = """
from baselines import registry
from parapoint.testing import check_method

assert "planar" in registry.names()
name, method = registry.method("planar(scale=2)")
check_method(method)
print(name, method.scale, type(method).__module__)
"""
    environment = os.environ | {"PYTHONPATH": str(site)}
    said = subprocess.check_output([sys.executable, "-c", code], text=True, env=environment)
    assert said == "planar 2.0 planar\n"


def test_installed_package_that_cannot_be_imported_says_so(tmp_path, monkeypatch):
    info = tmp_path / "broken-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: broken\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[parapoint.methods]\nbroken = no_such_module:Thing\n")
    monkeypatch.syspath_prepend(tmp_path)
    registry._installed.cache_clear()
    assert "broken" in registry.names()
    with pytest.raises(InputError, match=r"broken .* does not run: ModuleNotFoundError"):
        registry.method("broken")
    registry._installed.cache_clear()


@pytest.mark.parametrize(
    ("name", "imported"),
    [
        ("tutte", set()),
        ("parapoint", {"torch"}),
        ("computed", set()),
        ("fam", {"torch"}),
        ("meshlab_lscm", {"pymeshlab"}),
        ("meshed", {"pymeshlab"}),
    ],
)
def test_what_a_method_imports_is_known_through_modules_of_the_project(name, imported):
    method = registry.method(name)[1]
    assert {name for name in ("torch", "pymeshlab") if registry.imports(method, name)} == imported


@pytest.mark.parametrize("home", ["baselines.own", "plugin.own"])
def test_imports_are_followed_through_modules_of_the_project_and_no_farther(monkeypatch, home):
    """A method's module, one that a name of it comes from, and what both import."""
    names = (home, "parapoint.other", "foreign", "near", "far")
    modules = {name: types.ModuleType(name) for name in names}
    for name, module in modules.items():
        monkeypatch.setitem(sys.modules, name, module)
    own = modules[home]
    own.gone = type("Gone", (), {"__module__": "parapoint.gone"})
    own.again = own.thing = type("Thing", (), {"__module__": "parapoint.other"})
    own.foreign = modules["foreign"]
    modules["parapoint.other"].near = modules["near"]
    modules["foreign"].far = modules["far"]
    method = type("Method", (), {"__module__": home})
    found = [name for name in ("foreign", "near", "far") if registry.imports(method, name)]
    assert found == ["foreign", "near"]


@pytest.mark.usefixtures("_no_plugins")
@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("1 / 0", "does not run: ZeroDivisionError"),
        ("class Thing: pass", "no dataclass with a method parameterize"),
        (
            (
                "from dataclasses import dataclass\n@dataclass\nclass Thing:\n"
                "    requires = frozenset({'wings'})\n    def parameterize(self, surface): ..."
            ),
            "requires in .* must be a frozenset of",
        ),
        ("other = 1", "there is no class Thing"),
        *(
            (
                EXAMPLE.replace("Planar", "Thing") + f"    environment = {needed}\n",
                "environment in .* must be a tuple of requirements",
            )
            for needed in ("'bpy'", "(3,)", "('',)")
        ),
    ],
)
def test_bad_plugins_are_refused(tmp_path, text, fault):
    file = tmp_path / "thing.py"
    file.write_text(text)
    with pytest.raises(InputError, match=fault):
        registry.register_plugin(f"{file}:Thing")


@pytest.mark.usefixtures("_no_plugins")
def test_plugin_locations_and_names_that_do_not_do(tmp_path):
    for location in ("thing.py", "thing.py:", ":Thing", "thing.py:not a name"):
        with pytest.raises(InputError, match=r"path/to/file\.py:Class"):
            registry.register_plugin(location)
    with pytest.raises(InputError, match=r"no plugin file nowhere\.py"):
        registry.register_plugin("nowhere.py:Thing")
    file = tmp_path / "mine.py"
    file.write_text(EXAMPLE.replace("Planar", "Slim"))
    with pytest.raises(InputError, match="a method 'slim' already; rename"):
        registry.register_plugin(f"{file}:Slim")


def test_fields_that_are_no_arguments_are_left_out(monkeypatch):
    @dataclass(frozen=True)
    class Sized:
        """A method."""

        sizes: tuple[int, ...] = (1, 2)
        requires: ClassVar[frozenset[str]] = frozenset()

        def parameterize(self, surface, *, seed):
            raise NotImplementedError

    monkeypatch.setattr(registry, "_plugins", {"sized": Sized})
    assert registry.describe("sized").parameters == {"sizes": "(1, 2)"}
    assert registry.method("sized(sizes=[3])")[1].sizes == (3,)


SHEET = {"points": 10_000, "iterations": 4_000, "subset": 1_024, "time_budget": None}
GRID = {"points": 10_000, "iterations": 8_000, "subset": 576, "time_budget": None}
PARAMETERS = {
    "abf": {"iterations": 30},
    "geometry_image": {"side": 257},
    "smith_schaefer": {"iterations": 5000, "time_budget": None},
    "arap": {"iterations": 100},
    "slim": {"energy": "symmetric_dirichlet", "iterations": 20},
    "xatlas": {
        "max_chart_area": 0.0,
        "max_boundary_length": 0.0,
        "normal_deviation_weight": 2.0,
        "roundness_weight": 0.01,
        "straightness_weight": 6.0,
        "normal_seam_weight": 4.0,
        "max_cost": 2.0,
        "max_iterations": 1,
        "fix_winding": False,
        "max_chart_size": 0,
        "padding": 0,
        "texels_per_unit": 0.0,
        "resolution": 0,
        "bilinear": True,
        "block_align": False,
        "brute_force": False,
        "rotate_charts_to_axis": True,
        "rotate_charts": True,
    },
    "uvatlas": {"max_stretch": 1 / 6, "size": 512, "gutter": 1.0, "partitions": 1},
    "uvunwrap": {
        "max_chart_angle": 70.0,
        "max_area_distortion": 4.0,
        "max_chart_area": 0.0,
        "max_boundary_length": 0.0,
        "page_size": 1024,
        "padding": 2,
        "packing": "shape",
    },
    "blender_angle_based": {"fill_holes": False},
    "blender_conformal": {"fill_holes": False},
    "blender_minimum_stretch": {"iterations": 10, "no_flip": False, "fill_holes": False},
    "blender_smart_project": {"angle_limit": 66.0, "island_margin": 0.0, "area_weight": 0.0},
    "meshlab_voronoi": {"regions": 10},
    "meshlab_triangles": {"border": 2, "page_size": 1024},
    "automatic+slim": {"price": 1.0},
    "meshed": {"reconstruction": "poisson", "flattening": "slim"},
    "textured": {"pipeline": "computed", "texels": 2048},
    "external": {"command": "", "recipe": ""},
    "computed": {
        "points": 20_000,
        "distortion": "balanced",
        "time_budget": None,
        "components": "together",
        "seed": 0,
    },
    "unwrap": {
        "time_budget": None,
        "price": 1.0,
        "max_distortion": None,
        "distortion": "isometric",
    },
    "seamster": {"curvature": 1.5},
    "da_wand": {"triangle": 0, "distortion": 0.01},
    "fam": {"points": 10_000, "iterations": 10_000, "subset": 10_000, "time_budget": None},
    "foldingnet": SHEET,
    "atlasnet": SHEET | {"charts": 4},
    "diffsr": SHEET | {"charts": 4},
    "elestruc": SHEET | {"charts": 4, "dimension": 3},
    "gtif": SHEET,
    "tearingnet": SHEET,
    "flattening_net": GRID | {"subset": 256},
    "reggeonet": GRID,
    "nsm": {"points": 100_000, "iterations": 20_000, "subset": 256, "time_budget": None},
    "nuvo": {
        "points": 10_000,
        "iterations": 10_000,
        "subset": 10_000,
        "time_budget": None,
        "charts": 1,
    },
}
"""What results without parameters in their names were measured under: those of tools are the tools'
own. A default that changes here makes new results that cannot be told from old ones by name."""


@pytest.mark.parametrize("name", sorted(PARAMETERS))
def test_defaults_stay_what_the_results_were_measured_under(name):
    wanted = {key: repr(value) for key, value in PARAMETERS[name].items()}
    assert registry.describe(name).parameters == wanted


def test_the_defaults_of_every_method_are_held():
    """Those of ParaPoint are its presets', which its own tests hold."""
    known = {name for name in registry.METHODS if registry.describe(name).parameters}
    assert known - PARAMETERS.keys() == {"parapoint"}


@pytest.mark.parametrize(
    ("name", "promise"),
    [
        ("slim", "yes"),
        ("external", "no"),
        ("uvatlas", "no"),
        ("unwrap", "by its parameters"),
        ("computed", "by its parameters"),
        ("fam", "by its parameters, with as many threads"),
        ("nuvo", "by its parameters, with as many threads"),
        ("parapoint", "by its parameters, with as many threads"),
    ],
)
def test_what_a_method_promises_of_the_same_seed(name, promise):
    assert registry.describe(name).deterministic == promise


def test_names_near_and_far():
    assert registry._near("x", []) == "it has none"
    assert registry._near("slin", ["slim", "lscm"]) == "did you mean slim?"
    # Half of the letters in their places are near enough, and three names at most are given.
    assert registry._near("abxx", ["abyy"]) == "did you mean abyy?"
    assert registry._near("axxx", ["ayyy", "b"]) == "there are: ayyy, b"
    near = registry._near("slim", ["slim1", "slim2", "slim3", "slim4"])
    assert near.count("slim") == 3


def test_any_value_will_do_where_the_hint_says_so_and_items_are_checked_one_by_one():
    assert registry._checked([1, "a"], Any, "x") == [1, "a"]
    assert registry._checked((1, 2.5), tuple[float, ...], "x") == (1.0, 2.5)
    assert registry._checked(True, bool, "x") is True
    assert registry._checked(True, bool | None, "x") is True
    with pytest.raises(InputError, match="x must be bool, not 1"):
        registry._checked(1, bool, "x")
