import dataclasses
import itertools
import json
import pickle
from importlib import resources
from types import SimpleNamespace

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from matplotlib.colors import to_hex, to_rgba
from matplotlib.text import Text
from PIL import Image as Images
from pypdf import PdfReader
from pypdf.generic import StreamObject

from parapoint.surfaces.parameterization import Parameterization, TracePoint
from parapoint.surfaces.preparation import CUT
from reports import contents as contents_module
from reports.contents import ANGLE, AREA, FLIPPED_OFF_SEAM, ISOMETRIC, SEAM, contents
from reports.labels import Label
from reports.pictures import curves as curves_module
from reports.pictures import figures, galleries, plots
from reports.pictures.curves import BINS, curves_of
from reports.pictures.figures import draw, drawings, write
from reports.pictures.galleries import leading
from reports.pictures.names import ARTIST_PICTURES, CURVES, map_file, model_file
from reports.pictures.printing import few_colours, on_white
from reports.pictures.style import (
    DARK_INK,
    DARK_PAPER,
    STYLE,
    darken,
    figure,
    look,
    plain_log,
    put,
    wrapped,
)

from ..conftest import HAND, NEFERTITI, Writer, ball, flat, lonlat, sheet


@pytest.fixture
def suite(results):
    return contents(results)[0]


def texts(made):
    return [text.get_text() for text in made.findobj(Text)]


def test_every_figure_is_written_with_a_caption(reported):
    folder = reported / "report" / "figures" / "paper"
    suite = contents(reported)[0]
    names = [one.name for one in drawings(suite, folder)]
    assert names[:3] == ["models", "disks", "clouds"]
    assert len(names) == len(set(names))
    names.remove("seams")  # no map is cut, so that there is nothing to see
    assert not (folder / "seams.png").exists()
    for name in names:
        assert (folder / f"{name}.pdf").read_bytes().startswith(b"%PDF")
        assert (folder / f"{name}.png").stat().st_size > 1000
    captions = (folder / "captions.md").read_text()
    assert all(f"## {name}\n" in captions for name in names)


def test_figures_are_drawn_again_only_when_something_changed(suite, tmp_path, monkeypatch):
    kept = [one for one in drawings(suite, tmp_path) if one.name in {"pareto", "losses"}]
    monkeypatch.setattr(figures, "drawings", lambda *_: kept)
    written = []
    monkeypatch.setattr(
        figures, "write", lambda *given: (written.append(given[-1].name), write(*given))
    )
    draw(suite, tmp_path, tmp_path, 1)
    draw(suite, tmp_path, tmp_path, 1)
    assert written == ["pareto", "losses"]
    kept[0] = dataclasses.replace(kept[0], rows=kept[0].rows[:-1])
    draw(suite, tmp_path, tmp_path, 1)
    assert written == ["pareto", "losses", "pareto"]


def test_a_large_report_has_no_figure_for_each_model_and_those_of_before_go(
    results, tmp_path, monkeypatch
):
    small = contents(results)[0]
    assert not small.is_large
    monkeypatch.setattr(contents_module, "SHEETS", len(small.cases))
    assert not contents(results)[0].is_large
    monkeypatch.setattr(contents_module, "SHEETS", len(small.cases) - 1)
    large = contents(results)[0]
    assert large.is_large
    (gone, *_) = [one for one in drawings(small, tmp_path) if one.name.startswith("maps-")]
    assert gone.name not in [one.name for one in drawings(large, tmp_path)]
    kept = [one for one in drawings(large, tmp_path) if one.name == "pareto"]
    empty = dataclasses.replace(gone, name="maps-empty", figure=lambda: None)
    before = [gone, empty, *kept]
    monkeypatch.setattr(figures, "drawings", lambda given, _: before if given is small else kept)
    draw(small, tmp_path, tmp_path, 1)
    assert (tmp_path / f"{gone.name}.png").exists()
    draw(large, tmp_path, tmp_path, 1)
    names = sorted(file.name for file in tmp_path.glob("*.p*"))
    assert names == ["pareto-dark.png", "pareto.pdf", "pareto.png"]


