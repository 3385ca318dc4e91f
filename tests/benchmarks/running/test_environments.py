"""A method may name requirements: it runs in an environment that has them, made once."""

from __future__ import annotations

import socket
import subprocess
import sys
import zipfile

import numpy as np
import psutil
import pytest

from baselines import registry
from benchmarks.cases.suites import Suite
from benchmarks.commands import listing
from benchmarks.commands.display import Display
from benchmarks.running import environments, executors, local, runner
from benchmarks.store.results import Store
from parapoint.errors import InputError
from parapoint.method import MissingError

PLUGIN = """
import sys
from dataclasses import dataclass
from typing import ClassVar

import igl
import numpy as np
from parapoint import Parameterization


@dataclass(frozen=True)
class {kind}:
    requires: ClassVar[frozenset[str]] = frozenset({{"faces"}})
    {environment}

    def parameterize(self, surface, *, seed):
        try:
            from handmade import WORD
        except ImportError:
            WORD = "none"
        report = {{"word": WORD, "prefix": sys.prefix, "igl": igl.__file__}}
        report["numpy"] = np.__version__
        return Parameterization(surface.vertices[:, :2], surface.faces, report=report)
"""
MAKER = """
from benchmarks.running import environments
environments.made(["handmade==1.0"], lambda folder: print("installing", flush=True))
"""
SLOWLY = """
import time
from benchmarks.running import environments
def slowly(folder, requirements):
    folder.mkdir()
    time.sleep(1)
    (folder / "environment.json").write_text('{"versions": {}}')
    return environments._read(folder)
environments._make = slowly
environments._interpreter = lambda folder: folder
"""


def wheel(folder, word):
    """A wheel of a package `handmade` whose WORD is `word`."""
    path = folder / "handmade-1.0-py3-none-any.whl"
    info = "handmade-1.0.dist-info"
    files = {
        "handmade.py": f"WORD = {word!r}\n",
        f"{info}/METADATA": "Metadata-Version: 2.1\nName: handmade\nVersion: 1.0\n"
        "Requires-Dist: numpy\n",
        f"{info}/WHEEL": "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
    }
    files[f"{info}/RECORD"] = "".join(f"{name},,\n" for name in [*files, f"{info}/RECORD"])
    with zipfile.ZipFile(path, "w") as archive:
        for name, text in files.items():
            archive.writestr(name, text)
    return path


@pytest.fixture(scope="module")
def offline(tmp_path_factory):
    """A cache of its own, and pip with nothing but the wheel `handmade` within its reach."""
    folder = tmp_path_factory.mktemp("environments")
    wheel(folder, "by hand")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(folder / "cache"))
        patch.setenv("PIP_NO_INDEX", "1")
        patch.setenv("PIP_FIND_LINKS", str(folder))
        yield folder


@pytest.fixture(scope="module")
def rows(offline):
    """Rows, by method, of one run with three kinds of methods."""
    kinds = {
        "Plain": "",
        "Handmade": 'environment: ClassVar[tuple[str, ...]] = ("handmade==1.0",)',
        "Nowhere": 'environment: ClassVar[tuple[str, ...]] = ("no-such-thing>=2",)',
    }
    plugins = []
    for kind, text in kinds.items():
        path = offline / f"{kind.lower()}.py"
        path.write_text(PLUGIN.format(kind=kind, environment=text))
        plugins.append(f"{path}:{kind}")
    suite = Suite("trial", "A trial", ("cone",), tuple(kind.lower() for kind in kinds), (0,))
    runner.run(suite, offline / "out", plugins=plugins)
    return {row.method: row for row in Store(offline / "out").rows()}


def test_each_method_finds_its_own_packages_first_and_all_others(rows):
    plain, own = rows["plain"], rows["handmade"]
    assert (plain.status, own.status) == ("ok", "ok")
    assert (plain.report["word"], own.report["word"]) == ("none", "by hand")
    assert plain.report["prefix"] == sys.prefix
    assert own.report["prefix"].startswith(str(environments.cache_folder()))
    assert own.report["igl"] == plain.report["igl"]
    assert own.report["numpy"] == np.__version__  # asked for without a version: that of the run


def test_the_run_notes_what_an_environment_has(rows, offline):
    run = Store(offline / "out").environment()["runs"][rows["handmade"].run]
    assert run["environments"] == {"handmade==1.0": {"handmade": "1.0"}}


def test_what_cannot_be_installed_is_a_row_with_the_words_of_pip(rows):
    row = rows["nowhere"]
    assert row.status == "skipped"
    assert row.reason == (
        "not installed: no-such-thing>=2: Could not find a version that satisfies the requirement "
        "no-such-thing>=2 (from versions: none)"
    )
    assert not environments._folder(["no-such-thing>=2"]).exists()


