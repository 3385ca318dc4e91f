"""Messages between processes come back as they were sent, and nothing else passes for one."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from benchmarks.running.tasks import (
    MeasureJob,
    Outcome,
    Prepared,
    Ready,
    RunJob,
    from_json,
    to_json,
)

RUN = RunJob(
    surface=Path("a b.npz"),
    time_limit=1.5,
    memory_limit=2e9,
    folder=Path("cells/1"),
    spec="slim(iterations=1)",
    seed=7,
    source_hash="abc",
    plugins=("x.py:X", "y.py:Y"),
)
MEASURE = MeasureJob(
    surface=Path("s.npz"),
    reference=Path("r.npz"),
    time_limit=1.0,
    memory_limit=1.0,
    maps=(Path("u.npz"), Path("v.npz")),
)
OUTCOME = Outcome(
    "failed",
    "the reason \ud800 \u2028",  # a lone surrogate: the name of a file may hold one
    number=3,
    preprocessing="cut",
    seconds=0.1,
    peak_memory_mb=3.0,
    report={"energy": [1, "inf", None]},
    metrics=({"a": math.inf, "b": 0.1 + 0.2, "c": -0.0}, {}),
)


@pytest.mark.parametrize("message", [RUN, MEASURE, OUTCOME, Prepared("cut"), Ready()])
def test_a_message_comes_back_as_it_was_sent(message):
    line = to_json(message)
    assert line.count(b"\n") == 1
    assert line.endswith(b"\n")
    assert from_json(line, RunJob, MeasureJob, Outcome, Prepared, Ready) == message


def test_the_files_that_a_job_reads_can_lie_elsewhere():
    assert RUN.inputs == {"surface": Path("a b.npz")}
    names = {"surface": "s.npz", "reference": "r.npz", "map0": "u.npz", "map1": "v.npz"}
    assert MEASURE.inputs == {name: Path(file) for name, file in names.items()}
    moved = {name: Path("/there") / file for name, file in names.items()}
    assert MEASURE.reading(moved).inputs == moved
    assert MEASURE.reading(moved).reading(MEASURE.inputs) == MEASURE
    assert (RUN.map, RUN.work) == (Path("cells/1/map.npz"), Path("cells/1/work"))


def test_only_the_messages_that_are_expected_are_read():
    with pytest.raises(ValueError, match="'Prepared' has no place here"):
        from_json(to_json(Prepared("cut")), Ready, Outcome)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"status": "fine"}, "Outcome.status cannot be 'fine'"),
        ({"status": ["ok"]}, "Outcome.status"),
        ({"reason": None}, "Outcome.reason cannot be None"),
        ({"number": "1"}, "Outcome.number"),
        ({"seconds": "1"}, "Outcome.seconds"),
        ({"seconds": True}, "Outcome.seconds"),
        ({"seconds": 10**400}, "Outcome.seconds"),
        ({"seconds": -1}, "Outcome.seconds"),
        ({"cpu_seconds": math.nan}, "Outcome.cpu_seconds"),
        ({"peak_memory_mb": math.inf}, "Outcome.peak_memory_mb"),
        ({"took": "inf"}, "Outcome.took"),
        ({"took": None}, "Outcome.took"),
        ({"report": []}, "Outcome.report"),
        ({"metrics": [{"a": "many"}]}, "Outcome.metrics"),
        ({"host": {}}, "Outcome.host"),
        ({"status_": "ok"}, "has no field 'status_'"),
    ],
)
def test_every_field_of_an_outcome_is_checked(change, says):
    name, fields = json.loads(to_json(OUTCOME))
    with pytest.raises(ValueError, match=says):
        from_json(json.dumps([name, fields | change]).encode(), Outcome)


@pytest.mark.parametrize(
    "change",
    [
        {"surface": 1},
        {"reference": 1},
        {"seed": 1.0},
        {"seed": True},
        {"time_limit": None},
        {"plugins": "x.py:X"},
        {"plugins": [1]},
        {"spec": None},
    ],
)
def test_every_field_of_a_job_is_checked(change):
    name, fields = json.loads(to_json(RUN))
    with pytest.raises(ValueError, match=f"RunJob.{next(iter(change))} cannot be"):
        from_json(json.dumps([name, fields | change]).encode(), RunJob)


@pytest.mark.parametrize(
    "line",
    [
        b"",
        b"{}",
        b"3",
        b"\xff",
        b'["Outcome"]',
        b'["Outcome", []]',
        b'["Outcome", {}]',
        b'["Outcome", {"status": "ok"}, 1]',
        b'[["Outcome"], {"status": "ok"}]',
        b'{"status": "ok"}',
        b"[" * 10**5,
    ],
)
def test_what_is_no_message_is_a_value_error(line):
    with pytest.raises(ValueError, match=r"."):
        from_json(line, Outcome)
