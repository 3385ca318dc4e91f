"""The environments of the runs: kept, and not read where they are not ours to read."""

from __future__ import annotations

import json

import pytest

from benchmarks.store import provenance
from parapoint.errors import InputError


def test_runs_are_added_one_after_another(tmp_path):
    assert provenance.environment(tmp_path) == {"format": 1, "runs": []}
    assert provenance.add_run(tmp_path, {"limit": float("inf")}) == 0
    assert provenance.add_run(tmp_path, {"limit": 3}) == 1
    assert provenance.environment(tmp_path)["runs"] == [{"limit": "inf"}, {"limit": 3}]


@pytest.mark.parametrize("content", [b"", b"[]", b"{}", b'{"runs": {}}', b"\xff", b"[" * 10**5])
def test_a_damaged_file_is_bad_input_and_stays(tmp_path, content):
    path = tmp_path / "environment.json"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"environment\.json: damaged"):
        provenance.add_run(tmp_path, {})
    assert path.read_bytes() == content


@pytest.mark.parametrize("version", ["1", None, 2, 1.5])
def test_another_format_is_left_alone(tmp_path, version):
    (tmp_path / "environment.json").write_text(json.dumps({"format": version, "runs": []}))
    with pytest.raises(InputError, match=f"newer version .results format {version}"):
        provenance.environment(tmp_path)
