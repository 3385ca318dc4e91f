"""`reports --memory`, which the message about packed maps advises."""

import pytest

from parapoint.files import decoding
from reports.pictures import workers


def _allowed() -> float:
    return decoding.allowed()


def test_the_bound_holds_in_the_processes_that_draw_too() -> None:
    token = decoding._allowed.set(decoding.DECODED_LEAST)
    try:
        decoding.allow(3e9)
        assert list(workers.done_by_several(_allowed, [(), ()], 2)) == [3e9, 3e9]
    finally:
        decoding._allowed.reset(token)


def test_reports_takes_the_option(capsys: pytest.CaptureFixture[str], tmp_path) -> None:
    from parapoint import console
    from reports.__main__ import main

    for text, said in (("nan", "--memory"), ("-1", "--memory"), ("4", "no results folder|holds")):
        with pytest.raises(SystemExit) as ended:
            console.run(main, [str(tmp_path), "--memory", text])
        assert ended.value.code == 2
        error = capsys.readouterr().err
        assert error.count("\n") == 1
        assert any(part in error for part in said.split("|")), error
