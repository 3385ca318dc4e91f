import numpy as np
import pytest

from parapoint.surfaces.parameterization import Parameterization
from reports.contents import contents
from reports.tables.variants import ablation, cuts

from ..conftest import HAND, NEFERTITI, Writer, ball, flat, lonlat, sheet


def test_cuts_say_who_cut_and_whether_the_map_is_one(results):
    made = cuts(contents(results)[0])
    rows = {(row["case"], row["label"]): row for block in made.blocks for row in block}
    whole = rows[HAND, "SLIM conformal"]
    assert (whole["cut"], whole["bijective"], whole["seam_length"]) == ("none", "yes", 0)
    torn = rows[NEFERTITI, "ParaPoint"]
    assert (torn["cut"], torn["seam_length"]) == ("learned", None)  # no length, and not 0
    assert torn["spanning_fraction"] > 0
    assert torn["bijective"] == "no"  # spanning faces lie over the others
    assert rows[NEFERTITI, "SLIM symmetric Dirichlet"]["done"] == "skipped"


def test_an_ablation_has_variants_of_one_method(tmp_path):
    writer = Writer(tmp_path)
    mesh = sheet()
    with writer.store.writing():
        for distortion in ("conformal", "isometric"):
            params = {"preset": "paper", "distortion": distortion, "points": 64}
            bend = 0.1 if distortion == "conformal" else 0.5
            writer.cell(HAND, mesh, "parapoint", params, result=flat(mesh, bend))
    made = ablation(contents(tmp_path)[0])
    one, two = made.blocks[0]
    assert one["angle_difference_mean"] < two["angle_difference_mean"]
    assert [cell.mark for cell in made.cells[0][0]][2] == "best"
    assert "ParaPoint isometric: paper, 64 points, isometric" in made.notes[0]


@pytest.mark.parametrize("table", [ablation, cuts])
def test_a_broken_map_has_no_mark_and_a_collapsed_one_marks_of_angles_alone(tmp_path, table):
    """The two have the lowest angles and areas of all."""
    writer, mesh = Writer(tmp_path), sheet()
    with writer.store.writing():
        for number, distortion in enumerate(("broken", "collapsed", "sound", "worse")):
            result = flat(mesh, 0.1 + 0.1 * number)
            params, cut = {"distortion": distortion}, "automatic cut to a disk"
            writer.cell(HAND, mesh, "parapoint", params, result=result, preprocessing=cut)
    suite = contents(tmp_path)[0]
    for grade in ("broken", "collapsed"):
        suite.records[HAND, f"ParaPoint {grade}"]["grade"] = grade
    made = table(suite)
    keys = [column.key for column in made.columns]
    angle, energy = keys.index("angle_difference_mean"), keys.index("symmetric_dirichlet")
    marks = {
        str(row["label"]).removeprefix("ParaPoint "): (cells[angle].mark, cells[energy].mark)
        for row, cells in zip(made.blocks[0], made.cells[0], strict=True)
    }
    assert marks["broken"] == ("", "")
    assert marks["collapsed"] == ("best", "")
    assert marks["sound"] == ("second", "best")
    assert marks["worse"] == ("", "second")
    assert "Broken, so not ranked: ParaPoint broken on hand_1_i_f5000." in made.notes
    assert any(note.startswith("Collapsed, so ranked by angles alone") for note in made.notes)


def test_an_automatic_cut_is_said_and_measured(tmp_path):
    """A ball cut along the date line, its corners there apart."""
    mesh = ball()
    uv = lonlat(mesh).uv[mesh.faces]
    low = uv[..., 0] < 0
    across = np.ptp(uv[..., 0], axis=1) > np.pi
    uv[across[:, None] & low] += [2 * np.pi, 0]
    rows, corners = np.unique(uv.reshape(-1, 2), axis=0, return_inverse=True)
    result = Parameterization(rows, corners.reshape(-1, 3))
    writer = Writer(tmp_path)
    with writer.store.writing():
        writer.cell(
            NEFERTITI, mesh, "lscm", {}, result=result, preprocessing="automatic cut to a disk"
        )
    (row,) = cuts(contents(tmp_path)[0]).blocks[0]
    assert row["cut"] == "automatic"
    # From pole to pole at least, over the root of the sphere's area.
    assert row["seam_length"] > np.pi / np.sqrt(4 * np.pi) * 0.9
