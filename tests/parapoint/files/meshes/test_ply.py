"""PLY files: rows and lists found whatever their lengths, or refused; types; all polygons."""

import struct

import numpy as np
import pytest

from parapoint.errors import InputError
from parapoint.files.content import NO_UV
from parapoint.files.meshes import ply, ply_body
from parapoint.files.meshes.ply import Column, Table
from parapoint.files.writing.ply_rewriting import encoded

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
    monkeypatch.setattr(ply_body, "BLOCK", block)
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
        (text(["7 3 0 1 2 .5", "7 nan 0 1 2 .5"]), "line 17 holds 6 numbers"),
        (text(["7 3 0 1 2 .5", "7 1e300 0 1 2 .5"]), "line 17 holds 6 numbers"),
        (text(["7 3 0 1 2 .5", "7 4 0 1 2 .5"]), "line 17 holds 6 numbers"),
    ],
)
def test_lists_that_run_out_of_the_file_are_refused(data, word, block, monkeypatch):
    monkeypatch.setattr(ply_body, "BLOCK", block)
    for read in ply.ply, ply.opened:
        with pytest.raises(InputError, match=word):
            read(data)


def test_empty_lists_may_be_all_that_is_left_of_a_file() -> None:
    data = binary(2, b"\0\0", "property list uchar int vertex_indices\n")
    column = ply.opened(data)[1][1].columns["vertex_indices"]
    assert column.sizes is not None
    assert column.sizes.tolist() == [0, 0]
    assert len(column.values) == 0


PLACES = "property float x\nproperty float y\nproperty float z\n"
LIST = "property list uchar int vertex_indices\n"
SQUARE = ["0 0 0", "1 0 0", "1 1 0", "0 1 0"]


def ascii_ply(elements: str, rows: list[str], end: str = "\n") -> bytes:
    return (
        f"ply\nformat ascii 1.0\n{elements}end_header\n".replace("\n", end).encode()
        + (end.join(rows) + end).encode()
    )


@pytest.mark.parametrize(
    ("rows", "says"),
    [
        ([row + " 255 0 0" for row in SQUARE], "line 8 holds 6 numbers, .* announces 3"),
        ([*SQUARE[:2], "1 1", "0 0 1 0"], "line 10 holds 2 numbers, .* announces 3"),
        ([*SQUARE[:2], "1 1 0 0", "1 0"], "line 10 holds 4 numbers, .* announces 3"),
        (["0 0 0 1 0 0", "1 1 0 0 1 0"], "line 8 holds 6 numbers"),
        (["", *SQUARE[:2], "", "1 1 0 9", "0 1 0"], "line 12 holds 4 numbers"),
        (["0 0", "1 0", "1 1", "0 1"], "line 8 holds 2 numbers"),
        ([*SQUARE[:3], "0 1"], "line 11 holds 2 numbers"),
        (SQUARE[:3], "ends early: 4 rows are announced, 3 follow"),
        ([*SQUARE, "", "7 7 7"], "holds more than its header announces, from line 13 on"),
    ],
)
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_rows_of_text_are_lines(rows, says, end):
    data = ascii_ply(f"element vertex 4\n{PLACES}", rows, end)
    for read in ply.ply, ply.opened:
        with pytest.raises(InputError, match=says):
            read(data)


