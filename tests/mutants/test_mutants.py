"""What is changed, and what is left alone."""

import pytest

pytest.importorskip("cosmic_ray")

from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator

from .mutants import is_another, mutants

SOURCE = '''"""Not 1 + 1."""
import os as o
@cache(maxsize=3)
def f(x: int | None = 2, *, y: float) -> int | str:
    σ: int | str = g("σ", -x)
    if not x:
        raise ValueError(f"{1 + 1} is not {2 * y}")
    return zip(*x, y and -x, strict=True)
MOST: int = 50
LEAST = 9 * [0.5, 1e9]
if TYPE_CHECKING:
    import g
column = f(x.reshape((-1, 3)), digits=2, figsize=(3, 4)), round(y, 2), default_rng(0)
'''


def changed():
    return {
        (
            line,
            mutate_code(SOURCE, get_operator(f"core/{name}")(), occurrence).splitlines()[line - 1],
        )
        for line, families in mutants(SOURCE).items()
        for choices in families.values()
        for name, occurrence in choices
    }


def test_code_is_changed_but_not_what_is_words_or_looks_or_as_good_another_way():
    assert {(line, "".join(text.split())) for line, text in changed()} == {
        (4, "deff(x:int|None=3,*,y:float)->int|str:"),
        (4, "deff(x:int|None=1,*,y:float)->int|str:"),
        (5, 'σ:int|str=g("σ",x)'),
        (6, "ifx:"),
        (6, "ifnotnotx:"),
        (8, "returnzip(*x,yor-x,strict=True)"),
        (8, "returnzip(*x,yandx,strict=True)"),
        (10, "LEAST=10*[0.5,1e9]"),
        (10, "LEAST=8*[0.5,1e9]"),
        (10, "LEAST=9/[0.5,1e9]"),
        (10, "LEAST=9*[1.5,1e9]"),
        (10, "LEAST=9*[-0.5,1e9]"),
        (13, "column=f(x.reshape((-1,4)),digits=2,figsize=(3,4)),round(y,2),default_rng(0)"),
        (13, "column=f(x.reshape((-1,2)),digits=2,figsize=(3,4)),round(y,2),default_rng(0)"),
    }


def test_a_change_that_is_no_python_or_no_change_is_left_out():
    assert is_another("x = 2", "x = 1")
    assert not is_another("x = (1)", "x = 1")
    assert not is_another("if not x := 1:\n    pass", "if x := 1:\n    pass")
