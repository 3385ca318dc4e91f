"""`python -m benchmarks`: the contract of the commands."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from rich.table import Table

from baselines import registry
from benchmarks import __main__ as commands
from benchmarks.cases import models, suites
from benchmarks.running import planning, runner
from benchmarks.store.archives import map_arrays, write_arrays
from benchmarks.store.results import Store
from parapoint import console
from parapoint.errors import InputError

PLUGIN = """
from dataclasses import dataclass
from typing import ClassVar
from parapoint import Parameterization

@dataclass(frozen=True)
class {name}:
    requires: ClassVar[frozenset[str]] = frozenset({{"faces"}})
    height: float = 0.0
    def parameterize(self, surface, *, seed):
        if self.height:
            raise ValueError("too high")
        return Parameterization(surface.vertices[:, :2], surface.faces)
"""


def command(*arguments: str) -> int:
    """The exit status of a command, run in this process."""
    with pytest.raises(SystemExit) as exit_info:
        console.run(commands.main, list(arguments))
    return int(exit_info.value.code or 0)


@pytest.fixture
def plugin(tmp_path, request):
    """A plugin file whose class has a name of its own: plugins stay for the process."""
    name = "P" + "".join(filter(str.isalnum, request.node.name)).lower()
    (tmp_path / "plugin.py").write_text(PLUGIN.format(name=name))
    return f"{tmp_path}/plugin.py:{name}", name.lower()


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("a", ["a"]),
        ("a, b", ["a", "b"]),
        (
            "slim(energy=conformal, iterations=1),lscm",
            ["slim(energy=conformal, iterations=1)", "lscm"],
        ),
        ("m(a=(1, 2), b=[3, 4]),n(c='),,(')", ["m(a=(1, 2), b=[3, 4])", "n(c='),,(')"]),
    ],
)
def test_a_list_is_split_outside_of_brackets_and_quotes(text, parts):
    assert commands.split(text) == parts


@pytest.mark.parametrize("text", ["", "a,,b", "a,", "m(a=1", "m(a='1)"])
def test_a_malformed_list_is_an_input_error(text):
    with pytest.raises(InputError):
        commands.split(text)


def test_names_of_files_may_hold_what_lists_do(tmp_path, monkeypatch):
    """Commas, quotes and brackets, as in files that people name."""
    monkeypatch.chdir(tmp_path)
    files = ["a, b.obj", "Bob's.obj", 'say "hi".ply', "1,2,3.xyz", "x (1.obj", "1"]
    for name in files:
        (tmp_path / name).touch()
    assert commands._cases(None, None, ",".join(files)) == files
    assert commands._cases(None, None, "cow, a, b.obj ,hand") == ["cow", "a, b.obj", "hand"]
    with pytest.raises(InputError, match="no list such as"):
        commands._cases(None, None, "cow,,hand")


def test_help_is_light():
    code = (
        "import sys; from benchmarks import __main__ as m\n"
        "try: m.main(['run', '--help'])\n"
        "except SystemExit: pass\n"
        "print('loaded', {'torch', 'scipy', 'igl', 'pandas', 'numpy'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "--methods" in done.stdout
    assert done.stdout.endswith("loaded set()\n")


@pytest.mark.parametrize(
    "arguments",
    [
        ["nonsense"],
        ["run", "nonsense"],
        ["run", "--methods", "nonsense"],
        ["run", "--methods", "slim(iterations=many)"],
        ["run", "--methods", "slim("],
        ["run", "--cases", "nonsense"],
        ["run", "--cases", "missing.obj"],
        ["run", "--seeds", "one"],
        ["run", "--seeds", "-1"],
        ["run", "--jobs", "0"],
        ["run", "--seeds", str(10**23)],
        ["run", "--seeds", str(2**63)],
        ["run", "--seeds", "1" * 5000],
        ["run", "--methods", f"slim(iterations={'1' * 5000})"],
        ["run", "--methods", f"slim(iterations=0x{'f' * 5000})"],
        ["run", "--methods", f"unwrap(max_distortion={'1' * 400})"],
        ["run", "--methods", f"unwrap(max_distortion=0x{'f' * 5000})"],
        ["speed", "--seconds", "nan"],
        ["speed", "--seconds", "1e308"],
        ["run", "--jobs", str(10**20)],
        ["run", "--timeout", "0"],
        ["run", "--timeout", "nan"],
        ["run", "--timeout", "inf"],
        ["run", "--timeout", "1e308"],
        ["run", "--memory", "nan"],
        ["run", "--memory", "1e308"],
        ["run", "--memory", "x"],
        ["run", "--plugin", "missing.py:Class"],
        ["run", "--nonsense"],
        ["list", "nonsense"],
        ["check", "missing"],
        ["score", "missing.obj"],
    ],
)
def test_wrong_use_is_one_line_and_status_2_and_nothing_written(
    arguments, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    assert command(*arguments) == 2
    shown = capsys.readouterr()
    assert shown.out == ""
    assert shown.err.startswith("error: ")
    assert shown.err.count("\n") == 1
    assert not list(tmp_path.iterdir())


RAISED = ["SystemExit", "SystemExit(0)", "GeneratorExit()", "MemoryError()", "OSError(28, 'full')"]
BEGINNING = """
from dataclasses import dataclass
from typing import ClassVar