def test_two_runs_at_once_make_it_once(offline, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(offline / "shared"))
    both = [
        subprocess.Popen([sys.executable, "-c", SLOWLY + MAKER], stdout=subprocess.PIPE, text=True)
        for _ in range(2)
    ]
    said = sorted(process.communicate()[0] for process in both)
    assert said == ["", "installing\n"]


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere pip may outlive the run")
def test_a_run_killed_while_it_installs_leaves_nothing_that_counts(offline, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(offline / "killed"))
    with socket.create_server(("127.0.0.1", 0)) as silent, monkeypatch.context() as online:
        online.delenv("PIP_NO_INDEX")
        online.setenv("PIP_INDEX_URL", f"http://127.0.0.1:{silent.getsockname()[1]}/")
        run = subprocess.Popen([sys.executable, "-c", MAKER], stdout=subprocess.PIPE, text=True)
        asked, _ = silent.accept()  # pip waits for an answer
        (pip,) = psutil.Process(run.pid).children()
        run.kill()
        assert run.communicate()[0] == "installing\n"
        pip.wait(10)
        asked.close()
    folder = environments._folder(["handmade==1.0"])
    assert folder.exists()
    assert environments._read(folder) is None  # so that it is made anew, as the next test shows


@pytest.mark.usefixtures("rows")
def test_an_environment_is_made_once():
    found = environments.made(["handmade==1.0"], pytest.fail)
    assert found.versions == {"handmade": "1.0"}


def test_what_is_not_whole_is_made_anew(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    folder = environments._folder(["handmade==1.0"])
    (folder / "bin").mkdir(parents=True)
    (folder / "bin" / "python").touch()
    whole = environments.Environment(folder, {})

    def make(place, requirements):
        assert not place.exists()
        assert requirements == ["handmade==1.0"]
        return whole

    monkeypatch.setattr(environments, "_make", make)
    told = []
    assert environments.made(["handmade==1.0"], told.append) is whole
    assert told == [folder]


def test_a_cache_that_cannot_be_written_is_said(tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    with pytest.raises(MissingError, match=r"^handmade==1.0: .*Not a directory"):
        environments.made(["handmade==1.0"], print)


def test_an_index_out_of_reach_is_said():
    said = (
        "WARNING: Retrying (Retry(total=0, ...)) after connection broken by '...': /simple/x/\n"
        "ERROR: Could not find a version that satisfies the requirement x (from versions: none)\n"
        "ERROR: No matching distribution found for x\n"
    )
    assert environments._reason(said) == (
        "Could not find a version that satisfies the requirement x (from versions: none); "
        "no index of packages could be reached"
    )
    assert environments._reason("Traceback:\nImportError: no\n\n") == "ImportError: no"
    assert environments._reason("first\nsecond\nlast\n") == "last"
    assert environments._reason("the only line") == "the only line"
    assert environments._reason("") == "pip failed"


@pytest.fixture
def handmade(offline, rows):  # noqa: ARG001  the rows come first: they write the plugins
    """Runs the method `handmade` alone, by an executor; its last row."""

    def again(folder, **options):
        suite = Suite("trial", "A trial", ("cone",), ("handmade",), (0,))
        plugins = [f"{offline / 'handmade.py'}:Handmade"]
        runner.run(suite, folder, plugins=plugins, **options)
        return Store(folder).rows()[-1]

    return again


def test_an_environment_in_which_no_cell_can_start_fails_its_cells_alone(
    handmade, tmp_path, monkeypatch
):
    broken = tmp_path / "python"
    broken.write_text("#!/bin/sh\necho broken\nexit 1\n")
    broken.chmod(0o755)
    made = environments.Environment(broken, {})
    monkeypatch.setattr(environments, "made", lambda *_: made)
    row = handmade(tmp_path / "out")
    assert row.status == "failed"
    assert row.reason == "in its environment no process can be started for a cell: broken"


def test_an_executor_on_other_machines_skips_what_needs_an_environment(
    handmade, tmp_path, monkeypatch
):
    def here(_, folder, *, tick, **__):
        return local.Local(folder, 1, tick)

    monkeypatch.setattr(executors, "executor", here)
    row = handmade(tmp_path / "out", executor="dask://somewhere:1", memory=1)
    assert row.status == "skipped"
    assert row.reason == (
        "not installed: handmade==1.0: environments are made by --executor local alone"
    )


def test_what_is_installed_is_said_on_standard_error(tmp_path, capsys):
    Display().installing(["bpy>=4.3", "other"], tmp_path)
    captured = capsys.readouterr()
    assert captured.err == f"installing bpy>=4.3, other into {tmp_path}, once\n"
    assert not captured.out


@pytest.mark.parametrize("wrong", ['"bpy"', '["bpy"]', "(1,)", '("",)'])
def test_requirements_that_are_none_are_refused(tmp_path, wrong):
    path = tmp_path / "wrong.py"
    path.write_text(PLUGIN.format(kind="Wrong", environment=f"environment = {wrong}"))
    with pytest.raises(InputError, match=r"environment in .* must be a tuple of requirements"):
        registry.register_plugin(f"{path}:Wrong")


def test_a_method_and_its_list_say_what_it_needs():
    assert registry.describe("blender_conformal").environment == ("bpy>=4.3",)
    assert registry.describe("slim").environment == ()
    assert "A run makes it an environment: bpy>=4.3." in listing.about("blender_conformal")
    table = listing.methods()
    columns = {str(column.header): list(map(str, column.cells)) for column in table.columns}
    named = dict(zip(columns["method"], columns["environment"], strict=True))
    assert (named["blender_smart_project"], named["lscm"]) == ("bpy>=4.3", "")
