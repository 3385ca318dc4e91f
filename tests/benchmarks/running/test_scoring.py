"""Maps are measured a few at a time, and one that spoils it is told from the others."""

from __future__ import annotations

import contextlib
from pathlib import Path

import numpy as np
import pytest

from benchmarks.running import scoring
from benchmarks.running.local import Local
from benchmarks.running.tasks import Outcome
from benchmarks.store import measuring
from benchmarks.store.archives import arrays_hash, map_arrays, write_arrays
from benchmarks.store.results import Store
from benchmarks.store.rows import ResultRow, identity
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import Mesh

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], dtype=float)
FACES = np.array([[0, 1, 2], [1, 3, 2]])


@pytest.fixture
def store(tmp_path):
    """Nine maps of a square and one of a larger one, each stretched by 1 + its seed."""
    store = Store(tmp_path / "results")
    with store.writing():
        for seed in range(10):
            mesh = Mesh(CORNERS * (1 + seed // 9), FACES)
            uv = CORNERS[:, :2] * [1 + seed, 1]
            add(store, mesh, Parameterization(uv, FACES), seed)
    return store


def add(store: Store, mesh: Mesh, found: Parameterization, seed: int) -> None:
    """Stores a map as a run does."""
    cell = {
        "suite": "trial",
        "case": "square",
        "method": "stretched",
        "params": {},
        "seed": seed,
        "source_hash": "abc",
        "surface_hash": store.add_surface(mesh),
    }
    row_id = identity(**cell)
    path = store.folder / "map.npz"
    write_arrays(path, map_arrays(found))
    store.add_map(row_id, path)
    digest = arrays_hash(map_arrays(found))
    store.append(
        ResultRow(id=row_id, status="ok", uv_file=f"uv/{row_id}.npz", uv_sha256=digest, **cell)
    )


class Hands:
    """Does tasks by asking a function for the outcome of each."""

    def __init__(self, outcome):
        self.outcome = outcome
        self.sizes: list[int] = []
        self.width = 2

    def run(self, tasks, jobs):
        assert jobs == 2
        for task in tasks:
            self.sizes.append(len(task.job.maps))
            task.began()
            task.ended(self.outcome(task.job), Path("none"))


def test_maps_of_one_surface_are_measured_together_and_each_gets_its_own_metrics(store):
    names = {store.uv_path(row.id): float(row.seed) for row in store.rows()}
    hands = Hands(lambda job: Outcome("ok", metrics=tuple({"a": names[m]} for m in job.maps)))
    told: list[tuple[int, int]] = []
    values, reasons = scoring.scores(store, store.rows(), hands, 1.0, lambda *n: told.append(n))
    assert hands.sizes == [8, 1, 1]
    assert values == {row.id: {"a": float(row.seed)} for row in store.rows()}
    assert not reasons
    assert told[0] == (0, 10)
    assert told[-1] == (10, 10)


def test_a_map_that_kills_its_process_spoils_no_other(store):
    (bad,) = (row.id for row in store.rows() if row.seed == 5)

    def outcome(job):
        if store.uv_path(bad) in job.maps:
            return Outcome("out_of_memory", "too large")
        return Outcome("ok", metrics=tuple({"a": 1.0} for _ in job.maps))

    hands = Hands(outcome)
    values, reasons = scoring.scores(store, store.rows(), hands, 1.0, lambda *_: None)
    assert hands.sizes == [8, 1, 1] + [1] * 8
    assert reasons == {bad: "too large"}
    assert values == {row.id: {} if row.id == bad else {"a": 1.0} for row in store.rows()}


def test_metrics_that_do_not_come_for_every_map_are_no_metrics(store):
    hands = Hands(lambda job: Outcome("ok", metrics=({"a": 1.0},) * (len(job.maps) - 1)))
    values, reasons = scoring.scores(store, store.rows(), hands, 1.0, lambda *_: None)
    assert set(reasons.values()) == {"its metrics were lost"}
    assert all(found == {} for found in values.values())


def test_many_maps_have_as_much_time_as_each_alone(store):
    limits: list[float] = []

    def outcome(job):
        limits.append(job.time_limit / len(job.maps))
        return Outcome("failed", "no")

    scoring.scores(store, store.rows(), Hands(outcome), 1.0, lambda *_: None)
    assert set(limits) == {scoring.METRICS_TIME_LIMIT}


def test_maps_measured_together_have_the_metrics_that_they_have_here(store):
    with contextlib.ExitStack() as stack:
        folder = store.folder / "scratch"
        workers = stack.enter_context(Local(folder, 1, lambda: None))
        values, reasons = scoring.scores(store, store.rows(), workers, None, lambda *_: None)
    assert not reasons
    for row in store.rows():
        here = measuring.row_metrics(store, row)
        assert here["quasi_conformal_mean"] == pytest.approx(1 + row.seed)
        assert values[row.id] == pytest.approx(here, nan_ok=True)
