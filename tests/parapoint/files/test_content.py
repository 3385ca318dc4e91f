"""Pieces that readers share, by hand."""

import io
import zipfile

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from parapoint.errors import InputError
from parapoint.files import decoding
from parapoint.files.attributes import colours_of, unit_colours
from parapoint.files.content import numbers, strip_triangles, word_counts
from parapoint.files.decoding import check_decoded, opened_archive


@pytest.mark.parametrize(
    ("text", "counts"),
    [
        (b"1 2 3\n4\n", [3, 1]),
        (b"  1\t2 \r\n\n x", [2, 0, 1]),
        (b"abc", [1]),
        (b"a b", [2]),
        (b"\n", [0, 0]),
    ],
)
def test_words_are_counted_line_by_line(text, counts):
    assert_array_equal(word_counts(text, len(counts)), counts)


def test_a_text_without_lines_has_no_counts():
    assert word_counts(b"", 0).shape == (0,)
    assert_array_equal(word_counts(b"a\nb c", 2), [1, 2])
    assert_array_equal(word_counts(b"a", 3), [1, 0, 0])


def test_numbers_are_read_and_a_word_that_is_none_is_named():
    assert_array_equal(numbers(b"1 2.5\n-3e2", np.float64), [1, 2.5, -300])
    assert_array_equal(numbers(b"7 8", np.int64), [7, 8])
    assert numbers(b" \n", np.float64).shape == (0,)
    with pytest.raises(ValueError, match="'x'"):
        numbers(b"1 x", np.float64)


@pytest.mark.parametrize(
    ("sizes", "corners", "triangles"),
    [
        ([3], [0, 1, 2], [[0, 1, 2]]),
        ([5], [0, 1, 2, 3, 4], [[0, 1, 2], [2, 1, 3], [2, 3, 4]]),
        ([3, 4], [0, 1, 2, 5, 6, 7, 8], [[0, 1, 2], [5, 6, 7], [7, 6, 8]]),
        # A strip within a list ends at -1, and the next begins with a triangle as it is.
        ([8], [0, 1, 2, 3, -1, 5, 6, 7], [[0, 1, 2], [2, 1, 3], [5, 6, 7]]),
        ([7], [0, 1, 2, -1, 5, 6, 7], [[0, 1, 2], [5, 6, 7]]),
        # A vertex given twice steers, and turns the parity.
        ([5], [0, 1, 2, 2, 3], [[0, 1, 2]]),
        ([6], [0, 1, 2, 2, 3, 4], [[0, 1, 2], [3, 2, 4]]),
        ([2], [0, 1], []),
    ],
)
def test_strips_are_triangles_of_which_every_second_is_turned(sizes, corners, triangles):
    found = strip_triangles(np.array(sizes), np.array(corners))
    assert_array_equal(found.reshape(-1, 3), np.array(triangles).reshape(-1, 3))


@pytest.mark.parametrize(
    ("values", "kind"),
    [
        (np.array([[0, 0, 255]], dtype=np.uint16), np.uint8),
        (np.array([[0, 0, 256]], dtype=np.uint16), np.uint16),
        (np.array([[0, 0, 255]], dtype=np.uint8), np.uint8),
        (np.array([[0.0, 0.5, 1.0]]), np.float64),
        (np.array([[0.0, 1.0, 255.0]]), np.uint8),
        (np.array([[0.0, 1.0, 65535.0]]), np.uint16),
        (np.array([[0, 0, 65535]], dtype=np.int64), np.uint16),
        (np.array([[0, 0, 65536]], dtype=np.int64), None),
        (np.array([[0.0, 1.0, 65536.0]]), None),
        (np.array([[0.0, 1.5, 2.0]]), None),
        (np.array([[-1, 0, 0]], dtype=np.int64), None),
        (np.array([[np.nan, np.nan, np.nan]]), None),
        (np.array([[0.0, 0.5, 1.001]]), None),
    ],
)
def test_colours_are_known_by_their_range(values, kind):
    found = colours_of(values)
    if kind is None:
        assert found is None
    else:
        assert found.dtype == kind
        assert_array_equal(found, values)


def test_fractions_that_rounding_has_made_too_large_are_1():
    found = colours_of(np.array([[0.0, 0.5, 1.000001]], dtype=np.float32))
    assert found.tolist() == [[0.0, 0.5, 1.0]]


@pytest.mark.parametrize("missing", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("most", [1.0, 255.0, 65535.0])
def test_colours_of_some_points_are_fractions(most, missing):
    values = np.array([[0.0, 0.0, most], [missing] * 3, [most, 0.0, 0.0]])
    found = colours_of(values)
    assert found.dtype.kind == "f"
    np.testing.assert_array_equal(found, np.where(np.isfinite(values), values, np.nan) / most)
    assert colours_of(values + [[0, 0.5, 0]] * 3 if most > 1 else values - 1) is None


def test_colours_as_fractions():
    assert_array_equal(unit_colours(np.array([0, 255], dtype=np.uint8)), [0, 1])
    assert_array_equal(unit_colours(np.array([0, 65535], dtype=np.uint16)), [0, 1])
    assert_array_equal(unit_colours(np.array([0.25, 1.0])), np.array([0.25, 1], dtype=np.float32))


def test_what_a_file_decodes_to_is_bounded_by_what_is_allowed_and_by_its_size():
    allowed = decoding._allowed.get()
    check_decoded(int(allowed), 1)
    most = decoding.DECODED_TIMES * int(allowed)
    check_decoded(most, int(allowed))
    with pytest.raises(InputError, match="has 1 bytes that decode to"):
        check_decoded(int(allowed) + 1, 1)
    with pytest.raises(InputError, match=r"decode to 3,000,000,000,001, .* allow --memory 3001 GB"):
        check_decoded(3 * 10**12 + 1, 10)


def test_an_archive_is_read_from_its_start_wherever_the_stream_stands():
    stream = io.BytesIO()
    np.savez(stream, a=np.arange(3), b=np.zeros(0))
    with opened_archive(stream) as archive:
        assert {name: archive[name].tolist() for name in archive.files} == {"a": [0, 1, 2], "b": []}


def test_an_archive_that_decodes_to_too_much_is_refused_before_an_array_is_read():
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a.npy", b"0" * (decoding.DECODED_LEAST // 2))
        archive.writestr("b.npy", b"0" * (decoding.DECODED_LEAST // 2 + 1))
    with pytest.raises(InputError, match=f"decode to {decoding.DECODED_LEAST + 1:,}"):
        opened_archive(stream)


def test_what_is_no_archive_is_not_opened():
    for content in (b"", b"\x93NUMPY\x01\x00", b"\x80\x04N.", b"PK\x03\x04"):
        with pytest.raises(zipfile.BadZipFile):
            opened_archive(io.BytesIO(content))
