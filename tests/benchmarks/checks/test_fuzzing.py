"""A short, unguided form of `python -m benchmarks.checks.fuzzing`, and what the long one has
found."""

from __future__ import annotations

import itertools
import logging
import random
import struct
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from click.testing import CliRunner
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.checks import fuzzing
from parapoint.errors import InputError
from parapoint.files.reading import FORMATS, read_surface
from parapoint.surfaces.surface import Mesh

HOSTILE = [
    b"",
    b"-1",
    b"0",
    b"1e999",
    b"nan",
    b"999999999999",
    b"\xff" * 4,
    b"\x7f" * 8,
    struct.pack("<I", 2**31),
    struct.pack("<Q", 10**12),
    b"\n" * 3,
    b"../../etc/passwd",
]
CHANGES = st.lists(
    st.tuples(st.floats(0, 1), st.integers(0, 8), st.sampled_from(HOSTILE) | st.binary(max_size=8)),
    min_size=1,
    max_size=4,
)


def changed(data: bytes, changes) -> bytes:
    """`data` with bytes at some places (fractions of its length) replaced by others."""
    for place, removed, inserted in changes:
        at = int(place * len(data))
        data = data[:at] + inserted + data[at + removed :]
    return data


@pytest.mark.parametrize("target", sorted(fuzzing.TARGETS.keys() - {"score", "store", "model"}))
def test_no_reader_does_anything_but_read_or_refuse(target):
    seeds = fuzzing.seeds(target)

    @settings(max_examples=40, deadline=None, derandomize=True, database=None)
    @given(st.sampled_from(seeds), CHANGES)
    def check(seed, changes):
        fuzzing.guarded(fuzzing.TARGETS[target], changed(seed, changes))

    check()


@pytest.mark.parametrize("target", ["score", "store", "model"])
def test_score_and_store_do_nothing_but_their_work_or_refuse(target):
    draw = random.Random(0)  # noqa: S311  no secret
    for seed in fuzzing.seeds(target) * 3:
        change = (draw.random(), draw.randrange(8), draw.choice(HOSTILE))
        fuzzing.guarded(fuzzing.TARGETS[target], changed(seed, [change]))


ANNOUNCED = {
    "off": b"OFF\n1000000000000 1000000000000 0\n0 0 0\n",
    "ply": b"ply\nformat binary_little_endian 1.0\nelement vertex 1000000000000\n"
    b"property float x\nproperty float y\nproperty float z\nend_header\n\0\0\0\0",
    "pcd": b"FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS 1000000000000\nDATA binary\n\0\0\0\0",
    "stl": b"\0" * 80 + struct.pack("<I", 2**32 - 1) + b"\0" * 50,
    "pts": b"1000000000000\n0 0 0\n",
}


@pytest.mark.parametrize("target", ANNOUNCED)
def test_a_header_that_announces_a_million_million_takes_no_memory(target):
    fuzzing.guarded(fuzzing.TARGETS[target], ANNOUNCED[target])


def test_las_of_a_version_that_is_none_is_refused(tmp_path):
    """Before, laspy made room for the points that its header announced: 15 GB."""
    seed = fuzzing.seeds("las")[0]
    (tmp_path / "a.las").write_bytes(seed[:24] + b"\x03\x02" + seed[26:] + bytes(200))
    with pytest.raises(InputError, match=r"LAS version 3\.2"):
        read_surface(tmp_path / "a.las")


def test_a_target_that_takes_too_long_or_grows_is_found(monkeypatch):
    monkeypatch.setattr(fuzzing, "SECONDS", -1)
    with pytest.raises(fuzzing.Finding, match="s for 2 bytes"):
        fuzzing.guarded(lambda _: None, b"ab")
    monkeypatch.undo()
    monkeypatch.setattr(fuzzing, "MEGABYTES", -1)
    with pytest.raises(fuzzing.Finding, match="MB more than at the start"):
        fuzzing.guarded(lambda _: None, b"ab")


def test_a_change_is_small_or_grows_to_a_million_bytes() -> None:
    """At most four pieces of at most 16 bytes each; one time in ten some of it is repeated."""
    draw = random.Random(0)  # noqa: S311  no secret
    data = bytes(range(100))
    lengths = []
    for _ in range(200):
        made = fuzzing.changed(data, draw)
        assert made != data
        lengths.append(len(made))
    large = [length for length in lengths if length > 200]
    assert all(100 - 4 * 8 <= length <= 100 + 4 * 16 for length in lengths if length <= 200)
    assert all(fuzzing.LARGE - 100 < length < fuzzing.LARGE + 200 for length in large)
    assert 10 <= len(large) <= 30


