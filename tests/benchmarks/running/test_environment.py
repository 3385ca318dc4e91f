"""What a worker compares to know that it has the same version of the project."""

from __future__ import annotations

import pytest

from benchmarks.running import environment


@pytest.mark.parametrize("place", ["parapoint/a.py", "benchmarks/room/a.py", "baselines/x/y/a.py"])
def test_every_source_file_of_the_project_counts(tmp_path, monkeypatch, place):
    monkeypatch.setattr(environment, "ROOT", tmp_path)
    path = tmp_path / place
    path.parent.mkdir(parents=True)
    path.write_text("x = 1\n")
    first = environment.project.__wrapped__()
    assert environment.project.__wrapped__() == first
    path.write_text("x = 2\n")
    second = environment.project.__wrapped__()
    path.rename(path.with_name("b.py"))
    assert len({first, second, environment.project.__wrapped__()}) == 3
