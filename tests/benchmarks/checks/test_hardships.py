"""What the checks of hardships count: no fault where there is none, and each that there is."""

import errno
import json
import random
import subprocess
import time
from pathlib import Path
from types import SimpleNamespace

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


def test_processes_that_are_not_ours_are_not_found(tmp_path: Path) -> None:
    """What is found is killed: all other processes of the machine must not be."""
    assert hardships._started("a tag that no process has", tmp_path) == []


def test_processes_that_a_broken_command_leaves_are_told(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(hardships, "GONE_AFTER", 0.2)
    waits = "import subprocess, time; {}; time.sleep(60)"
    for then, count in (("subprocess.Popen(['sleep', '60'])", 1), ("", 0)):
        code = waits.format(then or "pass")
        signals = hardships.MANNERS["stopped and killed"]
        assert len(hardships._broken_off(["-c", code], tmp_path, signals, 1.0)) == count


@pytest.mark.parametrize(("status", "fault"), [(0, False), (1, True)])
def test_each_process_of_a_run_is_killed_once_and_then_a_report_must_end_well(
    status: int, fault: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[tuple[str, str, bool]] = []

    def killed(
        victim: str, command: list[str], folder: Path, _: random.Random
    ) -> hardships.Hardship:
        asked.append((victim, command[1], folder.is_dir()))
        return hardships.Hardship(1, ["a fault"] if victim == "cell" else [])

    monkeypatch.setattr(
        bystanders,
        "inputs",
        lambda at: {"mesh": at / "mesh.obj"} if at.mkdir(parents=True) is None else {},
    )
    monkeypatch.setattr(hardships, "_killed", killed)
    ended(monkeypatch, lambda _: None, status, "error: no\n")
    found = hardships.kills(tmp_path, seed=0)
    runs = [(victim, "benchmarks", True) for victim in ("run", "supervisor", "cell")]
    assert asked == [*runs, ("report", "reports", True)]
    assert found.tried == 5
    after = ["a report after one that was killed: error: no"] if fault else []
    assert found.faults == ["a fault", *after]


class Mounts:
    """A system that mounts nothing in truth; notes what it is asked for, and refuses one word."""

    def __init__(self, refused: str = "nothing") -> None:
        self.refused = refused
        self.asked: list[str] = []

    def run(self, command: list[str], **_: object) -> SimpleNamespace:
        self.asked.append(" ".join(command[:3]))
        return SimpleNamespace(returncode=int(self.refused in " ".join(command)))


@pytest.mark.parametrize(
    ("state", "refused", "begins"),
    [
        ("full", "nothing", hardships._as_it_is),
        ("full", "tmpfs", hardships._no_room),
        ("read-only", "nothing", hardships._as_it_is),
        ("read-only", "tmpfs", None),
        ("read-only", "remount", None),
    ],
)
def test_a_disk_is_full_or_read_only_or_cannot_be_made(
    state: str, refused: str, begins: object, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "results").mkdir()
    place = tmp_path / "disk"
    place.mkdir()
    system = Mounts(refused)
    room = iter([4096, 4096])

    def write(_: int, content: bytes) -> int:
        if len(content) != next(room, 0):
            raise OSError(errno.ENOSPC, "no space left on device")
        return len(content)

    with monkeypatch.context() as patch:
        patch.setattr(hardships.subprocess, "run", system.run)
        patch.setattr(hardships.os, "write", write)
        with hardships._disk(place, state, tmp_path / "results") as limits:
            assert limits is begins
            assert (place / "mine").is_dir()
            assert (place / "results").is_dir()
    is_mounted = refused != "tmpfs"
    assert (system.asked[-1] == f"umount -l {place}") == is_mounted
    assert ("mount -o remount,ro" in system.asked) == (is_mounted and state == "read-only")
    assert (next(room, 0) == 0) == (is_mounted and state == "full")  # it is filled to its end


def test_a_command_is_run_to_its_end_and_its_last_words_are_kept(tmp_path: Path) -> None:
    says = "import sys, benchmarks; print('here'); sys.exit('first\\nlast')"
    done = hardships._run(["-c", says], tmp_path)
    assert (done.returncode, done.stdout) == (1, "here\n")
    assert hardships._said(done) == "last"
    writes = ["-c", "from pathlib import Path; Path('file').write_text('words')"]
    done = hardships._run(writes, tmp_path, hardships._as_it_is)
    assert (done.returncode, hardships._said(done)) == (0, "nothing")
    assert (tmp_path / "file").read_text() == "words"
    done = hardships._run(writes, tmp_path, hardships._no_room)
    assert (done.returncode, (tmp_path / "file").read_text()) == (1, "")


FIVE = "import subprocess as s; a = [s.Popen(['sleep', '60']) for _ in range(4)]; a[0].wait()"


@pytest.mark.parametrize(
    ("victim", "code", "left"),
    [
        ("run", FIVE, 4),
        ("supervisor", FIVE, 3),  # the command ends by itself, without its first process
        ("report", "pass", 0),
        ("report", "import time; time.sleep(60)", 0),
    ],
)
def test_the_victim_alone_is_killed_and_what_is_left_is_told(
    victim: str, code: str, left: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sleep = time.sleep
    monkeypatch.setattr(hardships, "GONE_AFTER", 0.1)
    monkeypatch.setattr(hardships.time, "sleep", lambda seconds: sleep(min(seconds, 0.05)))
    found = hardships._killed(victim, ["-c", code], tmp_path, random.Random(0))  # noqa: S311
    assert found.tried == 1
    assert len(found.faults) == left
    assert all(fault.startswith(f"kill of a {victim}: process ") for fault in found.faults)
    for _ in range(100):
        if not hardships._started("no tag", tmp_path):
            return
        sleep(0.02)
    pytest.fail("what was left goes on")
