"""The project's commands: `nox` checks it, `nox -s bench` reproduces the tables."""

import os

import nox

nox.options.default_venv_backend = "virtualenv"
nox.options.sessions = ["lint", "types", "tests"]
nox.options.reuse_existing_virtualenvs = True

PACKAGES = ["parapoint", "baselines", "benchmarks", "reports"]


def install(session: nox.Session) -> None:
    session.install("-c", "constraints.txt", "-e", ".[bench,dev]")


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
    install(session)
    session.run("mypy")


@nox.session
def tests(session: nox.Session) -> None:
    """The test suite: `nox -s tests -- -k cutting` runs a part of it."""
    install(session)
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
    """Run a suite (default: paper) and write its report: `nox -s bench -- smoke`."""
    install(session)
    arguments = list(session.posargs)
    if not arguments or arguments[0].startswith("-"):
        arguments.insert(0, "paper")
    if "--out" not in arguments:
        arguments += ["--out", f"results/{arguments[0]}"]
    if "--jobs" not in arguments:  # two cells with a thread each end sooner than one with two
        arguments += ["--jobs", str(min(os.cpu_count() or 1, 8))]
    session.run("python", "-m", "benchmarks", "run", *arguments)
    session.run("python", "-m", "reports", arguments[arguments.index("--out") + 1])


@nox.session
def regress(session: nox.Session) -> None:
    """Compare the metric values of every deterministic method with the golden ones."""
    install(session)
    session.run("python", "-m", "benchmarks.regress", *session.posargs)
