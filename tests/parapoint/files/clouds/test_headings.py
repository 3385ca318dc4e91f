"""Text clouds with headings: which columns are x, y and z, and what is refused or warned of."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from parapoint.errors import InputError
from parapoint.files.clouds.xyz import xyz
from parapoint.files.reading import read_surface
from parapoint.surfaces.surface import PointCloud

NORTH_FIRST = [[101.5, 200.25, 30.5], [102.5, 201.25, 31.5]]
POINTS = [[1.5, 2.25, -3], [4, 5.5, 6]]


def cloud_of(folder: Path, text: str | bytes, ending: str = ".xyz") -> PointCloud:
    """The cloud in a file with this text."""
    path = folder / f"a{ending}"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    surface = read_surface(path)
    assert isinstance(surface, PointCloud)
    return surface


@pytest.mark.parametrize(
    "heading",
    [
        "Point,Northing,Easting,Elevation,Description",
        "P,N,E,Z,D",
        '"Pt No","North [m]","East [m]","Height [m]","Code"',
        "# written by hand, twice\n% P;N;E;H;D",
        "; PNEZD (comma delimited)",
        "Name Hochwert Rechtswert Höhe Art",
        "id\tlat\tlon\talt\tkind",
    ],
)
@pytest.mark.parametrize(
    "rows",
    [
        "1001,200.25,101.5,30.5,GRND\n1005,201.25,102.5,31.5,big tree\n",
        "1001;200,25;101,5;30,5;GRND\n;201,25;102,5;31,5;\n",
        'A7|200.25|101.5|30.5|"wet, soft"\n"A 9"|201.25|102.5|31.5|"5,5"\n',
        "7,200.25,101.5,30.5,a|b; c\n,201.25,102.5,31.5,d,e\n9,1,,2,f\n",
        "1001 200.25 101.5 30.5 GRND\n1005 201.25 102.5 31.5 big tree\n",
        "a b\t200.25\t101.5\t30.5\t\nc\t201.25\t102.5\t31.5\tGRND\n",
    ],
)
def test_named_columns_among_words(tmp_path: Path, heading: str, rows: str) -> None:
    """Surveyors' tables, whatever parts their cells."""
    assert_allclose(cloud_of(tmp_path, f"{heading}\n{rows}").points, NORTH_FIRST)


@pytest.mark.parametrize(
    "heading",
    [
        *("i x y z", "# i x y z", "// i, x, y, z", "%i x y z", "; i x y z", "##  I\tX\tY\tZ"),
        *("# Foo 2.1\n# i x y z\n# May 2024", "Scan of 2024\ni x y z", "# Columns: i x y z"),
        *("# fields i x y z", "OID,POINT_X,POINT_Y,POINT_Z", "%time,field.x,field.y,field.z"),
        *('"n","Points:0","Points:1","Points:2"', "Pt;E;N;Z", "id,x_coord,y_coord,z_coord"),
        *("Point ID,X,Y,Z", "Point ID X Y Z", "# Point ID X Y Z", ",x,y,z", ";x;y;z", "\tx\ty\tz"),
        *("t px py pz", "id ost nord höhe", "t x_m y_m z_m", "id,X (m),Y (m),Z (m)"),
    ],
)
@pytest.mark.parametrize("end", ["\n", "\r", "\r\n"])
def test_headings_of_many_programs(
    tmp_path: Path, heading: str, end: str, caplog: pytest.LogCaptureFixture
) -> None:
    """In front of, behind and among other comments, over rows that no rule would read alike."""
    text = heading + "\n9 1.5 2.25 -3\n7 4 5.5 6\n"
    assert_allclose(cloud_of(tmp_path, text.replace("\n", end)).points, POINTS)
    assert not caplog.text
    text = heading + "\n9,1.5,2.25,-3\n7,4,5.5,6\n"
    assert_allclose(cloud_of(tmp_path, text.replace("\n", end)).points, POINTS)


@pytest.mark.parametrize("first", ['"1" {} {} {}\n"2" {} {} {}', "a {} {} {}\nb {} {} {}"])
def test_names_of_rows_have_none_in_the_tables_of_r(tmp_path: Path, first: str) -> None:
    """R writes a name less than there are columns."""
    text = '"x" "y" "z"\n' + first.format(*POINTS[0], *POINTS[1])
    assert_allclose(cloud_of(tmp_path, text + '\n"3" 1 2 3\n').points[:2], POINTS)


