"""What the sessions of nox hand on to the project's commands."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest

FILE = Path(__file__).parents[1] / "noxfile.py"


class Session:
    """A session that keeps the commands that it should run."""

    def __init__(self, *posargs: str) -> None:
        self.posargs = posargs
        self.ran: list[tuple[str, ...]] = []
        self.installed = ""

    def install(self, *arguments: str) -> None:
        self.installed = arguments[-1]

    def run(self, *words: str) -> None:
        self.ran.append(words)

    def error(self, message: str) -> None:
        raise ValueError(message)


@pytest.fixture
def noxfile(monkeypatch):
    """The module noxfile.py, without nox."""
    nox = ModuleType("nox")
    nox.__dict__.update(options=SimpleNamespace(), session=lambda made: made, Session=Session)
    monkeypatch.setitem(sys.modules, "nox", nox)
    spec = importlib.util.spec_from_file_location("noxfile_of_this_project", FILE)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize(
    ("given", "handed_on"),
    [
        ("", "paper --out results/paper --jobs 3"),
        ("smoke", "smoke --out results/smoke --jobs 3"),
        ("smoke --out=a --jobs=1", "smoke --out a --jobs 1"),
        ("--jobs 1 smoke --out a", "smoke --out a --jobs 1"),
        ("--seeds 0,1 --strict", "paper --seeds 0,1 --strict --out results/paper --jobs 3"),
        ("smoke --with uvatlas --timeout 5", "smoke --timeout 5 --out results/smoke --jobs 3"),
    ],
)
def test_a_bench_has_the_options_that_were_given_and_else_its_own(
    noxfile, monkeypatch, given, handed_on
):
    monkeypatch.setattr(noxfile.os, "cpu_count", lambda: 3)
    session = Session(*given.split())
    noxfile.bench(session)
    words = handed_on.split()
    assert session.ran == [
        ("python", "-m", "benchmarks", "run", *words),
        ("python", "-m", "reports", words[words.index("--out") + 1]),
    ]
    assert ("uvatlas" in session.installed) == ("--with" in given)


def test_an_extra_that_there_is_not_is_refused(noxfile):
    with pytest.raises(ValueError, match="--with takes uvatlas, uvunwrap; not blender"):
        noxfile.bench(Session("smoke", "--with=blender"))
