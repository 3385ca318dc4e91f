"""Every command ends with one clear line and exit status 2 on wrong use or input."""

import subprocess
import sys

import click
import pytest

from parapoint import InputError, console


def test_bad_input_is_one_line_and_status_two(capsys):
    @click.command
    def command():
        raise InputError("model.obj: no faces;\nadd some")

    with pytest.raises(SystemExit) as caught:
        console.run(command, [])
    assert caught.value.code == 2
    assert capsys.readouterr() == ("", "error: model.obj: no faces; add some\n")


def test_wrong_usage_is_one_line_and_status_two(capsys):
    @click.command
    @click.option("--number", type=int)
    def command(number):
        raise AssertionError(number)

    with pytest.raises(SystemExit) as caught:
        console.run(command, ["--number", "many"])
    assert caught.value.code == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert "many" in err


def test_a_bug_is_not_dressed_up_as_bad_input():
    @click.command
    def command():
        raise ValueError("ours")

    with pytest.raises(ValueError, match="ours"):
        console.run(command, [])


@pytest.mark.parametrize("stderr", [False, True])
def test_what_is_no_terminal_gets_neither_colours_nor_bars(stderr, monkeypatch, capsys):
    monkeypatch.setenv("FORCE_COLOR", "1")  # as Jupyter sets it
    shown = console.terminal(stderr=stderr)
    assert not shown.is_terminal
    shown.print("[bold red]plain")
    assert "".join(capsys.readouterr()) == "plain\n"


def test_a_package_that_is_not_installed_is_one_line(capsys):
    @click.command
    def command():
        import no_such_package

        no_such_package.use()

    with pytest.raises(SystemExit) as caught:
        console.run(command, [])
    assert caught.value.code == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert err.startswith("error: no_such_package is not installed; ")


@pytest.mark.parametrize("module", ["parapoint", "baselines.registry", "benchmarks", "reports"])
def test_light_imports_leave_torch_out(module):
    code = f"import sys, {module}; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_text_from_elsewhere_is_shown_as_text_alone() -> None:
    assert console.printable("Fläche 3 → uv") == "Fläche 3 → uv"
    assert console.printable("a\x1b[31mb\u202ec\n\ud800") == r"a\x1b[31mb\u202ec\n\ud800"
    assert console.printable("abcdef", longest=6) == "abcdef"
    cut = [console.printable(text, longest=6) for text in ("abcdefg", "abcdefh")]
    assert all(text.startswith("abcdef… (") and len(text) == 16 for text in cut)
    assert cut[0] != cut[1]


@pytest.mark.parametrize(
    ("outcome", "status", "said"),
    [
        (None, 0, ""),
        (3, 3, ""),
        ("done", 0, ""),
        (KeyboardInterrupt(), 130, "interrupted"),
        (click.Abort(), 130, "interrupted"),
        (InputError("no  such\nthing"), 2, "error: no such thing"),
        (ModuleNotFoundError("x", name="shapely"), 2, "error: shapely is not installed"),
        (FileNotFoundError(2, "No such file", "a.obj"), 2, "error: a.obj: no such file"),
        (OSError("gone"), 2, "error: gone"),
        (OSError(28, "No space left"), 2, "error: no space left"),
        (click.UsageError("Too many."), 2, "error: Too many"),
        (click.ClickException("Bad thing"), 2, "error: Bad thing"),
    ],
)
def test_a_command_ends_with_its_status_and_one_line(capsys, outcome, status, said):
    @click.command()
    def ending():
        if isinstance(outcome, BaseException):
            raise outcome
        return outcome

    with pytest.raises(SystemExit) as ended:
        console.run(ending, [])
    assert ended.value.code == status
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == bool(said)
    assert "".join(lines).startswith(said)
