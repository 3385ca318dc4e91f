"""Rows that no run of ours writes: each is shown with its fault, and none ends the report."""

from __future__ import annotations

import csv
import dataclasses
import math
import shlex
from pathlib import Path

import numpy as np
import pytest

from baselines import registry
from benchmarks.__main__ import split
from benchmarks.store.measuring import metrics
from benchmarks.store.results import Store
from parapoint.console import fail, printable
from parapoint.surfaces.parameterization import Parameterization, TracePoint
from reports.contents import contents
from reports.page.pages import Section
from reports.report import write

from .conftest import HAND, SLIM, Writer, flat, sheet

NAMES = {
    "maths": "a $x^{2$ b",
    "maths, twice": r"$\frac{$ and $\undefined{x}$",
    "latex": r"\input{/etc/passwd} \\ & % # _ ~ ^",
    "html": "<script>alert(1)</script><img src=x onerror=alert(1)>",
    "formula": '=HYPERLINK("http://x")',
    "formula of another sign": "@SUM(1)|+1",
    "terminal": "\x1b[31mred\x1b]0;title\x07",
    "zeros": "a\x00b",
    "lines": "two\nlines\r\nthree\u2028",
    "right to left": "\u202egnp.exe",
    "lone surrogate": "half \ud800 a pair",
    "another lone surrogate": "\udfff",
    "path": "../../../etc/passwd",
    "blank": " ",
    "long": "n" * 3000,
    "marks": "e" + "\u0301" * 200,
    "markup": "[red]x[/red] {{ 7 * 7 }} {% raw %}",
}
"""Names of cases, methods and parameters that some backend reads as more than text."""
OBEYED = set("\x1b\x00\x07\u202e\u2028")
"""Characters that a terminal or a page obeys."""
TEXTS = {".html", ".csv", ".md", ".tex"}
"""Endings of the files of a report that are text."""


NUMBERS = {"half": math.nan, "all": math.inf, "less": -math.inf}


def written(folder: Path, names: list[str]) -> Path:
    """The index of the report on cells that have a name in all fields of text; the first a map."""
    writer = Writer(folder)
    mesh = sheet()
    with writer.store.writing():
        writer.store.add_run({"commit": "0123456789abcdef", "cpu": names[0], "cores": 2})
        for name in names:
            given = {"preprocessing": name, "host": name, "report": {name: name}}
            if name == names[0]:
                writer.cell(name, mesh, name, {name: name}, result=flat(mesh), **given)
            failed = {"status": "failed", "reason": name, "output": name}
            writer.cell(HAND, mesh, name, {name: name}, **failed, **given)
    return write(folder, jobs=1)


def test_a_name_is_text_in_every_backend(tmp_path: Path) -> None:
    """TeX, HTML, CSV, Markdown and matplotlib read no name as more, and no character is lost."""
    whole = " ".join(name for name in NAMES.values() if len(name) < 1000)
    names = [whole[:180], NAMES["formula"], whole[180:], NAMES["path"], NAMES["blank"]]
    report = written(tmp_path / "out", names).parent
    texts = {path: path.read_text("utf-8") for path in report.rglob("*") if path.suffix in TEXTS}
    assert {path.suffix for path in texts} == TEXTS
    for path, text in texts.items():
        assert not set(text) & OBEYED, path
        if path.suffix == ".html":
            assert "<script>alert" not in text
            assert "<img src=x" not in text
        if path.suffix == ".tex":
            assert r"\input" not in text
        if path.suffix == ".csv":
            cells = [cell for row in csv.reader(text.splitlines()) for cell in row]
            assert not [cell for cell in cells if cell.strip()[:1] in set("=+@")], path
    assert len(list((report / "models" / "paper").glob("*.html"))) == 2
    assert any("half \\ud800 a pair" in text for text in texts.values())
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out"]


def test_numbers_that_are_none_are_shown_as_such(tmp_path: Path) -> None:
    """NaN and infinities in a trace, in a report, in parameters and in times."""
    writer = Writer(tmp_path)
    mesh = sheet()
    uv = flat(mesh).uv
    trace = (
        TracePoint(0, math.nan, {"total": math.nan}, np.full_like(uv, np.nan)),
        TracePoint(1, math.inf, {"total": math.inf, "cycle": -1.0}, uv * 1e200),
        TracePoint(-5, -1.0, {}, uv[:3]),
        TracePoint(2, 0.5, {"total": 1e300, "$x^{$": 1e-300}, None),
    )
    with writer.store.writing():
        for name, value in NUMBERS.items():
            result = Parameterization(uv, mesh.faces, trace)
            writer.cell(
                HAND,
                mesh,
                "parapoint",
                {"points": value, "energy": name},
                result=result,
                seconds=value,
                cpu_seconds=value,
                peak_memory_mb=value,
                report={"iterations": value, "points": [value], "time_budget": {"a": value}},
            )
        writer.cell(HAND, mesh, "slim", SLIM, result=flat(mesh, 0.3))
    page = write(tmp_path, jobs=1)
    assert "SLIM" in page.read_text("utf-8")


def test_a_name_of_a_file_that_is_no_text_has_its_metrics(tmp_path: Path) -> None:
    """Bytes that are no UTF-8 come as halves of surrogate pairs."""
    writer = Writer(tmp_path)
    mesh = sheet()
    with writer.store.writing():
        writer.cell("mesh\udcff.off", mesh, "slim", SLIM, result=flat(mesh))
    assert metrics(Store(tmp_path))["case"].tolist() == ["mesh\\udcff.off"]
    assert metrics(Store(tmp_path))["angle_difference_mean"].notna().all()


@pytest.mark.parametrize("text", NAMES.values(), ids=NAMES.keys())
def test_what_is_printed_is_one_line_of_text(text: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Of a terminal, too."""
    shown = printable(text)
    assert shown.isprintable()
    assert len(shown) < 250
    with pytest.raises(SystemExit):
        fail(text)
    assert capsys.readouterr().err.rstrip("\n").isprintable()
    assert printable(text + "x") != shown


def test_the_command_of_a_suite_of_the_user_s_own_runs_its_cells(tmp_path: Path) -> None:
    """It names the methods in place of the suite, and the command line reads it as it was meant."""
    writer = Writer(tmp_path)
    params = {"energy": "conformal", "iterations": 20, "tolerance": None}
    with writer.store.writing():
        for method, given in (("slim", params), ("lscm", {})):
            row = writer.cell("a file.off", sheet(), method, given, status="failed", reason="no")
            writer.store.append(dataclasses.replace(row, id=row.id[::-1], suite="custom"))
    report = tmp_path / "report"
    named, custom = (Section(report, one, (), (), (), tmp_path) for one in contents(tmp_path))
    assert named.suite_command == f"nox -s bench -- paper --out {tmp_path}"
    assert custom.suite_command == ""
    assert shlex.split(named.command)[:6] == [
        "python",
        "-m",
        "benchmarks",
        "run",
        "paper",
        "--methods",
    ]
    words = shlex.split(custom.command)
    assert words[:5] == ["python", "-m", "benchmarks", "run", "--methods"]
    specs = split(words[5])
    assert specs == ["lscm", "slim(energy='conformal', iterations=20, tolerance=None)"]
    assert registry.method("slim(energy='conformal', iterations=20)")[0] == "slim"
    assert words[6:] == ["--cases", "a file.off", "--seeds", "0", "--out", str(tmp_path)]
