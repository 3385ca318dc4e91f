import math

import numpy as np
import pytest

from parapoint import console
from parapoint.errors import InputError
from reports.__main__ import main
from reports.history import pages
from reports.history.comparison import Comparison, welch
from reports.history.pages import said
from reports.history.tables import alone, ended, moved, summary

from ..conftest import DEVIL, HAND, HOSTILE, SLIM, Writer, flat, sheet

MACHINE = {"commit": "0123456789abcdef", "cpu": "A", "cores": 2, "gpu": [], "python": "3.11"}


def folder(path, *cells, machine=MACHINE):
    """Cells of (case, method, bends of the seeds' maps, what else is given)."""
    writer = Writer(path)
    mesh = sheet()
    with writer.store.writing():
        writer.store.add_run(machine)
        for case, method, bends, given in cells:
            for seed, bend in enumerate(bends):
                params = SLIM if method == "slim" else {}
                result = None if bend is None else flat(mesh, bend)
                writer.cell(case, mesh, method, params, seed=seed, result=result, **given)
    return path


def compared(tmp_path, before, after, **given):
    return Comparison(
        folder(tmp_path / "before", *before), folder(tmp_path / "after", *after, **given)
    )


def values(found, name):
    return {(m.key[1], m.key[2]): m for m in found.moves if m.name == name}


ANGLE = "angle_difference_mean"


def test_the_same_maps_do_not_move(tmp_path):
    cells = [(HAND, "lscm", [0.1], {}), (HAND, "parapoint", [0.1, 0.2], {})]
    found = compared(tmp_path, cells, cells)
    assert found.moves == found.times == found.changed_maps() == []
    assert moved(found) is ended(found) is alone(found) is None
    assert said(found).startswith("Of 2 cells in both, 0 moved")


def test_a_deterministic_method_may_not_move_at_all_a_seeded_one_within_its_noise(tmp_path):
    before = [
        (HAND, "slim", [0.3], {}),  # deterministic, as it promises
        (HAND, "mine", [0.3, 0.3], {}),  # deterministic, as its seeds tell
        (DEVIL, "mine", [0.3], {}),
        (HAND, "parapoint", [0.30], {}),
        (DEVIL, "parapoint", [0.30], {}),
    ]
    after = [
        (HAND, "slim", [0.3001], {}),
        (HAND, "mine", [0.3001, 0.3001], {}),
        (DEVIL, "mine", [0.2999], {}),
        (HAND, "parapoint", [0.3001], {}),
        (DEVIL, "parapoint", [0.9], {}),
    ]
    found = compared(tmp_path, before, after)
    angles = values(found, ANGLE)
    assert set(angles) == {
        (HAND, "slim"),
        (HAND, "mine"),
        (DEVIL, "mine"),
        (DEVIL, "parapoint"),
    }
    assert angles[HAND, "slim"].verdict == "worse"
    assert angles[DEVIL, "mine"].verdict == "better"
    assert angles[DEVIL, "mine"].noise == 0
    assert angles[DEVIL, "parapoint"].why == "one seed: 5%"
    assert len(found.changed_maps()) == 3
    row = {row["method"]: row for row in summary(found).blocks[0]}["SLIM"]
    assert (row["cells"], row["maps"], row["worse"], row["better"]) == (1, 0, 1, 0)


def test_a_promise_of_one_map_for_one_seed_holds_for_every_method_of_the_registry(tmp_path):
    names = ("mean_value", "automatic+slim", "uvatlas")
    found = compared(
        tmp_path,
        [(HAND, name, [0.3], {}) for name in names],
        [(HAND, name, [0.3001], {}) for name in names],
    )
    assert set(values(found, ANGLE)) == {(HAND, "mean_value"), (HAND, "automatic+slim")}


def test_a_promise_of_one_map_for_one_seed_says_nothing_of_another_seed(tmp_path):
    found = compared(
        tmp_path, [(HAND, "mean_value", [0.3], {})], [(HAND, "mean_value", [None, 0.3001], {})]
    )
    del found.cells[1][found.shared[0]].rows[0]
    assert found.moves == []


def test_the_noise_of_several_seeds_is_welch_s_interval(tmp_path):
    before = [(HAND, "parapoint", [0.1, 0.2, 0.3], {}), (DEVIL, "parapoint", [0.1, 0.11, 0.12], {})]
    after = [(HAND, "parapoint", [0.2, 0.3, 0.4], {}), (DEVIL, "parapoint", [0.3, 0.31, 0.32], {})]
    found = compared(tmp_path, before, after)
    assert set(values(found, ANGLE)) == {(DEVIL, "parapoint")}


def test_welch_by_hand():
    # Equal variances 1 of three each: t of four degrees of freedom, 2.7764, times sqrt(2 / 3).
    width = welch(np.array([1.0, 2, 3]), np.array([5.0, 6, 7]))
    assert width == pytest.approx(2.7764 * math.sqrt(2 / 3), rel=1e-4)
    assert welch(np.ones(2), np.ones(3)) == 0


