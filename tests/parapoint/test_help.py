"""Help comes at once, says what it should, and completes names in a shell."""

import subprocess
import sys

import click
import pytest
from rich.console import Console

from benchmarks import __main__ as benchmarks
from benchmarks.commands import listing, tables
from parapoint import __version__, cli, console
from reports import __main__ as reports

GROUPS = {"parapoint": cli.parapoint, "python -m benchmarks": benchmarks.main}


NEEDS_NOTHING = {"run", "speed", "bake"}
"""Commands that do their work when nothing is said."""


def ended(program, arguments, capsys):
    """Exit status, output and errors of a command."""
    with pytest.raises(SystemExit) as caught:
        console.run(program, arguments)
    return caught.value.code, *capsys.readouterr()


def resolved(group, name):
    with click.Context(group) as context:
        return group.resolve_command(context, [name])[1]


@pytest.mark.parametrize("group", GROUPS.values(), ids=GROUPS)
def test_a_summary_in_the_help_is_the_first_sentence_of_the_command(group):
    for name, placeholder in group.commands.items():
        command = resolved(group, name)
        assert command.get_short_help_str(200) == placeholder.get_short_help_str(200), name


@pytest.mark.parametrize(
    ("program", "arguments"),
    [
        (cli.parapoint, []),
        *((cli.parapoint, [name]) for name in cli.parapoint.commands),
        (benchmarks.main, []),
        *((benchmarks.main, [n]) for n in benchmarks.main.commands if n not in NEEDS_NOTHING),
        (reports.main, []),
    ],
)
def test_a_bare_command_prints_its_whole_help(program, arguments, capsys):
    status, out, err = ended(program, arguments, capsys)
    assert (status, out) == (2, "")
    assert err.startswith("Usage: ")
    assert "--help" in err
    assert all(len(line) <= 80 for line in err.splitlines())


@pytest.mark.parametrize("program", [cli.parapoint, benchmarks.main, reports.main])
def test_the_version_is_told(program, capsys):
    status, out, _ = ended(program, ["--version"], capsys)
    assert status == 0
    assert __version__ in out


def test_wrong_usage_names_the_help_that_would_help(capsys):
    status, out, err = ended(cli.parapoint, ["fit", "cloud.ply", "--oot", "x"], capsys)
    assert (status, out) == (2, "")
    assert err.count("\n") == 1
    assert "--oot" in err
    assert "fit --help)" in err


@pytest.mark.parametrize("module", ["parapoint.cli", "parapoint.__main__"])
def test_help_imports_nothing_heavy(module):
    code = (
        f"import sys; sys.argv = ['parapoint', '--help']\n"
        f"try:\n    import {module} as m; m.main()\n"
        "except SystemExit: pass\n"
        "print('loaded', {'torch', 'scipy', 'igl', 'numpy', 'rich'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "unwrap" in done.stdout
    assert done.stdout.endswith("loaded set()\n")


def test_a_shell_completes_commands_and_options():
    def completed(words):
        from click.shell_completion import BashComplete

        complete = BashComplete(cli.parapoint, {}, "parapoint", "_PARAPOINT_COMPLETE")
        return {item.value for item in complete.get_completions(words[:-1], words[-1])}

    assert completed(["un"]) == {"unwrap"}
    assert "--distortion" in completed(["fit", "--dis"])


@pytest.mark.parametrize("what", listing.LISTS)
@pytest.mark.parametrize("width", [60, 80])
def test_a_list_fits_a_terminal_and_keeps_every_word(what, width):
    table = listing.LISTS[what]()
    shown = Console(force_terminal=True, color_system=None, width=width)
    with shown.capture() as capture:
        shown.print(tables.entries(table))
    lines = capture.get().splitlines()
    assert all(len(line) <= width for line in lines)
    text = "".join("".join(lines).split())
    for column in table.columns:
        assert all("".join(str(cell).split()) in text for cell in column.cells)


WITHOUT_TORCH = "import sys; sys.modules['torch'] = None; from parapoint import console\n"
OURS = "from parapoint.cli import parapoint as main"
BENCHMARKS = "from benchmarks.__main__ import main"


def without_torch(program, words, folder):
    code = f"{WITHOUT_TORCH}{program}\nconsole.run(main, {words})"
    command = [sys.executable, "-c", code]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


@pytest.mark.parametrize(
    ("program", "words"),
    [
        (OURS, ["fit", "x", "--out", "y", "--preset", "paper"]),
        (BENCHMARKS, ["run", "paper"]),
        (BENCHMARKS, ["run", "--methods", "fam", "--cases", "saddle"]),
    ],
)
def test_where_torch_is_missing_one_line_says_what_would_do(program, words, tmp_path):
    done = without_torch(program, words, tmp_path)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "pip install torch" in done.stderr
    assert not list(tmp_path.iterdir())


def test_without_torch_a_suite_tells_the_way_without_it(tmp_path):
    done = without_torch(BENCHMARKS, ["run", "smoke"], tmp_path)
    assert "--methods" in done.stderr
    spec = ["run", "--methods", "fam", "--cases", "saddle"]
    assert "--methods" not in without_torch(BENCHMARKS, spec, tmp_path).stderr


def test_without_torch_the_list_of_suites_is_the_same(tmp_path, capsys):
    done = without_torch(BENCHMARKS, ["list", "suites"], tmp_path)
    assert ended(benchmarks.main, ["list", "suites"], capsys) == (0, done.stdout, "")


def test_without_torch_everything_else_is_listed(tmp_path):
    done = without_torch(BENCHMARKS, ["list", "methods"], tmp_path)
    lines = {line.split("\t")[0]: line for line in done.stdout.splitlines()}
    assert "pip install torch" in lines["nuvo"]
    assert "pip install torch" not in lines["computed"] + lines["slim"]
