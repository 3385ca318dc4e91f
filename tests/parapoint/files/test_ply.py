"""Lists in PLY files: found whatever their lengths, and refused where they run out of the file."""

import struct

import numpy as np
import pytest

from parapoint.errors import InputError
from parapoint.files import ply

VERTICES = "element vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
CORNERS = struct.pack("<12f", *(0, 0, 0), *(1, 0, 0), *(1, 1, 0), *(0, 1, 0))
FACES = "property uchar group\nproperty list short int vertex_indices\nproperty double area\n"


def binary(count: int, body: bytes, faces: str = FACES) -> bytes:
    elements = f"{VERTICES}element face {count}\n{faces}"
    head = f"ply\nformat binary_little_endian 1.0\n{elements}end_header\n"
    return head.encode() + CORNERS + body


def text(lines: list[str]) -> bytes:
    corners = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n"
    head = f"ply\nformat ascii 1.0\n{VERTICES}element face {len(lines)}\n{FACES}end_header\n"
    return (head + corners + "\n".join(lines)).encode()


def packed(row: list[int]) -> bytes:
    return struct.pack(f"<Bh{len(row)}id", 7, len(row), *row, 0.5)


@pytest.mark.parametrize("block", [1, 7, 1 << 20])
@pytest.mark.parametrize("longest", [3, 4, 9])
def test_lists_of_all_lengths_are_found(block, longest, monkeypatch):
    # Blocks end inside rows, between them, or behind them all; lists of one length take no blocks.
    monkeypatch.setattr(ply, "BLOCK", block)
    draw = np.random.default_rng(longest)
    rows = [draw.integers(0, 4, size=draw.integers(3, longest + 1)).tolist() for _ in range(40)]
    corners = [corner for row in rows for corner in row]
    written = [" ".join(map(str, [7, len(row), *row, 0.5])) for row in rows]
    for data in binary(40, b"".join(map(packed, rows))), text(written):
        content = ply.ply(data)
        assert content.sizes.tolist() == [len(row) for row in rows]
        assert content.corners.tolist() == corners
        faces = ply.opened(data)[1][1].columns
        assert faces["vertex_indices"].values.tolist() == corners
        assert set(faces["area"].values) == {0.5}
        assert set(faces["group"].values) == {7}


@pytest.mark.parametrize("block", [1, 1 << 20])
@pytest.mark.parametrize(
    ("data", "word"),
    [
        (binary(2, packed([0, 1, 2]) + packed([0, 1, 2, 3])[:-1]), "ends early"),
        (binary(2, packed([0, 1, 2]) + packed([0, 1, 2])[:-1]), "ends early"),
        (binary(3, packed([0, 1, 2]) + packed([0, 1, 2, 3])), "ends early"),
        (binary(3, packed([0, 1, 2]) * 2), "ends early"),
        (binary(10**15, packed([0, 1, 2])), "ends early"),
        (binary(2, packed([0, 1, 2]) + struct.pack("<Bh", 7, -3) + bytes(30)), "negative length"),
        (binary(2, struct.pack("<Bh", 7, -1) + bytes(60)), "negative length"),
        (
            binary(1, b"\xff" * 8 + bytes(9), "property list ulong int vertex_indices\n"),
            "ends early",
        ),
        (text(["7 3 0 1 2 .5", "7 -3 0 1 2 .5"]), "negative length"),
        (text(["7 3 0 1 2 .5", "7 nan 0 1 2 .5"]), "ends early"),
        (text(["7 3 0 1 2 .5", "7 1e300 0 1 2 .5"]), "ends early"),
        (text(["7 3 0 1 2 .5", "7 4 0 1 2 .5"]), "ends early"),
    ],
)
def test_lists_that_run_out_of_the_file_are_refused(data, word, block, monkeypatch):
    monkeypatch.setattr(ply, "BLOCK", block)
    for read in ply.ply, ply.opened:
        with pytest.raises(InputError, match=word):
            read(data)


def test_empty_lists_may_be_all_that_is_left_of_a_file() -> None:
    data = binary(2, b"\0\0", "property list uchar int vertex_indices\n")
    column = ply.opened(data)[1][1].columns["vertex_indices"]
    assert column.sizes is not None
    assert column.sizes.tolist() == [0, 0]
    assert len(column.values) == 0
