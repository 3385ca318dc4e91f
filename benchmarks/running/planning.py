"""What a run has to do: which methods, which surfaces, and which cells have no row of use yet."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from baselines import registry
from benchmarks.cases import models
from benchmarks.cases.suites import Suite
from benchmarks.running import environment, environments
from benchmarks.running.cluster import WORKER_LOST
from benchmarks.store.records import plain
from benchmarks.store.results import Store
from benchmarks.store.rows import (
    KILLED,
    MACHINE,
    MISSING,
    SOURCE_CHANGED,
    WATCHER_KILLED,
    ResultRow,
    identity,
)
from parapoint.errors import InputError
from parapoint.files.reading import faults_of
from parapoint.messages import unsaid
from parapoint.parameters import LARGEST_SEED, check_whole
from parapoint.sources import source_hash

SLOW = ("torch", "pymeshlab")
"""Packages that are slow to import and start no thread while they are imported. The cells of a
method that imports one are forked from a process that has it already."""
LIMITS = {"timeout": "time_limit", "out_of_memory": "memory_limit"}
"""For each status that a limit causes, the entry of a run's environment that holds the limit."""
LIMIT_RAISED = 1.01
"""Ratio to the limit of the earlier run beyond which a limit counts as raised. The memory that a
machine reports varies a little from day to day."""
MACHINE_FAILED = "machine failed"
"""Why a cell runs again that has ended through no fault of its method."""


@dataclass(frozen=True)
class Chosen:
    """A method of a run.

    Attributes:
        spec: what was asked for, such as "slim(iterations=1)".
        name: its name in the registry.
        params: all its parameters.
        source_hash: hash of its source.
        modules: those of SLOW that it imports.
        environment: what it needs in an environment of its own; empty where it runs in this one.
        counts_threads: whether its map depends on the number of threads.
    """

    spec: str
    name: str
    params: Mapping[str, object]
    source_hash: str
    modules: tuple[str, ...]
    environment: tuple[str, ...] = ()
    counts_threads: bool = False


@dataclass(frozen=True)
class Cell:
    """One case, method and seed to run.

    Attributes:
        row: its row before it has run: only the identity is filled in.
        method: what it runs.
        why: why it runs: "new", or what has changed since its last row.
    """

    row: ResultRow
    method: Chosen
    why: str


def parameters(spec: str) -> tuple[str, dict[str, Any]]:
    """The name of a method in the registry and all its parameters, as rows have them.

    Raises:
        InputError: the name or a parameter is unknown.
    """
    name, method = registry.method(spec)
    return name, plain(dataclasses.asdict(cast("Any", method)))


def choice(
    suite: Suite,
    methods: Sequence[str] | None,
    cases: Sequence[str] | None,
    seeds: Sequence[int] | None,
    plugins: Sequence[str],
) -> tuple[Suite, list[Chosen]]:
    """The suite that was asked for, every name in it checked, and its methods.

    Raises:
        InputError: a name is unknown, a plugin cannot be read, or a seed is out of range.
    """
    added = [registry.register_plugin(plugin) for plugin in plugins]
    chosen = []
    try:
        made = [(spec, *registry.method(spec)) for spec in dict.fromkeys(methods or suite.methods)]
    except InputError as error:
        if methods:
            raise
        raise InputError(f"{error}; or name methods that do without, with --methods") from None
    named = {name for _, name, _ in made}
    made += [(name, *registry.method(name)) for name in added if name not in named]
    for spec, name, method in made:
        params = plain(dataclasses.asdict(cast("Any", method)))
        modules = tuple(module for module in SLOW if registry.imports(method, module))
        counts = registry.depends_on_threads(method)
        needed = registry.environment(method)
        version = registry.source_hash(method)
        chosen.append(Chosen(spec, name, params, version, modules, needed, counts))
    asked = suite.cases if cases is None else cases
    names = tuple(dict.fromkeys(models.canonical_name(case) for case in asked))
    asked_seeds = suite.seeds if seeds is None else tuple(dict.fromkeys(seeds))
    for seed in asked_seeds:
        check_whole("a seed", seed, 0, LARGEST_SEED)
    specs = tuple(method.spec for method in chosen)
    return dataclasses.replace(suite, cases=names, methods=specs, seeds=asked_seeds), chosen


def check_readable(cases: Sequence[str], store: Store) -> None:
    """Read the models that were asked for by name, before the run writes anything.

    What there is to say of them is said when they are stored.

    Raises:
        InputError: a file cannot be read, or every model is missing.
    """
    known, readers = store.surface_hashes(), source_hash("parapoint.files.reading")
    missing = []
    for case in cases:
        try:
            if _origin(case, readers) not in known:
                with unsaid():
                    models.load(case)
        except models.MissingModelError as error:
            missing.append(error)
    if missing and len(missing) == len(cases):
        raise missing[0]


def surfaces(store: Store, cases: Sequence[str]) -> tuple[dict[str, str], dict[str, str]]:
    """Store the surface of each case, with its points without noise and its own map if it has them.

    Returns:
        The hash of each case's surface, "" where the model is missing; and, for each missing case,
        how to get the model.
    """
    hashes, missing = {}, {}
    known, readers = store.surface_hashes(), source_hash("parapoint.files.reading")
    before = dict(known)
    for case in cases:
        origin = _origin(case, readers)
        if origin in known and store.is_whole(known[origin]):
            hashes[case] = known[origin]
            continue
        if origin in known:
            store.forget(known[origin])
        try:
            surface = models.load(case)
        except InputError as error:
            missing[case] = " ".join(str(error).split())
            hashes[case] = ""
            continue
        hashes[case] = store.add_surface(surface)
        if (exact := models.exact_points(case)) is not None:
            store.add_exact(hashes[case], exact)
        if (reference := models.reference(case)) is not None:
            store.add_reference(hashes[case], reference)
        if origin:
            known[origin] = hashes[case]
    if known != before:
        store.note_surfaces(known)
    return hashes, missing


