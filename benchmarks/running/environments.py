"""Environments of methods that need packages which the project itself does not ask for.

A method names them (`parapoint.method.Method`: `environment`), and a run makes an environment that
has them, once: later runs find it in the project's cache. It is layered over the environment that
the run itself uses: what the method asks for comes first, all else is found where it always was.
"""

from __future__ import annotations

import hashlib
import importlib.util
import json
import os
import platform
import shutil
import subprocess
import sys
import sysconfig
import venv
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

from benchmarks.cases.models import cache_folder
from benchmarks.running.environment import ROOT
from benchmarks.store.records import loaded
from parapoint.method import MissingError

INSTALL = """
import os, runpy, sys
from benchmarks.running.limits import end_with
end_with(int(sys.argv.pop(1)))
runpy.run_module("pip", run_name="__main__", alter_sys=True)
"""
"""Runs pip such that it ends when the run does: the next run must find nobody at work there."""
UNREACHABLE = "WARNING: Retrying"
"""How pip begins a line where it cannot reach an index of packages."""


@dataclass(frozen=True)
class Environment:
    """An environment that has what a method asks for.

    Attributes:
        interpreter: its Python.
        versions: of each package that it has before, or instead of, those of the run.
    """

    interpreter: Path
    versions: Mapping[str, str]


def made(requirements: Sequence[str], tell: Callable[[Path], None]) -> Environment:
    """The environment that has `requirements`; it is made unless it is there.

    Only a whole environment has a record, which is written last: what a run that was killed has
    left is made anew. A lock lets one run make it while others wait.

    Args:
        requirements: what pip is to install.
        tell: called with the folder before anything is installed.

    Raises:
        MissingError: it cannot be made; the message says why, in one line.
    """
    import filelock

    folder = _folder(requirements)
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with filelock.FileLock(folder.with_suffix(".lock")):
            found = _read(folder)
            if found is None:
                tell(folder)
                shutil.rmtree(folder, ignore_errors=True)
                try:
                    found = _make(folder, requirements)
                except BaseException:
                    shutil.rmtree(folder, ignore_errors=True)
                    raise
            return found
    except (OSError, subprocess.SubprocessError) as error:
        said = " ".join(str(error).split())
        raise MissingError(f"{', '.join(requirements)}: {said}") from None


def found(requirements: Sequence[str]) -> Environment | None:
    """The environment that has `requirements`, if an earlier run has made it."""
    return _read(_folder(requirements))


def _folder(requirements: Sequence[str]) -> Path:
    """Where the environment with these requirements is, over the environment of this process."""
    parts = [requirements, sys.version, platform.platform(), sys.prefix]
    digest = hashlib.sha256(json.dumps(parts).encode()).hexdigest()[:16]
    return cache_folder() / "environments" / digest


def _read(folder: Path) -> Environment | None:
    """The environment in a folder; None unless it is whole, and the Python below it still there."""
    interpreter = _interpreter(folder)
    try:
        record = loaded((folder / "environment.json").read_bytes())
        return Environment(interpreter, record["versions"]) if interpreter.exists() else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _interpreter(folder: Path) -> Path:
    """The Python of the environment in a folder."""
    return folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")


def _make(folder: Path, requirements: Sequence[str]) -> Environment:
    """Make the environment in a folder that is not there yet.

    Raises:
        MissingError: pip cannot install the requirements.
        OSError, subprocess.SubprocessError: the folder cannot be written.
    """
    lacks_pip = importlib.util.find_spec("pip") is None
    venv.EnvBuilder(symlinks=os.name != "nt", with_pip=lacks_pip).create(folder)
    interpreter = _interpreter(folder)
    own = sysconfig.get_path("purelib", "venv", {"base": str(folder)})
    below = [path for path in sys.path if Path(path).name in {"site-packages", "dist-packages"}]
    layers = "".join(f"import site; site.addsitedir({path!r})\n" for path in below)
    (Path(own) / "over_the_run.pth").write_text(layers, encoding="utf-8")
    pip = [str(os.getpid()), "install", "--no-input", "--disable-pip-version-check"]
    done = subprocess.run(  # noqa: S603  pip; the requirements are no options, as they follow "--"
        [interpreter, "-c", INSTALL, *pip, "--retries", "1", "--", *requirements],
        capture_output=True,
        text=True,
        errors="replace",
        cwd=ROOT,
        stdin=subprocess.DEVNULL,
        check=False,
    )
    if done.returncode:
        raise MissingError(f"{', '.join(requirements)}: {_reason(done.stderr)}")
    found = sorted((one.name, one.version) for one in metadata.distributions(path=[own]))
    environment = Environment(interpreter, dict(found))
    record = {"requirements": requirements, "versions": environment.versions}
    whole = folder / "environment.json"
    whole.with_suffix(".part").write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    whole.with_suffix(".part").replace(whole)
    return environment


def _reason(said: str) -> str:
    """Why pip has failed: the first error in what it printed, without its prefix."""
    lines = [line.strip() for line in said.splitlines() if line.strip()]
    errors = [line for line in lines if line.startswith("ERROR:")] or lines[-1:] or ["pip failed"]
    offline = any(line.startswith(UNREACHABLE) for line in lines)
    unreachable = "; no index of packages could be reached" if offline else ""
    return errors[0].removeprefix("ERROR: ") + unreachable
