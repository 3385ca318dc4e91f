"""The project's commands: `nox` checks it, `nox -s bench` reproduces the tables."""

import argparse
import os

import nox

nox.options.default_venv_backend = "virtualenv"
nox.options.sessions = ["lint", "types", "tests"]
nox.options.reuse_existing_virtualenvs = True

EXTRAS = ("uvatlas", "uvunwrap")
"""Extras of pyproject.toml that `nox -s bench -- --with NAME` adds."""


def install(session: nox.Session, *extras: str) -> None:
    """Install the project with what a run needs, and more extras of pyproject.toml."""
    wanted = ",".join(["bench", "learned", "meshlab", *extras])
    session.install("-c", "constraints.txt", "-e", f".[{wanted}]")


@nox.session
def lint(session: nox.Session) -> None:
    """Ruff, and the import contract."""
    session.install("ruff>=0.9", "import-linter>=2.1")
    session.run("ruff", "check", ".")
    session.run("ruff", "format", "--check", ".")
    session.run("lint-imports")


@nox.session
def types(session: nox.Session) -> None:
    """Mypy, strict."""
    install(session, "dev", "cluster")
    session.run("mypy")


@nox.session
def tests(session: nox.Session) -> None:
    """The test suite: `nox -s tests -- -k cutting` runs a part of it."""
    install(session, "dev", "cluster", "uvunwrap")
    # A process a core, each with one thread: more would only wait for each other.
    session.run(
        "pytest",
        "-n",
        "logical",
        "--dist",
        "worksteal",
        *session.posargs,
        env={"OMP_NUM_THREADS": "1"},
    )


@nox.session
def bench(session: nox.Session) -> None:
    """Run a suite (default: paper) and write its report: `nox -s bench -- smoke`.

    `--with uvatlas` (or uvunwrap) first installs what these methods need.
    """
    options = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    options.add_argument("--with", dest="extras", action="append", default=[])
    options.add_argument("--out")
    options.add_argument("--jobs")
    given, arguments = options.parse_known_args(session.posargs)
    if unknown := set(given.extras) - {*EXTRAS}:
        session.error(f"--with takes {', '.join(EXTRAS)}; not {', '.join(unknown)}")
    install(session, *given.extras)
    if not arguments or arguments[0].startswith("-"):
        arguments.insert(0, "paper")
    out = given.out or f"results/{arguments[0]}"
    # Two cells with a thread each end sooner than one with two.
    jobs = given.jobs or str(min(os.cpu_count() or 1, 8))
    arguments += ["--out", out, "--jobs", jobs]
    session.run("python", "-m", "benchmarks", "run", *arguments)
    session.run("python", "-m", "reports", out)


@nox.session
def readme(session: nox.Session) -> None:
    """Run what README.md prints, command by command, long ones on small models."""
    install(session, "dev")
    session.run("pytest", "tests/test_printed_commands.py", "tests/test_docs.py", *session.posargs)


@nox.session
def docs(session: nox.Session) -> None:
    """Build the site into build/site; a broken link is an error."""
    install(session, "docs")
    session.run("mkdocs", "build", "--strict", *session.posargs)


@nox.session
def regress(session: nox.Session) -> None:
    """Compare the metric values of the methods that are watched with the golden ones."""
    install(session)
    session.run("python", "-m", "benchmarks.checks.regress", *session.posargs)


@nox.session
def endure(session: nox.Session) -> None:
    """Kill runs, let cells and rows go wrong, run commands among a user's files; print counts.

    15 minutes; `nox -s endure -- --minutes 60 --seed 7`.
    """
    install(session)
    arguments = session.posargs or ["--minutes", "15"]
    session.run("python", "-m", "benchmarks.checks.endurance", "all", *arguments)


@nox.session
def fuzz(session: nox.Session) -> None:
    """Feed readers, saved models and results folders with changed files; print counts.

    15 minutes; `nox -s fuzz -- --minutes 60 --seed 7`.
    """
    install(session)
    arguments = session.posargs or ["--minutes", "15"]
    session.run("python", "-m", "benchmarks.checks.fuzzing", "all", *arguments)


@nox.session
def mutants(session: nox.Session) -> None:
    """Try small wrong changes and count those noticed: `nox -s mutants -- --samples 60 --seed 0`.

    tests/mutants/README.md says how, and which survivors are known.
    """
    install(session, "dev", "cluster", "uvunwrap", "mutants")
    session.run("python", "tests/mutants/mutants.py", *session.posargs)