def test_columns_of_one_place_are_not_mixed(tmp_path: Path) -> None:
    """The first kind of names counts."""
    text = "Easting,Northing,X,Y,Z,Height\n1,2,3,4,5.5,6\n"
    cloud = cloud_of(tmp_path, text)
    assert_allclose(cloud.points, [[3, 4, 5.5]])
    assert list(cloud.attributes) == ["easting", "northing", "height"]


@pytest.mark.parametrize("mark", [",", ";", "|", "\t", " , "])
def test_empty_cells_are_missing_values(
    tmp_path: Path, mark: str, caplog: pytest.LogCaptureFixture
) -> None:
    """A row without a coordinate is left out; all others stay in their columns."""
    rows = ["id,x,y,z,i", ",1,2,3,8", "7,1.5,,4,8", "7,4,5,6.5,", ",,,,", "9,,2,3,4", ",4,4,4,"]
    cloud = cloud_of(tmp_path, "\n".join(rows).replace(",", mark))
    assert_array_equal(cloud.points, [[1, 2, 3], [4, 5, 6.5], [4, 4, 4]])
    assert_array_equal(cloud.attributes["intensity"], [8, np.nan, np.nan])
    blank = mark == "\t"  # the row without any cell is a blank line
    assert f"{3 - blank} of {6 - blank} points dropped" in caplog.text


@pytest.mark.parametrize("missing", ["NA", "na", "N/A", "null", "None", "#N/A", "nan"])
@pytest.mark.parametrize("mark", [",", ";", "\t"])
def test_words_for_missing_values(tmp_path: Path, missing: str, mark: str) -> None:
    """As R, Excel, SQL and Python write them, in coordinates and in other columns."""
    rows = ["x,y,z,i", f"1.5,2.25,-3,{missing}", f"9,{missing},9,9", "4,5.5,6,7"]
    cloud = cloud_of(tmp_path, "\n".join(rows).replace(",", mark))
    assert_array_equal(cloud.points, POINTS)
    assert_array_equal(cloud.attributes["intensity"], [np.nan, 7])
    assert cloud.dropped == 1


@pytest.mark.parametrize("text", ["NA NA NA\n{}", "{}NA NA NA\n", "NA 1 2\n{}", "1 NA 2 3\n{}"])
def test_rows_without_a_heading_may_lack_values(tmp_path: Path, text: str) -> None:
    cloud = cloud_of(tmp_path, text.format("1.5 2.25 -3\n4 5.5 6\n"))
    assert_array_equal(cloud.points, POINTS)
    assert cloud.dropped == 1


@pytest.mark.parametrize("title", ["none", "NA", "# null 2024", "site None"])
def test_a_title_is_no_missing_value(tmp_path: Path, title: str) -> None:
    assert_array_equal(cloud_of(tmp_path, f"{title}\n1.5 2.25 -3\n4 5.5 6\n").points, POINTS)


@pytest.mark.parametrize("head", ["{}\n", "# by hand\n{}\n", "{}\nx y z\n"])
def test_the_count_of_a_text_is_held_to(
    tmp_path: Path, head: str, caplog: pytest.LogCaptureFixture
) -> None:
    """Fewer points than it says are a file that was cut off; more are read, and said."""
    rows = "1.5 2.25 -3\n4 5.5 6\n"
    assert_array_equal(cloud_of(tmp_path, head.format(2) + rows).points, POINTS)
    assert "announced" not in caplog.text
    assert_array_equal(cloud_of(tmp_path, head.format(1) + rows).points, POINTS)
    assert "points announced: 1; points there: 2" in caplog.text
    with pytest.raises(InputError, match="ends early: 3 points are announced, 2 are there"):
        cloud_of(tmp_path, head.format(3) + rows)


def test_columns_that_are_empty_throughout_are_none(tmp_path: Path) -> None:
    """As spreadsheets write them behind the last one."""
    for text in ("1.5,2.25,-3,,\n4,5.5,6,,\n", "x,y,z,,\n1.5,2.25,-3,,\n4,5.5,6,,\n"):
        cloud = cloud_of(tmp_path, text)
        assert_allclose(cloud.points, POINTS)
        assert not cloud.attributes


