"""A folder with names like ours that we did not write is refused, and stays as it is."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.store.results import NAMES, Store
from parapoint.errors import InputError
from reports.report import MARK, claim


@pytest.mark.parametrize("name", NAMES)
def test_a_file_that_we_did_not_write_is_in_the_way(name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_text("mine")
    with (
        pytest.raises(InputError, match=f"{name}: is in the way and not ours"),
        Store(tmp_path).writing(),
    ):
        pass
    assert path.read_text() == "mine"
    assert list(tmp_path.iterdir()) == [path]


def test_our_own_folder_is_known_from_its_first_moment(tmp_path: Path) -> None:
    (tmp_path / "lock").touch()  # a run that was killed at its very beginning
    (tmp_path / "notes.txt").write_text("mine")
    with Store(tmp_path).writing():
        assert (tmp_path / "environment.json").exists()
    with Store(tmp_path).writing():
        pass


def test_a_report_is_written_into_a_folder_of_ours_alone(tmp_path: Path) -> None:
    claim(tmp_path / "report")
    claim(tmp_path / "report")
    assert (tmp_path / "report" / MARK).exists()
    (tmp_path / "report" / MARK).unlink()
    (tmp_path / "report" / "index.html").write_text("mine")
    with pytest.raises(InputError, match="not known to be ours"):
        claim(tmp_path / "report")
