"""A short, unguided form of `python -m benchmarks.checks.fuzzing`, and what the long one has
found."""

from __future__ import annotations

import random
import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.checks import fuzzing
from parapoint.errors import InputError
from parapoint.files.reading import read_surface

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
