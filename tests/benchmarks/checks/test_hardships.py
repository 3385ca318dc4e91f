"""What the checks of hardships count: no fault where there is none, and each that there is."""

import json
import subprocess
from pathlib import Path

import pytest

from benchmarks.checks import bystanders, hardships


@pytest.fixture(autouse=True)
def nothing_is_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """Inputs that nobody needs, and no file system that needs rights."""

    def inputs(folder: Path) -> dict[str, Path]:
        (folder / "results").mkdir(parents=True)
        row = {"id": "a", "case": "b", "seed": 0}
        (folder / "results" / "runs.jsonl").write_text(json.dumps(row) + "\n")
        return {}

    monkeypatch.setattr(bystanders, "inputs", inputs)
    monkeypatch.setattr(bystanders, "COMMANDS", ("benchmarks check {results} {folder}",))


def ended(monkeypatch: pytest.MonkeyPatch, does, status: int, error: str) -> None:
    """Let every command do so, and end so."""

    def run(arguments: list[str], *_: object) -> subprocess.CompletedProcess[str]:
        does(Path(next(text for text in arguments if text.startswith("/"))))
        return subprocess.CompletedProcess(arguments, status, "", error)

    monkeypatch.setattr(hardships, "_run", run)


@pytest.mark.parametrize(
    ("name", "ends", "fault"),
    [
        ("whole.csv", (2, "error: no space left\n"), None),
        ("empty.csv", (2, "error: no space left\n"), "empty.csv is empty"),
        ("runs.jsonl", (2, "error: no space left\n"), "runs.jsonl has changed"),
        ("whole.csv", (1, "Traceback\n  ...\nOSError: full\n"), "status 1: OSError: full"),
        ("whole.csv", (2, ""), "refused without a word"),
        ("whole.csv", (-9, ""), "status -9"),
    ],
)
def test_what_a_full_disk_does_is_told(name, ends, fault, tmp_path, monkeypatch) -> None:
    def does(results: Path) -> None:
        (results / name).write_text("" if name == "empty.csv" else "x")

    monkeypatch.setattr(
        hardships.subprocess, "run", lambda *_, **__: (_ for _ in ()).throw(OSError)
    )
    ended(monkeypatch, does, *ends)
    found = hardships.disks(tmp_path, seed=0, count=1)
    assert found.tried == 1
    assert len(found.faults) == (fault is not None)
    assert fault is None or fault in found.faults[0]


def test_rows_of_others_that_end_a_report_are_told(tmp_path, monkeypatch) -> None:
    ended(monkeypatch, lambda _: None, 2, "error: no results\n")
    assert hardships.rows(tmp_path / "well", seed=0, count=2) == hardships.Hardship(4)
    ended(
        monkeypatch, lambda at: (at.parents[2] / "evil").write_text("x"), 1, "Traceback\nKeyError\n"
    )
    found = hardships.rows(tmp_path / "wrong", seed=0, count=1)
    assert [fault.split()[0] for fault in found.faults] == ["benchmarks", "reports", "a"]


@pytest.mark.parametrize("fault", [None, "there by halves", "user's has changed", "is left"])
def test_what_is_left_of_commands_that_are_broken_off_is_told(fault, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(hardships, "WRITING", {"benchmarks make {folder}/made.zip": "made.zip"})
    ended(monkeypatch, lambda at: at.suffix and at.write_text("whole"), 0, "")

    def breaks(_: list[str], place: Path, *__: object) -> list[int]:
        if fault == "user's has changed":
            (place / "mine" / "model.json").write_text("ours")
        (place / "mine" / "made.zip").write_text("who" if fault == "there by halves" else "whole")
        return [7] if fault == "is left" else []

    monkeypatch.setattr(hardships, "_broken_off", breaks)
    found = hardships.broken_off(tmp_path, seed=0, count=1)
    assert found.tried == 1
    assert len(found.faults) == (fault is not None)
    assert fault is None or fault in found.faults[0]


def test_processes_that_a_broken_command_leaves_are_told(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(hardships, "GONE_AFTER", 0.2)
    waits = "import subprocess, time; {}; time.sleep(60)"
    for then, count in (("subprocess.Popen(['sleep', '60'])", 1), ("", 0)):
        code = waits.format(then or "pass")
        signals = hardships.MANNERS["stopped and killed"]
        assert len(hardships._broken_off(["-c", code], tmp_path, signals, 1.0)) == count