def test_other_hardware_is_said_and_its_times_and_rounding_are_not_judged(tmp_path):
    before = [(HAND, "slim", [0.3], {"seconds": 1.0})]
    after = [(HAND, "slim", [0.3 + 1e-9], {"seconds": 9.0})]
    found = compared(tmp_path, before, after, machine=MACHINE | {"cpu": "B"})
    assert not found.same_hardware
    assert found.moves == found.times == []
    assert "times are not comparable" in said(found)
    made = summary(found)
    assert any("cpu: A before, B after." in note for note in made.notes)
    assert any("another map" in note for note in made.notes)
    assert "not comparable" in made.columns[-1].title
    assert made.blocks[0][0]["seconds"] == pytest.approx(9.0)


def test_times_on_machines_that_nobody_knows_are_not_judged(tmp_path):
    before, after = ([(HAND, "slim", [0.3], {"seconds": seconds})] for seconds in (1.0, 9.0))
    found = Comparison(
        folder(tmp_path / "before", *before, machine={"cores": 2}),
        folder(tmp_path / "after", *after, machine={"cores": 2}),
    )
    assert found.machines == {}
    assert not found.same_hardware
    assert found.times == []


def test_a_package_that_came_or_went_is_told(tmp_path):
    cells = [(HAND, "slim", [0.3], {})]
    known = [{"numpy": "1", "same": "4", "gone": "3"}, {"numpy": "2", "same": "4", "new": "5"}]
    found = Comparison(
        *(
            folder(tmp_path / str(side), *cells, machine=MACHINE | {"packages": packages})
            for side, packages in enumerate(known)
        )
    )
    assert found.machines == {
        "numpy": ("1", "2"),
        "gone": ("3", "unknown"),
        "new": ("unknown", "5"),
    }
    assert found.same_hardware


def test_times_move_beyond_a_quarter_and_a_tenth_of_a_second(tmp_path):
    def cells(short, long, other):
        return [
            (HAND, "slim", [0.1], {"seconds": short}),
            (HAND, "lscm", [0.1], {"seconds": long}),
            (HAND, "tutte", [0.1], {"seconds": other}),
        ]

    found = compared(tmp_path, cells(0.01, 1.0, 2.0), cells(0.09, 2.0, 2.3))
    assert [(move.key[2], move.verdict) for move in found.times] == [("lscm", "worse")]
    (row,) = moved(found).blocks[0]
    assert row["metric"] == "time [s]"
    assert row["changed"] == "nothing"


def test_other_ends_and_lone_cells_are_listed_with_the_reason(tmp_path):
    failed = {"status": "failed", "reason": f"it broke {HOSTILE}"}
    before = [(HAND, "lscm", [0.1], {}), (DEVIL, "slim", [0.1], {})]
    after = [(HAND, "lscm", [None], failed), (DEVIL, "tutte", [0.1], {})]
    found = compared(tmp_path, before, after)
    (row,) = ended(found).blocks[0]
    assert (row["before"], row["after"]) == ("ok", "failed")
    assert row["reason"].startswith("it broke")
    assert {(row["method"], row["where"]) for row in alone(found).blocks[0]} == {
        ("SLIM", "before"),
        ("Tutte", "after"),
    }
    assert "another status in 1;" in said(found)


def test_a_value_that_becomes_infinite_has_moved(tmp_path):
    found = compared(tmp_path, [(HAND, "mine", [0.1], {})], [(HAND, "mine", [0.2], {})])
    found.cells[1][found.shared[0]].values["symmetric_dirichlet"][:] = math.inf
    move = values(found, "symmetric_dirichlet")[HAND, "mine"]
    assert (move.after, move.verdict) == (math.inf, "worse")


def test_the_command_writes_a_page_for_each_folder_and_says_what_moved(tmp_path, capsys):
    one = folder(tmp_path / "one", (HAND, "slim", [0.3], {}))
    two = folder(tmp_path / "two", (HAND, "slim", [0.4], {}), (HAND, HOSTILE, [0.1], {}))
    three = folder(tmp_path / "three", (DEVIL, "slim", [0.4], {}))
    with pytest.raises(SystemExit) as stop:
        console.run(main, [str(two), "--against", str(one), "--against", str(three)])
    assert stop.value.code in {0, None}
    lines = capsys.readouterr().out.splitlines()
    assert "1 moved beyond noise, 1 of them for the worse" in lines[0]
    assert lines[1].endswith("The two folders have no cell in common.")
    made = two / "report" / "history"
    assert {path.name for path in made.iterdir()} == {"one", "three"}
    assert (made / "one" / "moved.csv").exists()
    page = (made / "one" / "index.html").read_text()
    assert "Beyond noise, cell by cell" in page
    assert "<script>" not in page
    assert not (two / "report" / "index.html").exists()


def test_a_comparison_needs_two_folders_with_results(tmp_path):
    one = folder(tmp_path / "one", (HAND, "slim", [0.3], {}))
    with pytest.raises(InputError, match="not compared with itself"):
        pages.write(one, [one / ".." / "one"])
    with pytest.raises(InputError, match="no such folder"):
        pages.write(one, [tmp_path / "nowhere"])
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="holds no results"):
        pages.write(one, [tmp_path / "empty"])
