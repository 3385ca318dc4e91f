"""Names, files and commands from elsewhere do nothing but what they are for."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks.cases.suites import Suite
from benchmarks.checks import instant
from benchmarks.running.runner import run
from parapoint.errors import InputError
from parapoint.files.reading import read_point_map

OFF = "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
NAMES = re.compile(
    r"uv|surfaces|references|((uv|surfaces|references)/[0-9a-f]{32}\.npz)"
    r"|runs\.jsonl|environment\.json|surfaces\.json|metrics\.parquet|lock"
)


def test_no_name_of_a_case_or_a_suite_becomes_a_path(tmp_path):
    files = tmp_path / "files"
    files.mkdir()
    cases = [
        files / name for name in ("..mesh.off", "a;b $(touch x) <script>.off", "%2e%2e%2f.off")
    ]
    for case in cases:
        case.write_text(OFF)
    outside = f"{files}/../files/{cases[0].name}"
    suite = Suite("../../suite", "A trial", (*map(str, cases), outside), (), (0,))
    out = tmp_path / "out"
    assert len(run(suite, out, plugins=[f"{instant.__file__}:Instant"]).ran) == 4
    for path in out.rglob("*"):
        assert NAMES.fullmatch(path.relative_to(out).as_posix()), path
    assert sorted(path.name for path in tmp_path.iterdir()) == ["files", "out"]
    assert len(list(files.iterdir())) == 3


def test_an_external_program_gets_arguments_and_no_shell(tmp_path):
    mark = tmp_path / "mark"
    note = tmp_path / "arguments"
    (tmp_path / "tool.py").write_text(
        f"import json, sys; json.dump(sys.argv[3:], open({str(note)!r}, 'w')); sys.exit(1)"
    )
    tool = f"{sys.executable} {tmp_path}/tool.py {{input}} {{output}}"
    command = f"{tool} ; touch {mark} && $(touch {mark}) `touch {mark}` > {mark}"
    (tmp_path / "mesh.off").write_text(OFF)
    suite = Suite("trial", "A trial", (str(tmp_path / "mesh.off"),), (), (0,))
    (row,) = run(suite, tmp_path / "out", methods=[f"external(command={command!r})"]).ran
    assert "ended with status 1" in row.reason
    assert not mark.exists()
    assert json.loads(note.read_text())[:3] == [";", "touch", str(mark)]


class Evil:
    """Runs code when it is unpickled."""

    def __init__(self, mark: Path) -> None:
        self.mark = mark

    def __reduce__(self):
        return Path.touch, (self.mark,)


def test_a_map_to_score_is_never_unpickled(tmp_path):
    evil = np.empty(1, dtype=object)
    evil[0] = Evil(tmp_path / "mark")
    np.savez(tmp_path / "map.npz", points=evil, uv=evil)
    with pytest.raises(InputError, match=r"map\.npz"):
        read_point_map(tmp_path / "map.npz")
    assert not (tmp_path / "mark").exists()
