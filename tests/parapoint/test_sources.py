"""Source hashes: every module that a result depends on counts, and nothing else does."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from parapoint import sources

ROOT = Path(__file__).parents[2]


def test_a_module_counts_with_all_that_it_imports_and_the_packages_around_it():
    found = sources.sources("parapoint.surfaces.cutting")
    assert {"parapoint", "parapoint.surfaces", "parapoint.surfaces.surface"} <= set(found)
    assert found["parapoint.surfaces"].name == "__init__.py"
    assert not any(name.startswith("parapoint.learned") for name in found)


def test_imports_inside_functions_count_and_those_for_types_alone_do_not():
    text = """
from typing import TYPE_CHECKING
import os.path
if TYPE_CHECKING:
    from parapoint.estimator import ParaPoint
def late():
    from parapoint.computed import scale
    from . import sibling
    from .room import thing
"""
    assert sources.imported(text, "own.package") == (
        "typing",
        "typing.TYPE_CHECKING",
        "os.path",
        "parapoint.computed",
        "parapoint.computed.scale",
        "own.package",
        "own.package.sibling",
        "own.package.room",
        "own.package.room.thing",
    )


def test_names_that_the_package_offers_lead_to_their_modules(tmp_path, monkeypatch):
    (tmp_path / "plugin_of_mine.py").write_text("from parapoint import ParaPoint\n")
    monkeypatch.syspath_prepend(tmp_path)
    assert "parapoint.learned.networks" in sources.sources("plugin_of_mine")


def test_no_package_is_run_so_that_one_that_refuses_to_counts_as_elsewhere(tmp_path, monkeypatch):
    (tmp_path / "toy" / "learned").mkdir(parents=True)
    refuses = "from parapoint.errors import InputError\nraise InputError('needs a library')\n"
    for file, text in {
        "__init__.py": "",
        "method.py": "def late():\n    from toy.learned.trainer import Trainer\n",
        "learned/__init__.py": refuses,
        "learned/trainer.py": "class Trainer: ...\n",
    }.items():
        (tmp_path / "toy" / file).write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    found = sources.sources("toy.method")
    assert {"toy", "toy.method", "toy.learned", "toy.learned.trainer"} <= found.keys()
    assert not {"toy", "toy.learned"} & sys.modules.keys()


def test_a_module_that_is_not_there_is_an_error():
    with pytest.raises(ModuleNotFoundError, match=r"parapoint\.nothing"):
        sources.sources("parapoint.nothing")


@pytest.mark.parametrize("given", ["2.13.0", "2.13.0+cpu"])
def test_a_version_counts_without_the_name_of_its_build(given, monkeypatch):
    monkeypatch.setattr(sources.metadata, "version", lambda _: given)
    assert sources.version("torch") == "2.13.0"
    monkeypatch.undo()
    assert sources.version("no-such-package") == "absent"


DEPENDENCIES = {
    "parapoint/surfaces/__init__.py": "parapoint.surfaces.cutting",
    "parapoint/surfaces/surface.py": "benchmarks.metrics.evaluation",
    "benchmarks/metrics/overlap.py": "benchmarks.metrics.evaluation",
    "benchmarks/metrics/table.py": "benchmarks.metrics.evaluation",
    "benchmarks/metrics/reference.py": "benchmarks.metrics.evaluation",
    "parapoint/files/clouds/pcd.py": "parapoint.files.reading",
    "parapoint/learned/losses.py": "parapoint.learned.parapoint",
    "parapoint/computed/scale.py": "parapoint.unwrapping.unwrap",
    "parapoint/planar/tutte.py": "baselines.disks.slim",
    "benchmarks/rendering/scene.py": "reports.pictures.drawing",
}
"""Files, and a module that depends on each."""

CHANGES = """
import sys
from pathlib import Path
sys.path.insert(0, ".")
from parapoint.sources import source_hash
for file, module in {dependencies}.items():
    before = source_hash(module)
    path = Path(file)
    text = path.read_text(encoding="utf-8")
    path.write_text(text + "CHANGED = 1\\n", encoding="utf-8")
    print(file, source_hash(module) != before)
    path.write_text(text, encoding="utf-8")
    assert source_hash(module) == before
"""


def test_a_changed_line_changes_the_hash_of_all_that_depends_on_it(tmp_path):
    for package in ("parapoint", "baselines", "benchmarks", "reports"):
        shutil.copytree(ROOT / package, tmp_path / package)
    code = CHANGES.format(dependencies=DEPENDENCIES)
    command = [sys.executable, "-P", "-c", code]
    done = subprocess.run(command, cwd=tmp_path, env={}, capture_output=True, text=True, check=True)
    assert done.stdout.split() == [word for file in DEPENDENCIES for word in (file, "True")]