@pytest.mark.parametrize(
    ("heading", "width"),
    [("a b c", 3), ("foo", 3), ("X m Y m Z m", 3), ("Scan of 2024 north", 5), ("# r s t v", 4)],
)
def test_headings_that_tell_nothing_are_warned_of(
    tmp_path: Path, heading: str, width: int, caplog: pytest.LogCaptureFixture
) -> None:
    """The first three columns are taken, and a line says so."""
    rows = "\n".join(" ".join(map(str, [*row, 9, 8][:width])) for row in POINTS)
    assert_allclose(cloud_of(tmp_path, f"{heading}\n{rows}\n").points, POINTS)
    assert caplog.text.count("1, 2 and 3 are taken as x, y and z") == 1


@pytest.mark.parametrize("comment", ["# exported by Foo", "# a, b and c", "// surface with x y z"])
def test_comments_are_no_headings(
    tmp_path: Path, comment: str, caplog: pytest.LogCaptureFixture
) -> None:
    """Whatever they speak of."""
    assert_allclose(cloud_of(tmp_path, f"{comment}\n1 2 3 9\n4 5 6.5 8\n").points[:, 2], [3, 6.5])
    assert not caplog.text


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("a b c d\n1 2 3 4\n", r"does not say which columns are x, y and z \(a b c d\)"),
        ("# nr, r, h, hh\n1,2,3,4\n", "does not say which columns are x, y and z"),
        ("x y z x\n1 2 3 4\n", "does not say which columns are x, y and z"),
        ("point id x y z class code\n1 2 3 4 5\n", "7 names over 5 columns; give each column a"),
        ("id x y z i\n1 2 3 4.5 6\n2 3 4 5\n", "more and with fewer columns"),
        ("id x y z i\n" + "1 2 3 4.5 6\n" * 60_000 + "3 4 5 6\n" * 2, "more and with fewer"),
        ("A0 1 2 3\n", "has 'A0' in line 1, column 1, where x should be a number; if the columns"),
        ("# by hand\n\nz y x\n1 2 3\n4 5 A0\n", "has 'A0' in line 5, column 3, where x should be"),
        ("1 2 3\n4 5\n", "has only 2 columns in line 2; x, y or z is missing"),
        ("2\nmethane\nC 1 2 3\nH 4 5 6\n", "has 'C' in line 3, column 1"),
        ("2\nmethane\n6 .1 2 3\n1 4 5 A0\n", "has 'A0' in line 4, column 4, where z should be"),
        ("<html>\n<body>\n", "has no point: none of its lines holds three numbers"),
        ("1\u00a0234,5;2;3\n", "no-break spaces between digits"),
        ("1 234,5;2;3\n4;5,5;6\n", r"has blanks inside numbers \(1 234.5\)"),
    ],
)
def test_columns_that_cannot_be_told(tmp_path: Path, text: str, says: str) -> None:
    """One line."""
    with pytest.raises(InputError, match=says) as caught:
        cloud_of(tmp_path, text)
    assert "\n" not in str(caught.value)


def test_other_signs_of_word_processors(tmp_path: Path) -> None:
    """A minus of its own, and spaces that are not plain around numbers."""
    text = "1.5 2.25\u202f \u22123\n4\u00a0 5.5 6\n"
    assert_allclose(cloud_of(tmp_path, text).points, POINTS)


