"""What the columns of a cloud mean: places, row numbers, colours, and the rest."""

import struct

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from parapoint.files.attributes import colours_of
from parapoint.files.reading import read_surface

PLACES = np.array([[0.25, 1.5, 2], [3, 4.5, 5], [6, 7.25, 8.5], [9, 1, 2.5]])


def read(path, text):
    path.write_text(text)
    return read_surface(path)


@pytest.mark.parametrize("first", [0, 1, 101, -3])
@pytest.mark.parametrize("step", [1, 2])
def test_a_first_column_numbers_the_rows_if_it_counts_up_by_one(tmp_path, first, step):
    rows = "\n".join(f"{first + step * k} {x} {y} {z}" for k, (x, y, z) in enumerate(PLACES))
    cloud = read(tmp_path / "a.xyz", rows)
    if step == 1:
        assert_array_equal(cloud.points, PLACES)
    else:
        assert_array_equal(cloud.points[:, 1:], PLACES[:, :2])
        assert_array_equal(cloud.attributes["intensity"], PLACES[:, 2])


@pytest.mark.parametrize(
    ("last", "names"),
    [("0 1 0 7 8", ["column5", "intensity"]), ("0 1 0 7", ["intensity"]), ("0 1 0", [])],
)
def test_columns_that_not_all_lines_have_are_left_out(tmp_path, last, names):
    cloud = read(tmp_path / "a.xyz", f"0 0 0 3 4\n1 0 0.5 5 6\n{last}\n")
    assert_array_equal(cloud.points, [[0, 0, 0], [1, 0, 0.5], [0, 1, 0]])
    assert sorted(cloud.attributes) == names


@pytest.mark.parametrize(("most", "are_colours"), [(255, True), (256, False), (60_000, False)])
def test_three_whole_columns_are_colours_up_to_255(tmp_path, most, are_colours):
    values = np.array([[0, 1, 2], [3, 4, most], [5, 6, 7], [8, 9, 10]])
    rows = "\n".join(
        " ".join(map(str, [*place, *colour]))
        for place, colour in zip(PLACES.tolist(), values.tolist(), strict=True)
    )
    attributes = read(tmp_path / "a.xyz", rows).attributes
    if are_colours:
        assert_array_equal(attributes["colours"], values)
        assert attributes["colours"].dtype == np.uint8
    else:
        assert sorted(attributes) == ["column4", "column5", "column6"]


@pytest.mark.parametrize(("alpha", "count"), [(0, 3), (200, 4)])
def test_alpha_that_is_0_throughout_means_opaque(tmp_path, alpha, count):
    head = "VERSION .7\nFIELDS x y z rgba\nSIZE 4 4 4 4\nTYPE F F F U\nCOUNT 1 1 1 1\n"
    head += "WIDTH 4\nHEIGHT 1\nPOINTS 4\nDATA binary\n"
    body = b"".join(struct.pack("<3f4B", *place, 30, 20, 10, alpha) for place in PLACES)
    (tmp_path / "a.pcd").write_bytes(head.encode() + body)
    cloud = read_surface(tmp_path / "a.pcd")
    assert_array_equal(cloud.attributes["colours"], [[10, 20, 30, 200][:count]] * 4)


@pytest.mark.parametrize("kind", [0, 3, 6])
def test_laz_is_read_in_every_kind_of_point(tmp_path, kind):
    import laspy

    version = "1.4" if kind > 5 else "1.2"
    cloud = laspy.create(point_format=kind, file_version=version)
    points = np.round(np.random.default_rng(0).random((500, 3)), 2)
    cloud.xyz = points
    cloud.write(str(tmp_path / "a.laz"))
    assert (tmp_path / "a.laz").read_bytes()[104] == 128 + kind
    assert_allclose(read_surface(tmp_path / "a.laz").points, points, atol=1e-9)


def test_fractions_above_1_are_no_colours():
    assert colours_of(np.array([[0.5, 1.0, 0.0]])) is not None
    assert colours_of(np.array([[2.0, 255.0, 0.0]])).dtype == np.uint8
    assert colours_of(np.array([[0.5, 1.5, 0.0]])) is None
    assert colours_of(np.array([[2.0, 70_000.0, 0.0]])) is None


EIGHT = np.array([[9, 0, 8], [255, 7, 0], [1, 2, 3], [40, 50, 60]])
UPWARD = np.array([[0, 0, 1]] * 4)
WHITE = np.full((4, 3), 255)


@pytest.mark.parametrize(
    ("parts", "held", "warns"),
    [
        ((EIGHT, 255), {"colours": EIGHT}, False),
        ((EIGHT / 255, 1), {"colours": EIGHT / 255}, False),
        ((257 * EIGHT, 65535), {"colours": 257 * EIGHT}, False),
        ((UPWARD, EIGHT, 255), {"normals": UPWARD, "colours": EIGHT}, False),
        ((EIGHT, 255, UPWARD), {"normals": UPWARD, "colours": EIGHT}, False),
        ((0.5, UPWARD), {"intensity": 0.5, "normals": UPWARD}, False),
        ((300, EIGHT), {"intensity": 300, "colours": EIGHT}, False),
        ((7, EIGHT), {"intensity": 7, "colours": EIGHT}, True),
        ((7, WHITE), {"intensity": 7, "colours": WHITE}, True),
    ],
)
def test_four_columns_are_a_colour_and_its_alpha_or_an_intensity_and_a_colour(
    tmp_path, caplog, parts, held, warns
) -> None:
    """The last column tells; where it does not, a warning does; in PTS the rule does."""
    columns = [part if np.ndim(part) else np.full((4, 1), part) for part in parts]
    rows = np.hstack([PLACES, *columns]).tolist()
    text = "".join(" ".join(map(repr, row)) + "\n" for row in rows)
    cloud = read(tmp_path / "a.xyz", text)
    found = cloud.attributes | ({} if cloud.normals is None else {"normals": cloud.normals})
    assert found.keys() == held.keys()
    for name, values in held.items():
        assert_allclose(found[name], np.broadcast_to(values, found[name].shape), rtol=1e-12)
    assert ("taken as intensity" in caplog.text) == warns
    caplog.clear()
    assert "intensity" in read(tmp_path / "a.pts", text).attributes
    assert not caplog.text