def test_an_input_without_a_byte_is_changed_too() -> None:
    draw = random.Random(0)  # noqa: S311  no secret
    assert {len(fuzzing.changed(b"", draw)) for _ in range(20)} - {0}


def test_inputs_that_nothing_guides_are_counted_with_what_they_find(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Ten seconds pass between two rounds, so half a minute has two, and each target its turns."""
    taken: list[bytes] = []

    def refuses(_: bytes) -> None:
        raise ValueError("no")

    now = itertools.count(0, 10)
    clock = SimpleNamespace(monotonic=lambda: next(now), process_time=time.process_time)
    monkeypatch.setattr(fuzzing, "time", clock)
    monkeypatch.setattr(fuzzing, "TARGETS", {"takes": taken.append, "refuses": refuses})
    monkeypatch.setattr(fuzzing, "seeds", lambda name: [name.encode()])
    monkeypatch.setattr(fuzzing, "changed", lambda data, _: data + b"!")
    monkeypatch.setattr(fuzzing.tempfile, "mkdtemp", lambda: tmp_path)
    assert fuzzing.unguided(0.5, seed=0) == 2
    assert taken == [b"takes!"] * 2
    assert (tmp_path / "finding.refuses").read_bytes() == b"refuses!"
    said = capsys.readouterr().out.splitlines()
    assert said[:2] == [f"refuses: ValueError: no ({tmp_path}/finding.refuses)"] * 2
    assert said[2].startswith("takes         2 inputs, at most 0.0")
    assert said[4].startswith("4 inputs, 2 findings, ")


@pytest.mark.parametrize("findings", [0, 3])
def test_the_status_says_whether_there_is_a_finding(
    findings: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(logging, "disable", lambda _: None)
    asked: list[tuple[float, int]] = []

    def unguided(minutes: float, seed: int) -> int:
        asked.append((minutes, seed))
        return findings

    monkeypatch.setattr(fuzzing, "unguided", unguided)
    ended = CliRunner().invoke(fuzzing.main, ["all", "--minutes", "0.5", "--seed", "7"])
    assert ended.exit_code == bool(findings)
    assert asked == [(0.5, 7)]


def test_a_target_is_fed_by_atheris_from_its_seeds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Atheris, which need not be there, gets all that it is told, and the target its inputs."""
    monkeypatch.setattr(logging, "disable", lambda _: None)
    monkeypatch.setattr(sys, "argv", ["fuzzing", "obj"])
    watched: list[str] = []
    told: list[str] = []
    fed: list[bytes] = []

    def setup(arguments: list[str], run: Callable[[bytes], None]) -> None:
        told.extend(arguments)
        run(b"an input")

    atheris: Any = SimpleNamespace(
        instrument_func=lambda function: watched.append(function.__module__),
        Setup=setup,
        Fuzz=lambda: fed.append(b"the end"),
    )
    monkeypatch.setitem(sys.modules, "atheris", atheris)
    monkeypatch.setitem(fuzzing.TARGETS, "obj", fed.append)
    asked = ["obj", "--runs", "9", "--seconds", "5", "--out", str(tmp_path)]
    assert CliRunner().invoke(fuzzing.main, asked).exit_code == 0
    assert fed == [b"an input", b"the end"]
    assert "parapoint.files.reading" in watched
    assert {name.split(".")[0] for name in watched} == {
        "parapoint",
        "benchmarks",
        "trimesh",
        "laspy",
    }
    assert told[0] == "fuzzing"
    assert {"-runs=9", "-seed=1", "-max_len=4096", "-max_total_time=5"} < set(told)
    assert told[-2:] == [f"-artifact_prefix={tmp_path}/obj-", str(tmp_path / "obj")]
    kept = [path.read_bytes() for path in sorted((tmp_path / "obj").iterdir())]
    assert kept == fuzzing.seeds("obj")


def test_without_atheris_it_is_said_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "atheris", None)
    ended = CliRunner().invoke(fuzzing.main, ["obj"])
    assert isinstance(ended.exception, InputError)
    assert "pip install -e '.[fuzz]'" in str(ended.exception)


@pytest.mark.parametrize("target", [name for name in fuzzing.TARGETS if f".{name}" in FORMATS])
def test_the_fuzzer_starts_with_files_that_can_be_read(target: str, tmp_path: Path) -> None:
    """A square of four corners; of STL the triangles have their own, or share them."""
    for number, content in enumerate(fuzzing.seeds(target)):
        path = tmp_path / f"{number}.{target}"
        path.write_bytes(content)
        surface = read_surface(path)
        found = surface.vertices if isinstance(surface, Mesh) else surface.points
        assert len(found) in {4, 6}
