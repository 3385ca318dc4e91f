"""What the pages say is so: snippets run, the tutorial runs, and no metric goes without a word."""

import re
from pathlib import Path

import nbformat
import numpy as np
import pytest
from nbclient import NotebookClient

from benchmarks.__main__ import main
from benchmarks.metrics.metric import WITHOUT_SPANNING
from benchmarks.metrics.table import METRICS
from parapoint import console
from parapoint.files import reading

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
CONTRIBUTING = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
SNIPPETS = re.findall(r"```python\n(.*?)```", CONTRIBUTING, re.DOTALL)


def test_every_metric_is_defined() -> None:
    page = (DOCS / "METRICS.md").read_text(encoding="utf-8")
    named = set(re.findall(r"`([a-z0-9_]+)`", page))
    assert {name.removesuffix(WITHOUT_SPANNING) for name in METRICS} <= named


def test_ideals_are_those_of_the_table() -> None:
    page = (DOCS / "METRICS.md").read_text(encoding="utf-8")
    checked = 0
    for names, ideal in re.findall(r"^\| (`[^|]*`) \| .* \| ([\d–, ]+) \|$", page, re.MULTILINE):
        of = re.findall(r"`([a-z0-9_]+)`", names)
        said = [one.strip() for one in ideal.split(",")]
        for name, one in zip(of, said * len(of) if len(said) == 1 else said, strict=False):
            known = METRICS[name].ideal
            assert one == ("–" if known is None else f"{known:g}"), name
            checked += 1
    assert checked >= 50


def test_the_snippets_of_contributing_run(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    method, checked, metric, reader, figure = SNIPPETS
    (tmp_path / "along.py").write_text(method)
    monkeypatch.syspath_prepend(tmp_path)
    exec(compile(checked, "CONTRIBUTING.md", "exec"), {})  # noqa: S102 (a snippet of ours)
    (line,) = re.findall(r"python -m benchmarks (run .*)", CONTRIBUTING)
    words = ["run", "--plugin", "along.py:Along", "--methods", "along,along(axis=0)"]
    assert line == 'run --plugin along.py:Along --methods "along,along(axis=0)" --cases saddle'
    with pytest.raises(SystemExit) as ended:
        console.run(main, [*words, "--cases", "saddle"])
    assert not ended.value.code
    monkeypatch.setattr(reading, "FORMATS", dict(reading.FORMATS))
    for snippet in (metric, reader, figure):
        exec(compile(snippet, "CONTRIBUTING.md", "exec"), {})  # noqa: S102 (a snippet of ours)
    assert (tmp_path / "trade_off.png").stat().st_size > 1000
    (tmp_path / "two.triples").write_text("0 0 0 1 2 3")
    cloud = reading.read_surface(tmp_path / "two.triples")
    np.testing.assert_array_equal(cloud.points, [[0, 0, 0], [1, 2, 3]])


@pytest.mark.long
@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::RuntimeWarning")
def test_the_tutorial_runs(tmp_path) -> None:
    notebook = nbformat.read(DOCS / "TUTORIAL.ipynb", as_version=4)
    where = {"metadata": {"path": str(tmp_path)}}
    NotebookClient(notebook, timeout=240, kernel_name="python3", resources=where).execute()
    assert (tmp_path / "scan.glb").stat().st_size > 10_000
    shown = str([cell.get("outputs") for cell in notebook.cells])
    assert "lscm" in shown
    assert "1 maps of my tool" in shown