def test_a_figure_that_has_nothing_to_show_any_more_goes(tmp_path):
    for made, count in ((figure(1, 1), 3), (None, 0), (None, 0)):
        drawing = figures.Drawing("a", "T", "", (), lambda made=made: made)
        write(tmp_path, False, drawing)
        assert len(list(tmp_path.iterdir())) == count


@pytest.mark.parametrize(
    ("name", "coarse", "width"),
    [("pareto", False, 80), ("pareto", True, 56), ("maps-x", False, 56), ("heat-x", False, 56)],
)
def test_sheets_of_pictures_and_large_reports_are_coarser(tmp_path, name, coarse, width):
    write(tmp_path, coarse, figures.Drawing(name, "T", "", (), lambda: figure(2, 1)))
    with Images.open(tmp_path / f"{name}.png") as image:
        assert image.size == (width, width // 2)  # at 40 points an inch, or 28


def test_the_same_results_give_the_same_bytes(suite, tmp_path):
    made = next(one for one in drawings(suite, tmp_path) if one.name == "pareto")
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        write(tmp_path / name, False, made)
    for kind in ("pdf", "png"):
        one, two = ((tmp_path / name / f"pareto.{kind}").read_bytes() for name in ("one", "two"))
        assert one == two


def test_the_leading_parameters_are_those_of_most_models_and_of_slim_the_isometric():
    isometric = {"energy": "symmetric_dirichlet"}
    known = {
        "conformal": ("slim", {"energy": "conformal", "iterations": 50}, "ab"),
        "one": ("slim", isometric | {"iterations": 1}, "ab"),
        "twenty": ("slim", isometric | {"iterations": 20}, "ab"),
        "few": ("parapoint", {"iterations": 50}, "a"),
        "most": ("parapoint", {}, "ab"),
    }
    made = SimpleNamespace(
        cases=["a", "b"],
        methods=[
            Label(method, json.dumps(params), method, "", short)
            for short, (method, params, _) in known.items()
        ],
        shown=lambda case, label: "a row" if case in known[label.short][2] else None,
    )
    assert leading(made, "slim").short == "twenty"
    assert leading(made, "parapoint").short == "most"
    assert leading(made, "lscm") is None


def test_the_supplements_figure_shows_slim_isometric_beside_parapoint(suite, tmp_path):
    assert leading(suite, "slim").short == "SLIM symmetric Dirichlet"
    found = texts(galleries.disks(suite, tmp_path, suite.cases[:2]))
    assert "SLIM: UV" in found
    assert "ParaPoint: view 2" in found
    assert not any(NEFERTITI in text for text in found)
    assert "no picture" in found  # none was drawn here


def test_the_closed_models_figure_says_what_cut_it_and_why_a_map_is_missing(suite, tmp_path):
    found = texts(galleries.cut_model(suite, NEFERTITI, tmp_path))
    assert "skipped" in found
    assert any(text.startswith("(c) ParaPoint") for text in found)
    assert not any("hand-made" in text for text in found)  # nefertiti has no map of its own


def shown_pictures(monkeypatch):
    """The boxes and pictures that the galleries' figures put, as they do."""
    found = []
    monkeypatch.setattr(galleries, "put", lambda _, box, picture: found.append((box, picture)))
    return found


@pytest.mark.parametrize(
    ("case", "artist", "heads"),
    [
        (HAND, False, ["(b) SLIM, uncut", "(c) ParaPoint, learned seam"]),
        (HAND, True, ["(c) SLIM, uncut", "(d) ParaPoint, learned seam"]),
        (f"{HAND}@drawn", False, ["(b) SLIM, drawn seam"]),
    ],
)
def test_a_cut_is_named_and_shown_from_its_side(tmp_path, monkeypatch, case, artist, heads):
    writer = Writer(tmp_path)
    with writer.store.writing():
        for method in ("slim", "parapoint"):
            writer.cell(case, sheet(3), method, {}, result=flat(sheet(3)))
    for kind in ARTIST_PICTURES if artist else ():
        (tmp_path / model_file(case, kind)).touch()
    found = shown_pictures(monkeypatch)
    said = texts(galleries.cut_model(contents(tmp_path)[0], case, tmp_path))
    assert set(heads) <= set(said)
    assert ("(b) hand-made: the artist's map" in said) == artist
    kinds = [picture.name.split(".")[-2] for _, picture in found]
    view = "checker-2" if case.endswith("@drawn") else "checker-1"  # a drawn seam is behind
    assert kinds == ["mesh-1", *ARTIST_PICTURES * artist, view, "layout", view, "layout"]


@pytest.mark.parametrize(("preprocessing", "cut"), [("", "uncut"), (CUT, "automatic cut")])
def test_a_missing_map_is_told_to_be_cut_where_others_are(tmp_path, preprocessing, cut):
    writer = Writer(tmp_path)
    with writer.store.writing():
        for method in ("slim", "parapoint"):
            writer.cell(HAND, None, method, {}, status="failed")
        writer.cell(HAND, None, "lscm", {}, status="failed", preprocessing=preprocessing)
    said = texts(galleries.cut_model(contents(tmp_path)[0], HAND, tmp_path))
    assert {f"(b) SLIM, {cut}", "(c) ParaPoint, learned seam"} <= set(said)


def test_values_that_are_not_finite_or_not_known_are_not_printed(suite):
    row, *_ = suite.rows
    assert galleries.values_text(suite, row).startswith("angle 0.1930   area ")
    suite.measured[ANGLE] = np.inf
    assert galleries.values_text(suite, row) == "no finite values"
    assert galleries.values_text(suite, dataclasses.replace(row, id="another")) == ""


def test_convergence_draws_the_quality_along_the_way(suite, tmp_path):
    made = plots.convergence(suite, tmp_path, suite.cases, ANGLE)
    panel = next(place for place in made.axes if place.get_title() == HAND)
    lines = {line.get_label(): line for line in panel.get_lines()}
    seconds, angles = lines["SLIM symmetric Dirichlet"].get_data()
    np.testing.assert_allclose(seconds, [0.1, 1.1, 2.1])
    assert (np.diff(angles) < 0).all()
    row = suite.shown(HAND, suite.methods[0])
    measured = suite.measured.set_index("id").loc[row.id, "angle_difference_mean"]
    assert angles[-1] == pytest.approx(measured)


def test_convergence_draws_each_seed_and_no_cell_that_failed(tmp_path):
    writer = Writer(tmp_path)
    with writer.store.writing():
        writer.cell(HAND, sheet(), "slim", {}, status="timeout", seed=3)
        for seed in range(3):
            writer.cell(HAND, sheet(), "slim", {}, result=flat(sheet(), seed / 8), seed=seed)
    suite = contents(tmp_path)[0]
    (panel,) = plots.convergence(suite, tmp_path, [HAND], ANGLE).axes
    of_rows = suite.measured.set_index("seed")[ANGLE]
    ends = [line.get_ydata()[-1] for line in panel.get_lines()]
    np.testing.assert_allclose(ends, of_rows[[0, 1, 2]])
    assert len(set(ends)) == 3
    assert len({line.get_color() for line in panel.get_lines()}) == 1


def test_flips_on_the_way_are_percents_of_the_faces_that_span_no_seam(tmp_path):
    whole = ball()
    good = lonlat(whole).uv
    folded = good * [1, np.nan]
    folded[:, 1] = np.abs(good[:, 1])  # the southern half lies on the northern one
    trace = tuple(TracePoint(k, 1.0 + k, {}, uv) for k, uv in enumerate((folded, good)))
    writer = Writer(tmp_path)
    with writer.store.writing():
        writer.cell(HAND, whole, "slim", {}, result=Parameterization(good, whole.faces, trace))
    suite = contents(tmp_path)[0]
    (panel,) = plots.convergence(suite, tmp_path, [HAND], FLIPPED_OFF_SEAM).axes
    (line,) = panel.get_lines()
    first, last = line.get_ydata()
    assert last == 0  # the faces at the date line, turned over, span it
    assert 45 < first < 55


def test_a_state_on_the_way_that_cannot_be_measured_is_passed_over(tmp_path):
    mesh = sheet(3)
    uv = flat(mesh).uv
    way = (uv, np.full_like(uv, np.nan), uv)
    trace = tuple(TracePoint(k, 1.0 + k, {}, one) for k, one in enumerate(way))
    writer = Writer(tmp_path)
    with writer.store.writing():
        result = dataclasses.replace(flat(mesh), trace=trace)
        row = writer.cell(HAND, mesh, "slim", {}, result=result)
    assert curves_of(contents(tmp_path)[0], row, tmp_path).way[:, 0].tolist() == [1.0, 3.0]


def test_losses_are_those_of_the_trace(suite):
    made = plots.losses(suite, suite.cases)
    assert [place.get_title() for place in made.axes] == [HAND, "mannequin-devil"]
    lines = {line.get_label(): line for line in made.axes[0].get_lines()}
    np.testing.assert_allclose(lines["total"].get_ydata(), [1, 1 / 2, 1 / 3])


def test_a_loss_that_is_not_positive_is_not_drawn(tmp_path):
    mesh = sheet(3)
    trace = tuple(TracePoint(k, 1.0 + k, {"total": 1.0, "cycle": 0.5 * k - 0.5}) for k in range(3))
    writer = Writer(tmp_path)
    with writer.store.writing():
        result = dataclasses.replace(flat(mesh), trace=trace)
        writer.cell(HAND, mesh, "parapoint", {}, result=result)
    (panel,) = plots.losses(contents(tmp_path)[0], [HAND]).axes
    drawn = {line.get_label(): line.get_xydata().tolist() for line in panel.get_lines()}
    assert drawn["cycle"] == [[2, 0.5]]
    assert len(drawn["total"]) == 3


def test_a_trace_of_one_point_has_no_losses(tmp_path):
    mesh = sheet(3)
    writer = Writer(tmp_path)
    with writer.store.writing():
        result = dataclasses.replace(flat(mesh), trace=flat(mesh).trace[:1])
        writer.cell(HAND, mesh, "parapoint", {}, result=result)
    assert plots.losses(contents(tmp_path)[0], [HAND]) is None


def test_singular_values_of_an_isometry_peak_at_one(tmp_path):
    mesh = sheet()
    plane = type(mesh)(mesh.vertices * [1, 1, 0], mesh.faces)
    writer = Writer(tmp_path)
    with writer.store.writing():
        writer.cell(HAND, plane, "lscm", {}, result=flat(plane))
    suite = contents(tmp_path)[0]
    shares = curves_of(suite, suite.rows[0], tmp_path).shares
    np.testing.assert_allclose(shares.sum(axis=1), 1)
    for share in shares:
        assert share.max() == pytest.approx(1)
        assert abs(BINS[share.argmax()]) < 0.2
    line = plots.singular_values(suite, tmp_path, [HAND]).axes[0].get_lines()[0]
    assert abs(line.get_xdata()[line.get_ydata().argmax()]) < 0.2


def test_what_lies_beside_the_pictures_is_not_measured_again(reported, monkeypatch):
    pictures = reported / "report" / "figures" / "paper" / "pictures"
    suite = contents(reported)[0]
    rows = [row for row in suite.rows if row.status == "ok"]
    measured = [curves_of(suite, row, pictures / "none") for row in rows]
    monkeypatch.setattr(curves_module, "Map", None)
    for row, known in zip(rows, measured, strict=True):
        for one, other in zip(curves_of(suite, row, pictures), known, strict=True):
            np.testing.assert_array_equal(one, other)
    for metric in plots.WAY:
        assert plots.convergence(suite, pictures, suite.cases, metric) is not None
    assert plots.singular_values(suite, pictures, suite.cases) is not None


@pytest.mark.parametrize(
    "kept", ["", "[]", "{}", '{"way": 1, "shares": []}', '{"way": [], "shares": [[1]]}']
)
def test_what_is_no_curve_is_measured(suite, tmp_path, kept):
    row = suite.shown(HAND, suite.methods[0])
    (tmp_path / map_file(row, CURVES)).write_text(kept)
    found = curves_of(suite, row, tmp_path)
    assert len(found.way) == 3
    assert found.shares.shape == (2, len(BINS) - 1)


def test_every_method_looks_different(suite):
    looks = [tuple(map(str, look(suite, label).values())) for label in suite.methods]
    assert len(set(looks)) == len(looks)


def test_figures_without_anything_to_show_are_left_out(tmp_path):
    writer = Writer(tmp_path)
    with writer.store.writing():
        writer.cell(HAND, sheet(), "lscm", {}, status="failed", reason="it broke")
    suite = contents(tmp_path)[0]
    (tmp_path / "f").mkdir()
    drawn = draw(suite, tmp_path / "p", tmp_path / "f", 1)
    assert [one.name for one in drawn] == ["models"]


def test_a_figure_can_be_made_in_another_process(suite, tmp_path):
    for name in ("pareto", "losses"):
        made = next(one for one in drawings(suite, tmp_path) if one.name == name)
        other = pickle.loads(pickle.dumps(made))  # noqa: S301 (our own bytes)
        assert other.figure() is not None


def test_log_axes_have_plain_numbers():
    made = figure(2, 2)
    place = made.add_subplot()
    place.plot([1, 2], [0.004, 30])
    place.set_yscale("log")
    plain_log(place.yaxis)
    made.canvas.draw()
    shown = [label.get_text() for label in place.yaxis.get_ticklabels()]
    assert "0.01" in shown
    assert not any("10^" in text for text in shown)


def test_small_numbers_along_an_axis_have_an_exponent():
    made = figure(2, 2)
    place = made.add_subplot()
    place.plot([1, 2], [1e-6, 1e-3])
    place.set_yscale("log")
    plain_log(place.yaxis)
    shown = {label.get_text() for label in place.yaxis.get_ticklabels()}
    assert {"1e-6", "1e-5", "0.0001", "0.001"} <= shown


def test_a_figure_of_many_models_goes_over_several_pages(suite):
    cases = [f"case {number}" for number in range(10)]
    made = figures.paged(suite, "n", "T", "C", make=len, cases=cases, size=4)
    assert [one.name for one in made] == ["n", "n-2", "n-3"]
    assert [one.title for one in made] == ["T, 1 of 3", "T, 2 of 3", "T, 3 of 3"]
    assert [one.figure() for one in made] == [4, 4, 2]
    (one,) = figures.paged(suite, "n", "T", "C", make=len, cases=suite.cases[:1], size=4)
    assert one.title == "T"
    assert {row.case for row in one.rows} == {HAND}


def test_no_figure_has_more_models_than_a_page_holds(tmp_path):
    writer = Writer(tmp_path)
    with writer.store.writing():
        for number in range(13):
            for rate in (0.1, 0.2):
                writer.cell(f"m{number}", sheet(3), "parapoint", {"lr": rate}, status="failed")
    suite = contents(tmp_path)[0]

    figures_of = {}
    for count in (3, 4, 7, 8, 9, 10, 12, 13):
        rows = tuple(row for row in suite.rows if int(row.case[1:]) < count)
        part = dataclasses.replace(suite, rows=rows, is_large=False)
        figures_of[count] = {one.name for one in drawings(part, tmp_path)}
    for name, most in (
        *(("models", 12), ("disks", 7), ("clouds", 7), ("ablation", 3)),
        *(("pareto", 9), ("seams", 9), ("convergence", 9), ("losses", 9), ("singular-values", 9)),
    ):
        assert name in figures_of[most]
        assert f"{name}-2" not in figures_of[most]
        assert f"{name}-2" in figures_of[most + 1]


def test_a_model_without_a_map_has_no_sheet_and_the_next_one_has(tmp_path):
    writer = Writer(tmp_path)
    with writer.store.writing():
        writer.cell("one", sheet(3), "lscm", {}, status="failed")
        writer.cell("two", sheet(3), "lscm", {}, result=flat(sheet(3)))
    names = [one.name for one in drawings(contents(tmp_path)[0], tmp_path)]
    sheets = [name for name in names if name.startswith(("maps-", "heat-"))]
    assert sheets == ["maps-two", "heat-two"]


def test_an_ablation_shows_every_variant_and_the_paper_s_four(tmp_path, monkeypatch):
    writer = Writer(tmp_path)
    changes = ({}, {"distortion": "isometric"}, {"branches": "2d"}, {"branches": "3d"})
    base = {"distortion": None, "branches": None, "distortion_weight": None}
    with writer.store.writing():
        for case in ("cube_x", "eight_x"):
            for change in changes:
                writer.cell(case, sheet(), "parapoint", base | change, result=flat(sheet()))
    suite = contents(tmp_path)[0]
    names = [one.name for one in drawings(suite, tmp_path)]
    assert {"ablation", "ablation-paper"} <= set(names)
    found = texts(galleries.ablation(suite, tmp_path, suite.cases))
    assert {"unchanged", "isometric", "2D→3D→2D alone"} <= set(found)
    four = texts(galleries.ablation_of_the_paper(suite, tmp_path))
    assert "(a) cube, conformal" in four
    assert "(d) eight, 3D→2D→3D alone" in four
    found = shown_pictures(monkeypatch)
    made = galleries.ablation_of_the_paper(suite, tmp_path)
    kinds = [picture.name.split(".")[-2] for _, picture in found]
    assert kinds == ["layout", "checker-1"] * 4
    boxes = np.array([box for box, _ in found])
    low, high = boxes[:, :2], boxes[:, :2] + boxes[:, 2:]
    assert low.min() >= 0
    assert high.max() <= 1 + 1e-9
    width, height = made.get_size_inches()
    np.testing.assert_allclose(boxes[:, 2] * width, boxes[:, 3] * height)  # each a square
    for one, other in itertools.combinations(range(8), 2):
        assert ((high[one] <= low[other] + 1e-9) | (high[other] <= low[one] + 1e-9)).any()
    assert (low[::2, 1] > low[1::2, 1]).all()  # the layout above the texture
    x, y = np.array([text.get_position() for text in made.texts]).T
    np.testing.assert_allclose(x, (low + high)[::2, 0] / 2)  # each name in the middle of its pair,
    assert 0 < y.min() <= y.max() < low[:, 1].min() < 0.5 / height  # a little below it


def test_an_ablation_without_the_paper_s_cells_lacks_its_figure(suite, tmp_path):
    assert galleries.ablation_of_the_paper(suite, tmp_path) is None
    assert not any(one.name.startswith("ablation") for one in drawings(suite, tmp_path))


def test_pictures_in_a_pdf_are_jpegs_of_their_size(tmp_path):
    shades = np.linspace(0, 255, 64 * 64).reshape(64, 64)
    smooth = np.stack([shades, shades[::-1], shades.T], axis=2).astype(np.uint8)
    made = figure(1, 1)
    made.add_axes((0, 0, 1, 1)).imshow(smooth)
    write(tmp_path, False, figures.Drawing("a", "A <title>", "", (), lambda: made))
    document = PdfReader(tmp_path / "a.pdf")
    (picture,) = document.pages[0].images
    assert picture.name.endswith(".jpg")
    assert document.metadata.title == "A <title>"
    # From the last row on; a colour stands for four pixels.
    np.testing.assert_allclose(np.asarray(picture.image.convert("RGB"))[::-1], smooth, atol=20)


def test_a_picture_that_is_not_whole_is_printed_on_white():
    clear, half, grey = [0, 0, 0, 0], [0, 0, 0, 128], [90, 90, 90, 255]
    shown = on_white(np.array([[clear, half, grey]], dtype=np.uint8))
    np.testing.assert_allclose(shown, [[[255] * 3, [127] * 3, [90] * 3]], atol=1)
    for other in (shown, shown[..., 0]):
        assert on_white(other) is other


def test_only_the_pictures_of_a_pdf_are_not_deflated(tmp_path):
    made = figure(2, 1)
    made.add_axes((0, 0, 0.5, 1)).imshow(np.arange(48, dtype=np.uint8).reshape(4, 4, 3))
    made.text(0.6, 0.5, "words")
    write(tmp_path, False, figures.Drawing("a", "T", "", (), lambda: made))
    document = PdfReader(tmp_path / "a.pdf")
    assert "words" in document.pages[0].extract_text()
    number = len(document.xref[0])
    streams = [document.get_object(at) for at in range(1, number)]
    kinds = [one["/Filter"] for one in streams if isinstance(one, StreamObject)]
    assert kinds.count("/DCTDecode") == 1
    assert set(kinds) == {"/DCTDecode", "/FlateDecode"}


def test_all_pictures_of_a_figure_stand_in_one_pair_of_axes(tmp_path):
    Images.new("RGB", (20, 10), "red").save(tmp_path / "wide.webp")
    with mpl.rc_context(STYLE):
        made = figure(4, 2)
        for x in (0, 0.5):
            put(made, (x, 0, 0.5, 1), tmp_path / "wide.webp")  # two inches square
        put(made, (0, 0, 1, 1), "why not")
    (place,) = made.axes
    assert place.get_position().bounds == (0, 0, 1, 1)
    assert [shown.get_extent() for shown in place.images] == [
        [0, 0.5, 0.25, 0.75],
        [0.5, 1, 0.25, 0.75],
    ]
    (said,) = [text for text in texts(made) if text]
    assert said == "why not"


def test_names_are_parted_at_spaces_hyphens_and_underscores():
    for width in (14, 15, 22):
        assert wrapped("SLIM symmetric Dirichlet", width) == "SLIM symmetric\nDirichlet"
    assert wrapped("nefertiti-lowres_odedstein", 20) == "nefertiti-lowres_\nodedstein"
    assert wrapped("beetle", 3) == "beetle"


def trade_off_table(**rows):
    """Area, angle and fitness by method."""
    return pd.DataFrame.from_dict(rows, orient="index", columns=[AREA, ANGLE, "fit"])


def test_no_broken_map_is_on_the_pareto_front(suite):
    points = trade_off_table(
        broken=(0.0, 0.0, False), a=(0.1, 0.5, True), b=(0.2, 0.2, True), worse=(0.3, 0.3, True),
        equal=(0.1, 0.6, True), c=(0.9, 0.1, True),
        wide=(1.5, 0.1, True),
    )  # fmt: skip
    front = plots.pareto_front(suite, points)
    np.testing.assert_array_equal(front, [[0.1, 0.5], [0.2, 0.2], [0.9, 0.1]])
    assert len(plots.pareto_front(suite, points[~points["fit"]])) == 0


def test_a_map_that_may_not_be_ranked_is_not_fit(tmp_path):
    writer = Writer(tmp_path)
    with writer.store.writing():
        for method in ("lscm", "arap", "slim"):
            writer.cell(HAND, sheet(), method, {}, result=flat(sheet(), 0.3))
    made = contents(tmp_path)[0]
    for short, grade, angle in (("LSCM", "collapsed", 0.3), ("ARAP", "broken", 1e-9)):
        made.means.loc[made.means["label"] == short, ["grade", ANGLE, AREA]] = grade, angle, 0.0
    found = plots.trade_offs(made, HAND)
    assert found["fit"].to_dict() == {"LSCM": False, "ARAP": False, "SLIM": True}
    # An isometry has 0, which has no logarithm.
    assert found.loc["ARAP", [AREA, ANGLE]].tolist() == [1e-3, 1e-4]


def test_energies_stand_against_seams(tmp_path):
    writer = Writer(tmp_path)
    with writer.store.writing():
        for method in ("lscm", "arap"):
            writer.cell(HAND, sheet(), method, {}, result=flat(sheet(), 0.3))
    made = contents(tmp_path)[0]
    made.means.loc[made.means["label"] == "LSCM", [SEAM, ISOMETRIC]] = 1.5, 1e9
    (place,) = plots.seams(made, made.cases).axes
    drawn = {line.get_label(): tuple(line.get_xydata()[0]) for line in place.lines}
    assert drawn["LSCM"] == (1.5, 20)  # as the caption says
    assert drawn["ARAP"][0] == 0
    assert 4 <= drawn["ARAP"][1] < plots.MOST_ENERGY


@pytest.mark.parametrize(("sizes", "lines"), [(4, 0), (5, 1)])
def test_a_power_law_goes_through_five_sizes_or_more(tmp_path, sizes, lines):
    writer = Writer(tmp_path)
    with writer.store.writing():
        for count in range(3, 3 + sizes):
            for twin in "ab":  # two models of each size
                mesh = sheet(count)
                given = {"result": flat(mesh), "seconds": 2.0 * len(mesh.faces)}
                writer.cell(f"{twin}{count}", mesh, "lscm", {}, **given)
    (place,) = plots.cost(contents(tmp_path)[0]).axes
    drawn = [line for line in place.lines if line.get_linestyle() != "None"]
    assert len(drawn) == lines
    for line in drawn:  # two seconds a face, from the smallest to the largest
        np.testing.assert_allclose(line.get_xydata(), [[8, 16], [72, 144]])


def test_all_panels_end_alike(suite):
    places = plots.pareto(suite, suite.cases).axes
    assert len(places) > 1
    assert len({(*place.get_xlim(), *place.get_ylim()) for place in places}) == 1


def test_a_figure_for_dark_pages_turns_greys_and_keeps_colours(tmp_path):
    made = figure(2, 1)
    place = made.add_axes((0.2, 0.2, 0.7, 0.7))
    place.plot([0, 1], [0, 1], color="#0072B2")
    text = place.set_title("black", color="black")
    shown = place.scatter([0, 1], [0, 1], c=[[1, 1, 1, 1], [0, 0, 0, 0.5]])
    darken(made)
    assert to_hex(text.get_color()) == DARK_INK
    assert to_hex(place.get_facecolor()) == DARK_PAPER  # white
    assert place.lines[0].get_color() in {"#0072B2", to_rgba("#0072B2")}
    np.testing.assert_allclose(shown.get_facecolor()[0], to_rgba(DARK_PAPER))
    np.testing.assert_allclose(shown.get_facecolor()[1], to_rgba(DARK_INK, 0.5))
    with mpl.rc_context(STYLE):
        few_colours(made, DARK_PAPER, tmp_path / "dark.png")
    with Images.open(tmp_path / "dark.png") as image:
        assert image.convert("RGB").getpixel((0, 0)) == (0x1D, 0x20, 0x25)


def test_the_palette_of_dark_figures_is_that_of_the_style_sheet():
    style = resources.files("reports.page").joinpath("templates/style.css").read_text()
    dark = style[style.index("prefers-color-scheme: dark") :]
    assert f"--card: {DARK_PAPER}" in dark
    assert f"--tile: {DARK_PAPER}" in dark
    assert f"--ink: {DARK_INK}" in dark


def test_the_caption_of_the_clouds_says_what_was_done(tmp_path):
    writer = Writer(tmp_path)
    with writer.store.writing():
        for case, points in (("one", 500), ("two", 2048)):
            params = {"preset": "paper", "points": 2048, "iterations": 300}
            report = {"points": points}
            writer.cell(case, sheet(), "parapoint", params, result=flat(sheet()), report=report)
        few = {"report": {"points": 7}, "status": "failed"}  # of which no map is drawn
        writer.cell("three", None, "parapoint", params, **few)
        writer.cell("one", sheet(), "nuvo", {"points": 9000}, result=flat(sheet()))
    made = contents(tmp_path)[0]
    assert figures.points_told(made) == "500 to 2,048; paper, 300 iterations"
    (caption,) = [one.caption for one in drawings(made, tmp_path) if one.name == "clouds"]
    assert "500 to 2,048" in caption
    assert "10,000" not in caption
    assert "cloud itself" not in caption  # there is none here