def test_rows_of_faces_and_of_unknown_elements_are_lines():
    faces = f"element vertex 4\n{PLACES}element face 2\n{LIST}"
    edges = faces + "element edge 2\nproperty int a\nproperty int b\n"
    good = [*SQUARE, "3 0 1 2", "3 0 2 3"]
    for elements, rows, says in [
        (faces, [*SQUARE, "3 0 1 2 9", "3 0 2 3"], "line 14 holds 5 numbers, .* announces 4"),
        (faces, [*SQUARE, "3 0 1", "2 3 0 2 3"], "line 14 holds 3 numbers"),
        (faces, [row + " 3 0 1" for row in SQUARE] + good[4:], "line 10 holds 6 numbers"),
        (edges, [*good, "0 1 2", "3"], "line 19 holds 3 numbers, .* announces 2"),
        (edges, [*good, "0 1"], "ends early: 2 rows are announced, 1 follow"),
    ]:
        with pytest.raises(InputError, match=says):
            ply.ply(ascii_ply(elements, rows))
    blank = [line for row in [*good, "0 1", "2 3"] for line in (row, " ", "")]
    assert ply.ply(ascii_ply(edges, blank)).sizes.tolist() == [3, 3]


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_lines_of_the_header_end_in_every_way(end, order):
    kind = {"<": "little", ">": "big"}[order]
    head = f"ply\nformat binary_{kind}_endian 1.0\nelement vertex 4\n{PLACES}end_header\n"
    # The first byte of the body may look like the rest of a line end.
    points = np.frombuffer(b"\n" + bytes(range(47)), f"{order}f4").reshape(4, 3)
    read = ply.ply(head.replace("\n", end).encode() + points.tobytes()).vertices
    assert np.array_equal(read, points.astype(float))
    text = ply.ply(ascii_ply(f"element vertex 4\n{PLACES}", SQUARE, end))
    assert text.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]


@pytest.mark.parametrize("name", ["half", "float16"])
def test_half_floats_are_read(name):
    elements = f"element vertex 2\n{PLACES}property {name} q\n"
    text = ascii_ply(elements, ["0 0 0 0.1", "1 1 1 1e9"])
    head = f"ply\nformat binary_little_endian 1.0\n{elements}end_header\n".encode()
    body = b"".join(struct.pack("<3fe", k, k, k, 0.1) for k in range(2))
    with np.errstate(over="ignore"):
        expected = np.array([0.1, 1e9]).astype(np.float16)
    assert np.array_equal(ply.ply(text).attributes["q"], expected)
    assert np.array_equal(ply.ply(head + body).attributes["q"], expected[[0, 0]])


@pytest.mark.parametrize("line", ["property quarter q", "property list uchar quarter q"])
def test_types_that_ply_does_not_know_are_named(line):
    with pytest.raises(InputError, match=f"does not know in its header line '{line}'"):
        ply.ply(ascii_ply(f"element vertex 4\n{PLACES}{line}\n", SQUARE))
    with pytest.raises(InputError, match="is of the format 'text'; known are ascii, binary"):
        ply.ply(b"ply\nformat text 1.0\nend_header\n")


def test_text_numbers_that_do_not_fit_their_type_stay_as_they_are():
    properties = "".join(f"property uchar {name}\n" for name in ("red", "green", "blue", "a", "b"))
    rows = [f"{row} 0.5 1 0 300 7" for row in SQUARE]
    attributes = ply.ply(ascii_ply(f"element vertex 4\n{PLACES}{properties}", rows)).attributes
    assert attributes["colours"].tolist() == [[0.5, 1, 0]] * 4
    assert attributes["a"].tolist() == [300] * 4
    assert attributes["b"].dtype == np.uint8


TRIANGLES = [[0, 1, 2], [0, 2, 3]]
STRIPS = f"element tristrips {{}}\n{LIST}"
FACE = f"element face {{}}\n{LIST}"


@pytest.mark.parametrize(
    ("elements", "rows"),
    [
        (FACE.format(2) + STRIPS.format(0), ["3 0 1 2", "3 0 2 3"]),
        (STRIPS.format(0) + FACE.format(2), ["3 0 1 2", "3 0 2 3"]),
        (FACE.format(0) + STRIPS.format(2), ["3 0 1 2", "3 0 2 3"]),
        (STRIPS.format(2) + FACE.format(0), ["3 0 1 2", "3 0 2 3"]),
        (FACE.format(1) + STRIPS.format(1), ["3 0 1 2", "3 0 2 3"]),
        (STRIPS.format(1) + FACE.format(1), ["3 0 1 2", "3 0 2 3"]),
        (FACE.format(1) + FACE.format(1), ["3 0 1 2", "3 0 2 3"]),
        ("element face 0\nproperty list uchar int ids\n" + FACE.format(2), ["3 0 1 2", "3 0 2 3"]),
    ],
)
def test_polygons_of_all_elements_are_read(elements, rows):
    data = ascii_ply(f"element vertex 4\n{PLACES}{elements}", [*SQUARE, *rows])
    content = ply.ply(data)
    assert content.sizes.tolist() == [3, 3]
    assert content.corners.reshape(-1, 3).tolist() == TRIANGLES


