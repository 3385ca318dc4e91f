"""A method that goes wrong does so as it is told, and only there."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks.checks import faulty
from parapoint.surfaces.surface import Mesh

TRIANGLE = Mesh(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 5]]), np.array([[0, 1, 2]]))


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """The folder of a cell that has written its map."""
    folder = tmp_path / "cells" / "one"
    folder.mkdir(parents=True)
    (folder / "map.npz").write_text("a map")
    return folder


def test_its_fault_is_done_and_then_it_maps(monkeypatch: pytest.MonkeyPatch) -> None:
    done: list[object] = []
    monkeypatch.setattr(faulty, "FAULTS", {"odd": (lambda: done.append("odd"), "ok")})
    monkeypatch.setattr("benchmarks.checks.faulty.time.sleep", done.append)
    found = faulty.Faulty(fault="odd", seconds=3.0).parameterize(TRIANGLE, seed=0)
    assert done == ["odd", 3.0]
    assert found.uv.tolist() == [[0, 0], [1, 0], [0, 1]]


def test_harm_at_the_end_is_done_to_the_folder_of_the_cell(
    place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (place / "work").mkdir()
    monkeypatch.chdir(place / "work")
    harmed: list[Path] = []
    ended: list[int] = []
    monkeypatch.setattr(os, "_exit", ended.append)
    faulty._at_the_end(harmed.append)
    assert not harmed
    os._exit(3)
    assert (harmed, ended) == ([place], [3])


def test_folders_and_maps_become_what_they_must_not_be(place: Path) -> None:
    faulty._folder_for_a_map(place)
    assert (place / "map.npz").is_dir()
    faulty._file_in_place_of(place)
    assert place.read_text() == "a file"


def test_the_folder_of_a_cell_may_become_a_link_to_a_user_s(place: Path) -> None:
    faulty._link_to_elsewhere(place)
    assert place.is_symlink()
    assert place.resolve() == place.parents[1] / faulty.ELSEWHERE
    assert (place / "map.npz").read_text() == faulty.OTHERS


def test_a_line_is_said_into_every_pipe_of_a_process_and_nowhere_else(tmp_path: Path) -> None:
    # A process of its own: the pipes of this one carry what the test runner says.
    code = "import sys; print(sys.stdin.readline(), end='')"
    with (tmp_path / "file").open("w") as file:
        process = subprocess.Popen(
            [sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=file
        )
        assert {path.name for path in faulty._pipes(process.pid)} == {"0", "1"}
        faulty._say(b"a lie\n", process.pid)
    printed, _ = process.communicate(timeout=20)
    assert printed == b"a lie\n" * 2  # said into its output, and by itself what came into its input
    assert (tmp_path / "file").read_text() == ""


def test_a_disk_without_room_is_one_of_the_faults() -> None:
    with pytest.raises(OSError, match="no space left") as error:
        faulty._no_space()
    assert error.value.errno == errno.ENOSPC