def mend(store: Store, planned: Sequence[Cell]) -> None:
    """Store the files of a surface anew where a cell that runs again has found one damaged.

    Raises:
        InputError: the model cannot be read any more, or the disk is full.
    """
    cells = [cell.row for cell in planned if cell.why == MACHINE_FAILED]
    for case, surface_hash in dict.fromkeys((row.case, row.surface_hash) for row in cells):
        if store.is_whole(surface_hash):
            continue
        store.forget(surface_hash)
        surfaces(store, [case])


def _origin(case: str, readers: str) -> str:
    """What decides the surface of a case: the content of its file, and the hash of its readers.

    "" for a case of which no one file decides: surfaces made in memory, sampled clouds, and .gltf
    files, which name other files.
    """
    model = models.info(case)
    path = Path(case)
    if model:
        return f"{model.sha256} {readers}"
    if models.is_made_in_memory(case) or path.suffix.lower() == ".gltf":
        return ""
    with faults_of(path), path.open("rb") as stream:
        content = hashlib.file_digest(stream, "sha256").hexdigest()
    return f"{content} {path.suffix.lower()} {readers}"


def plan(
    suite: Suite,
    chosen: Sequence[Chosen],
    hashes: Mapping[str, str],
    store: Store,
    here: Mapping[str, Any],
) -> tuple[list[Cell], list[ResultRow]]:
    """The cells that must run, and the rows of those that need not.

    Args:
        suite: the cases and the seeds.
        chosen: the methods.
        hashes: the hash of each case's surface, as `surfaces` returns them.
        store: the rows so far.
        here: the environment of this run, with its limits.
    """
    rows = {row.cell: row for row in store.rows()}
    runs = store.environment()["runs"]
    own = {method.environment: _own_versions(method.environment) for method in chosen}
    planned, kept = [], []
    for method, blank in _blanks(suite, chosen, hashes, here["threads"]):
        row = rows.get(blank.cell)
        versions = own[method.environment]
        why = "new" if row is None else changed(blank, row, store, runs, here, own=versions)
        if why:
            planned.append(Cell(blank, method, why))
        elif row is not None:
            kept.append(row)
    return planned, kept


def _own_versions(requirements: tuple[str, ...]) -> dict[str, Mapping[str, str]]:
    """What the environment with these requirements has, as a run notes it; empty without one."""
    found = environments.found(requirements) if requirements else None
    return {", ".join(requirements): found.versions} if found else {}


def _blanks(
    suite: Suite, chosen: Sequence[Chosen], hashes: Mapping[str, str], threads: int
) -> Iterator[tuple[Chosen, ResultRow]]:
    """Each cell of a suite once: its method, and its row with the identity alone."""
    seen = set()
    for case in suite.cases:
        for method in chosen:
            for seed in suite.seeds:
                of_cell: dict[str, Any] = {
                    "suite": suite.name,
                    "case": case,
                    "method": method.name,
                    "params": method.params,
                    "seed": seed,
                    "source_hash": method.source_hash,
                    "surface_hash": hashes[case],
                    "threads": threads if method.counts_threads else None,
                }
                row_id = identity(**of_cell)
                if row_id not in seen:
                    seen.add(row_id)
                    yield method, ResultRow(id=row_id, status="skipped", **of_cell)


def changed(
    cell: ResultRow,
    row: ResultRow,
    store: Store,
    runs: Sequence[Mapping[str, Any]],
    here: Mapping[str, Any],
    *,
    own: Mapping[str, Mapping[str, str]] = {},
) -> str:
    """Why a cell that has a row must run again; "" if it need not.

    Args:
        cell: the cell as it would run now.
        row: its latest row.
        store: where its map should be.
        runs: the environments of all runs so far.
        here: the environment of this run, with its limits.
        own: by its requirements, what the environment that its method has of its own holds now.
    """
    if not cell.surface_hash:  # the model cannot be had now: what is known of it stays
        return ""
    if row.source_hash != cell.source_hash:
        return "method changed"
    if row.surface_hash != cell.surface_hash:
        return "model changed" if row.surface_hash else "model was missing"
    there = runs[row.run] if 0 <= row.run < len(runs) else {}
    noted = there.get("environments", {})
    if any(noted.get(needed, versions) != versions for needed, versions in own.items()):
        return "libraries changed"
    before = there.get("threads") if row.threads is None else row.threads  # of older rows
    if cell.threads is not None and before != cell.threads:
        return "other number of threads"
    if row.reason == SOURCE_CHANGED:
        return "method changed"
    if row.reason == WORKER_LOST:
        return "workers were lost"
    if row.reason.startswith(MACHINE):
        return MACHINE_FAILED
    if row.reason.startswith((WATCHER_KILLED, *(f"killed by {name} " for name in KILLED))):
        return "was killed"
    if row.status == "ok":
        return "" if store.uv_path(row.id).exists() else "map missing"
    if any(there.get(name) != here[name] for name in environment.MACHINE):
        return f"{row.status} in another environment"
    if row.reason.startswith(MISSING):
        return "may be installed now"
    limit = LIMITS.get(row.status)
    if limit and here[limit] > there.get(limit, 0) * LIMIT_RAISED:
        return "limit raised"
    return ""
