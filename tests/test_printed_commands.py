"""Every command that the README, a page or a help prints works as printed."""

from __future__ import annotations

import ast
import html
import re
import shlex
from pathlib import Path

import click
import igl
import numpy as np
import pytest

from benchmarks import __main__ as benchmarks
from benchmarks.cases import models
from benchmarks.commands import method_speed, metric_speed, speed
from benchmarks.rendering import scene
from parapoint import cli, console
from parapoint.files.reading import read_surface
from parapoint.surfaces.surface import Mesh
from reports import __main__ as reports
from reports.pictures import drawing, style

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```sh\n(.*?)```", README, flags=re.DOTALL)
PROGRAMS: dict[str, click.Command] = {
    "python -m benchmarks": benchmarks.main,
    "python -m reports": reports.main,
    "parapoint": cli.parapoint,
}


def commands(text: str) -> list[list[str]]:
    """The commands of lines of a shell, their comments left out."""
    words = [
        word for line in text.splitlines() for word in [*shlex.split(line, comments=True), "&&"]
    ]
    found: list[list[str]] = [[]]
    for word in words:
        if word == "&&":
            found.append([])
        else:
            found[-1].append(word)
    return [command for command in found if command]


def run(words: list[str]) -> None:
    """Run a command of ours in this process; it must end well."""
    for name, program in PROGRAMS.items():
        first = name.split()
        if words[: len(first)] == first:
            with pytest.raises(SystemExit) as ended:
                console.run(program, words[len(first) :])
            assert not ended.value.code, words
            return
    pytest.fail(f"{words} is no command of ours")


def sheet(count: int = 24) -> Mesh:
    """A wavy sheet, a disk."""
    vertices, faces = igl.triangulated_grid(count, count)
    x, y = vertices.T
    return Mesh(np.stack([x, y, 0.15 * np.sin(5 * x)], axis=1), faces)


def obj(mesh: Mesh, uv: bool = False) -> str:
    lines = ["v {} {} {}".format(*point) for point in mesh.vertices]
    lines += ["vt {} {}".format(*point[:2]) for point in mesh.vertices if uv]
    form = "f {0}/{0} {1}/{1} {2}/{2}" if uv else "f {} {} {}"
    return "\n".join(lines + [form.format(*face) for face in mesh.faces + 1]) + "\n"


def coloured(points: np.ndarray) -> str:
    head = "ply\nformat ascii 1.0\nelement vertex {}\n{}end_header\n"
    names = [f"property float {axis}\n" for axis in "xyz"]
    names += [f"property uchar {name}\n" for name in ("red", "green", "blue")]
    rows = ["{} {} {} 200 100 50".format(*point) for point in points]
    return head.format(len(points), "".join(names)) + "\n".join(rows) + "\n"


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with the files that the README speaks of; models are small sheets."""
    folder = tmp_path_factory.mktemp("printed")
    mesh = sheet()
    (folder / "my_scan.obj").write_text(obj(mesh))
    (folder / "mesh.obj").write_text(obj(mesh))
    (folder / "my_map.obj").write_text(obj(mesh, uv=True))
    (folder / "scan.ply").write_text(coloured(mesh.vertices))
    (folder / "dense.ply").write_text(coloured(sheet(40).vertices))
    return folder


@pytest.fixture(autouse=True)
def small(monkeypatch, place):
    """What is printed runs as it is, on small models and with small pictures."""
    monkeypatch.chdir(place)
    monkeypatch.setattr(
        models,
        "load",
        lambda case: read_surface(Path(case)) if Path(case).is_file() else sheet(8),
    )
    monkeypatch.setattr(reports, "cores", lambda: 1)
    monkeypatch.setattr(drawing, "SIZE", 48)
    monkeypatch.setattr(scene, "OCCLUSION_RAYS", 0)
    monkeypatch.setattr(scene, "FINE_FACES", 0)
    monkeypatch.setitem(style.STYLE, "savefig.dpi", 40)
    monkeypatch.setattr(metric_speed, "metric_costs", list)
    monkeypatch.setattr(method_speed, "overheads", list)
    monkeypatch.setattr(speed, "training_rates", list)


def sessions() -> set[str]:
    """Names of the sessions of nox."""
    tree = ast.parse((ROOT / "noxfile.py").read_text())
    return {
        node.name
        for node in tree.body
        if isinstance(node, ast.FunctionDef)
        and any(ast.unparse(one).startswith("nox.session") for one in node.decorator_list)
    }


RUN = shlex.split("python -m benchmarks run --cases my_scan.obj --methods lscm --out")
"""A run of one cell into the folder whose name follows."""
README_COMMANDS = [words for block in BLOCKS for words in commands(block)]


@pytest.mark.parametrize("words", README_COMMANDS, ids=" ".join)
def test_a_command_of_the_readme_works_as_printed(words, place):
    if words[0] == "nox":
        assert words[words.index("-s") + 1] in sessions()
        return
    if "pip" in words:
        return
    if {"--texture", "bake"}.intersection(words):  # a large texture takes its time: read alone
        with click.Context(cli.parapoint) as context:
            command = cli.parapoint.resolve_command(context, words[1:])[1]
        command.make_context(words[1], words[2:])
        return
    if "results/new" in words:
        for name in ("new", "old"):
            run([*RUN, f"results/{name}"])
    run(words)
    if "disk" in words:
        assert (place / "results/disk/runs.jsonl").is_file()


def test_the_example_of_the_readme_prints_what_it_says(capsys):
    ((code, printed),) = re.findall(
        r"```python\n(.*?)```\n\n```text\n(.*?)```", README, flags=re.DOTALL
    )
    exec(compile(code, "README.md", "exec"), {})  # noqa: S102 (our own example)
    shown, said = (re.findall(r"\d+|\D+", text) for text in (capsys.readouterr().out, printed))
    assert (shown[:2], shown[3:]) == (said[:2], said[3:])
    assert int(shown[2]) == pytest.approx(int(said[2]), rel=0.3)  # rounding differs by processor


def test_the_readme_can_be_read_in_one_go():
    assert len(README.splitlines()) <= 120


def test_the_commands_of_a_page_name_its_folder_and_work(place):
    out = place / "a folder's"
    run([*RUN, str(out)])
    run(["python", "-m", "reports", str(out)])
    before = sorted(path.name for path in place.iterdir())
    lines = (out / "runs.jsonl").read_bytes()
    page = (out / "report" / "index.html").read_text(encoding="utf-8")
    blocks = [
        html.unescape(block) for block in re.findall(r"<pre><code>(.*?)</code>", page, re.DOTALL)
    ]
    found = [words for block in blocks for words in commands(block)]
    assert [words[:4] for words in found][:1] == [["python", "-m", "benchmarks", "run"]]
    assert len(found) == 3
    for words in found:
        run(words)
    assert sorted(path.name for path in place.iterdir()) == before
    assert (out / "runs.jsonl").read_bytes() == lines  # the very folder, and its cell is done