@dataclass(frozen=True)
class Rude:
    requires: ClassVar[frozenset[str]] = frozenset()
    def __post_init__(self):
        raise {raised}
    def parameterize(self, surface, *, seed): ...
"""


@pytest.mark.parametrize("raised", RAISED)
@pytest.mark.parametrize("source", ["raise {raised}", BEGINNING], ids=["file", "method"])
def test_a_plugin_that_exits_is_one_line_and_status_2(
    source, raised, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(registry, "_plugins", {})
    (tmp_path / "rude.py").write_text(source.format(raised=raised))
    assert command("run", "--plugin", "rude.py:Rude", "--cases", "half_cylinder") == 2
    shown = capsys.readouterr()
    assert re.fullmatch(r"error: rude(\.py)? does not run: \w+:.*\n", shown.err)
    assert [path.name for path in tmp_path.iterdir() if path.name != "__pycache__"] == ["rude.py"]


def test_a_run_goes_from_a_file_and_a_plugin_to_a_checked_folder(
    tmp_path, monkeypatch, capsys, plugin
):
    monkeypatch.chdir(tmp_path)
    location, name = plugin
    (tmp_path / "mesh.off").write_text("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")
    specs = f"tutte,{name}(height=1.0)"
    arguments = ["run", "--cases", "mesh.off", "--methods", specs, "--plugin", location]
    assert command(*arguments) == 0
    shown = capsys.readouterr()
    assert "custom: 2 cells to run (2 new)" in shown.out
    assert f"mesh.off, {name}(height=1.0): failed: ValueError: too high" in shown.out
    assert "[1/2] mesh.off tutte: ok, " in shown.err
    assert f"[2/2] mesh.off {name}(height=1.0): failed: ValueError: too high" in shown.err
    assert "results: results/custom   report: python -m reports results/custom" in shown.out
    folder = tmp_path / "results" / "custom"
    rows = {row.method: row for row in Store(folder).rows()}
    assert rows["tutte"].case == "mesh.off"
    assert rows["tutte"].suite == "custom"
    assert rows[name].params == {"height": 1.0}
    assert (folder / "metrics.parquet").is_file()

    assert command(*arguments, "--strict") == 1
    assert "custom: 0 cells to run; 2 are done already" in capsys.readouterr().out

    Store(folder).uv_path(rows["tutte"].id).unlink()
    assert command(*arguments) == 0
    shown = capsys.readouterr()
    assert "custom: 1 cells to run (1 map missing); 1 are done already" in shown.out
    assert "again: mesh.off, tutte, seed 0: map missing" in shown.out

    assert command("check", "results/custom") == 0
    assert "2 cells, 1 maps: no faults" in capsys.readouterr().out
    store = Store(folder)
    result = store.result(rows["tutte"])
    changed = map_arrays(result) | {"uv": np.asarray(result.uv) * 2}
    write_arrays(store.uv_path(rows["tutte"].id), changed)
    assert command("check", "results/custom") == 1
    assert "is not the map that was written" in capsys.readouterr().out


def test_a_plugin_joins_the_methods_of_the_suite(monkeypatch, tmp_path, plugin):
    location, name = plugin
    calls = []

    def noted(suite, chosen, *_, **__):
        calls.append((suite.cases, [method.spec for method in chosen]))
        return [], []

    monkeypatch.setattr(planning, "plan", noted)
    monkeypatch.setattr(runner, "_measure", lambda *_: None)
    out = ["--out", str(tmp_path / "out")]
    assert command("run", "builtin", "--plugin", location, "--cases", "cone", *out) == 0
    assert (
        command("run", "builtin", "--plugin", location, "--cases", "cone", "--methods", name, *out)
        == 0
    )
    assert calls == [
        (("cone",), [*suites.suite("builtin").methods, name]),
        (("cone",), [name]),
    ]


def test_the_built_in_surfaces_stand_in_where_no_model_can_be_had(tmp_path, monkeypatch, capsys):
    def nothing(case):
        if case in suites.suite("paper").cases:
            raise models.MissingModelError(f"{case} is not at hand: download it")
        return load(case)

    load = models.load
    monkeypatch.setattr(models, "load", nothing)
    out = tmp_path / "out"
    assert command("run", "paper", "--methods", "tutte", "--out", str(out)) == 0
    shown = capsys.readouterr().out
    for case in suites.suite("paper").cases:
        assert f"{case} is left out: {case} is not at hand: download it" in shown
    heading = shown.index("The built-in surfaces run in their place")
    assert shown.index("is left out") < heading < shown.index("builtin: Surfaces made in memory")
    rows = Store(out).rows()
    assert {row.status for row in rows if row.suite == "paper"} == {"skipped"}
    assert {row.case for row in rows if row.suite == "builtin"} == set(
        suites.suite("builtin").cases
    )


@pytest.mark.parametrize("what", ["suites", "cases", "methods", "metrics"])
def test_lists_are_tables_of_tab_separated_lines_in_a_pipe(what, capsys):
    assert command("list", what) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) > 5
    assert len({line.count("\t") for line in lines}) == 1
    first = {"suites": "smoke", "cases": "beetle_bff", "methods": "tutte"}
    assert first.get(what, "angle_difference_mean") in {line.split("\t")[0] for line in lines}


@pytest.mark.parametrize("what", ["suites", "methods"])
def test_lists_make_methods_without_torch(what):
    code = (
        "import sys; from benchmarks import __main__ as m\n"
        f"try: m.main(['list', {what!r}])\n"
        "except SystemExit: pass\n"
        "print('loaded', {'torch', 'pandas'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "parapoint" in done.stdout
    assert done.stdout.endswith("loaded set()\n")


def test_score_prints_json_and_nothing_else(tmp_path, capsys):
    lines = ["v 0 0 0", "v 1 0 0", "v 0 1 0", "vt 0 0", "vt 1 0", "vt 0 1", "f 1/1 2/2 3/3"]
    (tmp_path / "map.obj").write_text("\n".join(lines) + "\n")
    assert command("score", str(tmp_path / "map.obj"), "--json") == 0
    assert json.loads(capsys.readouterr().out)["angle_difference_mean"] == pytest.approx(0)


@pytest.mark.parametrize(
    ("missing", "arguments", "suites_run", "status"),
    [
        (6, [], ["paper", "builtin"], 0),
        (6, ["--strict"], ["paper", "builtin"], 1),  # a cell of the second one has failed
        (5, ["--strict"], ["paper"], 0),
        (6, ["--cases", "cone"], ["paper"], 0),
    ],
)
def test_the_built_in_surfaces_stand_in_for_a_whole_suite_alone(
    missing: int,
    arguments: list[str],
    suites_run: list[str],
    status: int,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[str] = []

    def shown(suite: suites.Suite, *_: Path, **__: object) -> SimpleNamespace:
        asked.append(suite.name)
        ended = "skipped" if suite.name == "paper" else "failed"
        lost = dict.fromkeys(suite.cases[:missing], "download it")
        rows = [SimpleNamespace(status=ended)]
        return SimpleNamespace(rows=rows, missing=lost, suite=suite)

    monkeypatch.setattr(commands, "_shown_run", shown)
    allowed: list[float] = []
    monkeypatch.setattr("parapoint.files.decoding.allow", allowed.append)
    assert command("run", "paper", "--memory", "1.5", *arguments) == status
    assert asked == suites_run
    assert allowed == [1.5e9]


def test_what_is_measured_is_a_table_each_and_a_figure_or_a_race(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    drawn: list[Path] = []
    for module, names in {
        "benchmarks.commands.metric_speed": ("metric_costs", "metric_table"),
        "benchmarks.commands.method_speed": ("overheads", "overhead_table"),
        "benchmarks.commands.speed": ("training_table",),
    }.items():
        for name in names:
            monkeypatch.setattr(f"{module}.{name}", lambda *_, named=name: Table(title=named))
    monkeypatch.setattr(
        "benchmarks.commands.metric_speed.growth_figure", lambda _, path: drawn.append(path)
    )
    monkeypatch.setattr(
        "benchmarks.checks.straightforward.race_table",
        lambda case, seconds: Table(title=f"{case} {seconds:g}"),
    )

    def titles(*arguments: str) -> list[str]:
        assert command("speed", *arguments) == 0
        return capsys.readouterr().out.split()

    assert titles() == ["metric_table", "overhead_table", "training_table"]
    assert not drawn
    assert len(titles("--figure", f"{tmp_path}/growth.PNG")) == 3
    assert drawn == [tmp_path / "growth.PNG"]
    assert titles("--race", "cow", "--seconds", "3") == ["cow", "3"]
    assert command("speed", "--figure", "growth.pdf") == 2
    assert "give a name that ends in .png" in capsys.readouterr().err


def test_a_folder_with_several_versions_of_a_suite_is_said_to_have_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    found = {"paper": {"1 (a)": 2, "2 (b)": 1}, "core": {"1 (c)": 5}}
    monkeypatch.setattr("benchmarks.store.versions.versions", lambda *_: found)
    monkeypatch.setattr("benchmarks.commands.display.print_summary", lambda _: None)
    monkeypatch.setattr("benchmarks.running.runner.run", lambda *_, **__: "what it did")
    assert str(commands._shown_run(suites.suite("smoke"), tmp_path)) == "what it did"
    said = "paper in several versions: 2 of version 1 (a), 1 of version 2 (b)"
    assert capsys.readouterr().out == f"{tmp_path} holds {said}\n"