def test_degrees_are_warned_of(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Longitude is x."""
    assert_allclose(cloud_of(tmp_path, "lat lon h\n2 1 3.5\n").points, [[1, 2, 3.5]])
    assert "degrees are no lengths" in caplog.text


@pytest.mark.parametrize("comment", ["", "methane", "energy = -1.5"])
@pytest.mark.parametrize("further", ["", " .1 .2 .3"])
def test_numbers_of_elements_are_no_coordinates(
    tmp_path: Path, comment: str, further: str, caplog: pytest.LogCaptureFixture
) -> None:
    """As chemists write them below a count and a comment."""
    text = f"2\n{comment}\n6 1.5 2.25 -3{further}\n1 4 5.5 6{further}\n"
    assert_allclose(cloud_of(tmp_path, text).points, POINTS)
    assert "atomic numbers" in caplog.text


@pytest.mark.parametrize("ending", [".xyz", ".pts"])
@pytest.mark.parametrize("names", ["X Y Z R G B", "R,G,B,X,Y,Z", "# z red green blue y x"])
def test_named_colours_of_16_bits(tmp_path: Path, ending: str, names: str) -> None:
    """Without names three large whole numbers are no colours."""
    values = {"x": 1.5, "y": 2.25, "z": -3, "r": 65535, "g": 0, "b": 300}
    words = names.lower().replace("#", "").replace(",", " ").split()
    row = " ".join(str(values[word[0]]) for word in words)
    cloud = cloud_of(tmp_path, f"{names}\n{row}\n", ending)
    assert_allclose(cloud.points, POINTS[:1])
    assert_array_equal(cloud.attributes["colours"], [[65535, 0, 300]])


def test_named_columns_keep_their_names(tmp_path: Path) -> None:
    """Normals, colours and the intensity are found by them; no name is used twice."""
    names = "//X Y Z Nx Ny Nz Rf R G B I time time colours"
    row = "1 2 3.5 0 0 2 .5 9 8 7 6 5 4 3"
    cloud = cloud_of(tmp_path, f"{names}\n1\n{row}\n")
    assert_array_equal(cloud.normals, [[0, 0, 2]])
    found = {name: of[0].tolist() for name, of in cloud.attributes.items()}
    assert found == {
        "colours": [9, 8, 7],
        "rf": 0.5,
        "intensity": 6,
        "time": 5,
        "column13": 4,
        "column14": 3,
    }


@pytest.mark.parametrize(
    ("text", "announced", "found"),
    [("1\n1 2 3\n4 5 6\n", 1, 2), ("# a\n1\nx y z\n1 2 3\n2\n1 2 3\n4 5 6\n7 8 9\n", 2, 3)],
)
def test_a_pts_file_of_more_points_than_announced(
    tmp_path: Path, text: str, announced: int, found: int
) -> None:
    """Headings do not count."""
    with pytest.raises(InputError, match=f"{announced} points are announced, {found} are there"):
        cloud_of(tmp_path, text, ".pts")
    cloud_of(tmp_path, text.replace("4 5 6\n", "", 1), ".pts")


@pytest.mark.parametrize("between", [" ", "\t", "\t\t", ",", ", ", ";", " ; ", ",\t", " | "])
@pytest.mark.parametrize("point", [".", ","])
def test_numbers_are_read_as_meant_or_refused(between: str, point: str) -> None:
    """Below every head, and with notes, words or marks behind them."""
    values = np.random.default_rng(5).normal(3, 50, (4, 7)).round(2)
    for width in (3, 4, 6, 7):
        lines = [
            between.join(f"{x:.2f}".replace(".", point) for x in row[:width]) for row in values
        ]
        for head in ("", "# c\n", "4\n", "X Y Z\n", "//X;Y;Z\n", f"x{between}y{between}z\n"):
            for behind in ("", between.strip(" "), " # note", " word", "\tword"):
                text = head + "".join(f"{line}{behind}\n" for line in lines)
                if between == point == ",":
                    with pytest.raises(InputError, match="cannot be told"):
                        xyz(text.encode())
                else:
                    assert_array_equal(xyz(text.encode()).vertices, values[:, :3], text)


@pytest.mark.parametrize("ending", [".xyz", ".txt", ".csv", ".asc", ".CSV"])
def test_a_text_cloud_may_have_any_of_its_endings(tmp_path: Path, ending: str) -> None:
    cloud = cloud_of(tmp_path, "id,x,y,z\n7,1,2,3\n9,4,5,6\n", ending)
    assert_array_equal(cloud.points, [[1, 2, 3], [4, 5, 6]])


@pytest.mark.parametrize("names", ["Rf Gf Bf", "R G B", "red green blue"])
def test_fractions_under_the_names_of_colours_are_colours(tmp_path: Path, names: str) -> None:
    """CloudCompare writes the first."""
    cloud = cloud_of(tmp_path, f"//X Y Z {names}\n1.5 2.25 -3 1 0.5 0\n4 5.5 6 0.25 0 1\n")
    assert_allclose(cloud.attributes["colours"], [[1, 0.5, 0], [0.25, 0, 1]])
