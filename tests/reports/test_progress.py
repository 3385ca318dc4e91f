"""What a report tells of itself where no terminal shows it."""

from __future__ import annotations

import io
from collections.abc import Iterator

import pytest
from rich.console import Console

from reports import progress
from reports.progress import QUIET, Shown


@pytest.fixture
def now(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The time in seconds, which goes on only as a test says."""
    clock = [100.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: clock[0])
    return clock


def items(now: list[float], *takes: float) -> Iterator[int]:
    """Numbers from 0, each of which takes so many seconds."""
    for number, seconds in enumerate(takes):
        now[0] += seconds
        yield number


def test_a_report_says_how_far_it_is_once_a_minute_and_at_the_end(
    now: list[float], capsys: pytest.CaptureFixture[str]
) -> None:
    takes = (59.0, 1.0, 59.5, 0.25, 0.25, 2.0)
    assert list(Shown().track(items(now, *takes), "smoke: pictures", 6)) == list(range(6))
    assert capsys.readouterr().err.splitlines() == [
        "smoke: pictures 2/6 (60 s)",
        "smoke: pictures 5/6 (120 s)",
        "smoke: pictures 6/6 (122 s)",
    ]


def test_a_bar_on_a_terminal_is_wiped_off_at_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn = io.StringIO()
    console = Console(file=drawn, force_terminal=True, width=80)
    monkeypatch.setattr(progress, "terminal", lambda **_: console)
    assert list(Shown().track(iter("abc"), "smoke: pictures", 3)) == list("abc")
    assert "smoke: pictures" in drawn.getvalue()
    assert "3/3" in drawn.getvalue()
    assert drawn.getvalue().endswith("\x1b[2K")


def test_nothing_to_do_and_a_quiet_report_say_nothing(
    now: list[float], capsys: pytest.CaptureFixture[str]
) -> None:
    assert list(Shown().track(items(now), "smoke: pictures", 0)) == []
    assert list(QUIET.track(items(now, 99.0, 99.0), "smoke: pictures", 2)) == [0, 1]
    assert capsys.readouterr().err == ""
