"""Processes that share work end with their parent, and are not needed."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from reports.pictures import workers
from reports.pictures.workers import done_by_several


def test_results_come_in_order_whoever_works() -> None:
    work = [(number, 2) for number in range(5)]
    assert list(done_by_several(pow, work, 2)) == list(done_by_several(pow, work, 1))
    assert list(done_by_several(pow, [], 4)) == []


def test_one_job_or_one_piece_of_work_needs_no_other_process() -> None:
    here = [os.getpid()]
    assert list(done_by_several(os.getpid, [(), ()], 1)) == here * 2
    assert list(done_by_several(os.getpid, [()], 4)) == here


def test_a_full_dev_shm_leaves_one_process(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(workers, "ProcessPoolExecutor", full)
    assert list(done_by_several(pow, [(2, 3), (3, 2)], 2)) == [8, 9]
    assert "one process draws alone: No space left on device" in caplog.text


def test_a_worker_that_is_killed_is_one_line() -> None:
    with pytest.raises(ChildProcessError, match="a process that draws was killed, perhaps for"):
        list(done_by_several(os._exit, [(1,), (2,)], 2))


SLEEPERS = """
import pathlib, os, signal, time
from reports.pictures.workers import done_by_several

def sleep(folder):
    pathlib.Path(folder, str(os.getpid())).touch()
    time.sleep(600)

if __name__ == "__main__":
    import sys
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job ignores it
    list(done_by_several(sleep, [(sys.argv[1],)] * 3, 2))
"""


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_no_process_outlives_a_killed_report(number: signal.Signals, tmp_path: Path) -> None:
    script, folder = tmp_path / "sleepers.py", tmp_path / "pids"
    script.write_text(SLEEPERS)
    folder.mkdir()
    variables = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    process = subprocess.Popen([sys.executable, str(script), str(folder)], env=variables)
    deadline = time.monotonic() + 60
    while len(list(folder.iterdir())) < 2 and time.monotonic() < deadline:
        time.sleep(0.05)
    below = psutil.Process(process.pid).children(recursive=True)
    assert len(below) >= 2
    process.send_signal(number)
    process.wait(10)
    _, alive = psutil.wait_procs(below, timeout=5)
    assert not [one for one in alive if one.status() != psutil.STATUS_ZOMBIE]
