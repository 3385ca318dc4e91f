"""How long cells take, about: what `list suites` says, and what a run expects of its rest.

Nothing but words on a screen depends on it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from benchmarks.cases import models
from benchmarks.cases.derived import undrawn
from benchmarks.cases.suites import Suite
from parapoint.errors import InputError

SECONDS_PER_10000_FACES: dict[str, float] = {
    "tutte": 0.012,
    "harmonic": 0.013,
    "mean_value": 0.1,
    "lscm": 0.033,
    "bff": 0.04,
    "abf": 1.5,
    "arap": 0.4,
    "slim": 0.9,
    "smith_schaefer": 30.0,
    "xatlas": 0.9,
    "computed": 3.0,
    "unwrap": 30.0,
    "meshed": 6.0,
}
"""Processor time in seconds for 10,000 faces on one core, by method: medians over all models of
`disk` (tutte, lscm, slim, xatlas) or two or three of them; of `unwrap` over one, and for `meshed` a
guess. It grows faster than the faces for some; a budget bounds it."""
OTHERS = 3.0
"""The same of a method that is not listed."""
WHOLE_BUDGET = frozenset(
    {
        "parapoint",
        "fam",
        "nuvo",
        "foldingnet",
        "atlasnet",
        "diffsr",
        "elestruc",
        "gtif",
        "tearingnet",
        "flattening_net",
        "reggeonet",
        "nsm",
    }
)
"""Methods that use all of their time budget, which is in seconds."""
SECONDS_PER_ITERATION = 0.075
"""Processor time of an iteration of ParaPoint's training at 2,048 points, in seconds."""
OVERHEAD = 0.7
"""Wall time in seconds that the metrics and the process of a cell take beside its method."""
TRUST = 0.1
"""Share of a run that counts, for its pace, as if it had taken the time that was expected."""
USUAL_FACES = 10_000
"""Number of faces that a surface counts for whose size is not known before it is read."""


def faces(case: str) -> int:
    """Number of faces of a case, or of points; USUAL_FACES where only its file can tell."""
    try:
        model = models.info(undrawn(case))
    except InputError:
        return USUAL_FACES
    return (model.faces or model.vertices) if model else USUAL_FACES


def cell_seconds(case: str, method: str, params: Mapping[str, object]) -> float:
    """Wall time in seconds that a cell takes with a core for itself, about."""
    budget = params.get("time_budget")
    if method in WHOLE_BUDGET:
        count = params.get("iterations")
        seconds = SECONDS_PER_ITERATION * count if isinstance(count, int) else 300.0
    else:
        seconds = SECONDS_PER_10000_FACES.get(method, OTHERS) * faces(case) / 10_000
    if isinstance(budget, int | float):
        seconds = float(budget) if method in WHOLE_BUDGET else min(seconds, float(budget))
    return seconds + OVERHEAD


class Expectation(NamedTuple):
    """What a suite needs, about.

    Attributes:
        cells: how many cells it has.
        seconds: wall time on one core.
        megabytes: what its models are to download, in units of 10^6 bytes.
    """

    cells: int
    seconds: float
    megabytes: float


def expectation(
    suite: Suite, parameters: Callable[[str], tuple[str, Mapping[str, object]]]
) -> Expectation:
    """What a suite needs.

    Args:
        suite: the suite.
        parameters: of a spec, the method's name in the registry and all its parameters.
    """
    chosen = [parameters(spec) for spec in suite.methods]
    seconds = sum(cell_seconds(case, *method) for case in suite.cases for method in chosen)
    known = {found.name: found.size for found in map(_model, suite.cases) if found}
    return Expectation(
        len(suite.cases) * len(chosen) * len(suite.seeds),
        seconds * len(suite.seeds),
        sum(known.values()) / 1e6,
    )


def _model(case: str) -> models.Model | None:
    """The model that a case is, or is sampled from; None where nothing is downloaded."""
    return models.registry().get(case.partition("@")[0])


def remaining(
    done: Sequence[tuple[float, float]],
    running: Sequence[tuple[float, float]],
    waiting: Sequence[float],
    jobs: int,
) -> float:
    """Wall time in seconds that the rest of a run takes, about.

    Expectations are scaled by how long the cells that are done have taken against what was expected
    of them. To begin with they are trusted, such that one slow cell does not upset the whole.

    Args:
        done: of each cell that is done, what was expected of it (`cell_seconds`) and what it took.
        running: of each cell that runs, what is expected of it and how long it has been running.
        waiting: what is expected of each other cell.
        jobs: how many cells run at a time.
    """
    trusted = TRUST * (sum(whole for whole, _ in (*done, *running)) + sum(waiting))
    expected = trusted + sum(whole for whole, _ in done)
    pace = (trusted + sum(took for _, took in done)) / expected if expected else 1.0
    left = [max(pace * whole - so_far, 0.0) for whole, so_far in running]
    left += [pace * whole for whole in waiting]
    return max(sum(left) / jobs, max(left, default=0.0))


def size(megabytes: float) -> str:
    """The size of a download in whole megabytes."""
    return "< 1 MB" if 0 < megabytes < 1 else f"{megabytes:.0f} MB"


def clock(seconds: float) -> str:
    """A time span as h:mm:ss."""
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02}:{rest:02}"


def about(seconds: float) -> str:
    """A time span in words and round numbers: a guess has no more digits."""
    if seconds < 90:
        return f"{max(10, round(seconds, -1)):.0f} s"
    minutes = seconds / 60
    return f"{minutes:.0f} min" if minutes < 90 else f"{minutes / 60:.1f} h"