def test_uv_of_faces_stay_beside_a_strip():
    uv = "property list uchar float texcoord\n"
    elements = f"element vertex 4\n{PLACES}{STRIPS.format(1)}element face 1\n{LIST}{uv}"
    data = ascii_ply(elements, [*SQUARE, "3 0 1 2", "3 0 2 3 6 .1 .2 .3 .4 .5 .6"])
    content = ply.ply(data)
    assert content.uv_corners.tolist() == [NO_UV] * 3 + [0, 1, 2]
    assert content.uv.tolist() == [[0.1, 0.2], [0.3, 0.4], [0.5, 0.6]]


@pytest.mark.parametrize("element", ["face", "tristrips"])
@pytest.mark.parametrize(
    ("named", "row"),
    [
        ("list uchar int vertex_indexes", "3 0 1 2"),
        ("list uchar int vertex_id", "3 0 1 2"),
        ("int vertex_indices", "0"),
        ("list uchar float texcoord", "2 .5 .5"),
    ],
)
def test_faces_without_indices_are_refused(element, named, row):
    elements = f"element vertex 4\n{PLACES}element {element} {{}}\nproperty {named}\n"
    says = f"has 1 rows of {element} with {named.split()[-1]}, but without vertex_indices"
    with pytest.raises(InputError, match=says):
        ply.ply(ascii_ply(elements.format(1), [*SQUARE, row]))
    assert len(ply.ply(ascii_ply(elements.format(0), SQUARE)).vertices) == 4


def test_unknown_elements_with_indices_are_told(caplog):
    elements = f"element vertex 4\n{PLACES}element trifans 1\n{LIST}"
    assert not len(ply.ply(ascii_ply(elements, [*SQUARE, "3 0 1 2"])).sizes)
    assert "rows of the unknown element 'trifans' left out: 1" in caplog.text


@pytest.mark.parametrize("number", [2**63 - 1, -(2**63), 2**53 + 1, 7])
def test_whole_numbers_of_64_bits_keep_their_value(number):
    columns = {"x": Column(np.zeros(1)), "id": Column(np.array([number]))}
    kinds = [np.uint64, np.float16, np.int8]
    columns |= {f"{k}": Column(np.array([abs(number) % 128], kind)) for k, kind in enumerate(kinds)}
    ids = Column(np.array([number, 5]), np.array([2]))
    data = encoded([], [Table("vertex", 1, columns | {"ids": ids})])
    (table,) = ply.opened(data)[1]
    assert table.columns["id"].values.tolist() == [number]
    assert table.columns["ids"].values.tolist() == [number, 5]
    for name, column in columns.items():
        assert table.columns[name].values.dtype == column.values.dtype


@pytest.mark.parametrize(
    ("number", "is_told"), [(2**53 - 1, False), (2**53 + 1, True), (-5, False)]
)
@pytest.mark.parametrize("kind", ["int64", "ulong"])
def test_whole_numbers_of_text_that_are_rounded_are_told(number, is_told, kind, caplog):
    elements = f"element vertex 1\n{PLACES}property {kind} id\n"
    ids = ply.ply(ascii_ply(elements, [f"0 0 0 {number}"])).attributes["id"]
    assert (ids.tolist() == [number]) is not is_told
    assert ("from 2^53 on in the text are rounded" in caplog.text) is is_told
