"""Dataclasses come back from JSON as they were, or not at all."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from benchmarks.store.records import fields_of, from_fields, loaded, plain


def test_a_report_is_written_whatever_is_in_it():
    report = {1: np.float64("inf"), "a": np.arange(2), "b": {3, 2}, "c": (None, True), "d": object}
    written = plain(report)
    assert json.loads(json.dumps(written, allow_nan=False)) == {
        "1": "inf",
        "a": [0, 1],
        "b": [2, 3],
        "c": [None, True],
        "d": str(object),
    }


@dataclasses.dataclass(frozen=True)
class Sample:
    text: str
    count: int = 0
    share: float | None = None
    names: tuple[str, ...] = ()
    numbers: Mapping[str, float] = dataclasses.field(default_factory=dict)
    anything: Mapping[str, object] = dataclasses.field(default_factory=dict)
    path: Path = Path()


@pytest.mark.parametrize(
    "record",
    [
        Sample("a"),
        Sample("a", 3, 0.5, ("x", "y"), {"z": -math.inf}, {"k": [1, None]}, Path("a/b")),
        Sample("a", share=math.inf, numbers={"z": math.inf}),
    ],
)
def test_a_record_comes_back_as_it_was(record):
    assert from_fields(Sample, loaded(json.dumps(fields_of(record)).encode())) == record


def test_a_whole_number_will_do_for_a_float():
    found = from_fields(Sample, {"text": "a", "share": 1, "numbers": {"z": 2}})
    assert isinstance(found.share, float)
    assert isinstance(found.numbers["z"], float)


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({}, "Sample lacks a field"),
        ([], "Sample needs an object"),
        ({"text": 1}, "Sample.text cannot be 1"),
        ({"text": "a", "count": True}, "Sample.count cannot be True"),
        ({"text": "a", "count": 1.0}, r"Sample.count cannot be 1\.0"),
        ({"text": "a", "share": False}, "Sample.share cannot be False"),
        ({"text": "a", "share": "1"}, "Sample.share cannot be '1'"),
        ({"text": "a", "names": ["x", 1]}, "Sample.names"),
        ({"text": "a", "numbers": {"z": None}}, "Sample.numbers"),
        ({"text": "a", "anything": 1}, "Sample.anything"),
        ({"text": "a", "path": 1}, "Sample.path"),
        ({"text": "a", "other": 1}, "Sample has no field 'other'"),
    ],
)
def test_a_wrong_field_is_named(fields, says):
    with pytest.raises(ValueError, match=says):
        from_fields(Sample, fields)


def test_sets_are_written_in_order():
    words = {f"word{n}" for n in range(50)}
    assert plain(words) == sorted(words)
