"""What is changed, and what is left alone."""

import pytest

pytest.importorskip("cosmic_ray")

from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator

from .mutants import mutants

SOURCE = '''"""Not 1 + 1."""
import os as o
@cache(maxsize=3)
def f(x: int | None = 2, *, y: float) -> int | str:
    σ: int | str = g("σ", -x)
    if not x:
        raise ValueError(f"{1 + 1} is not {2 * y}")
    return zip(*x, y and -x, strict=True)
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


def test_code_is_changed_and_words_hints_and_decorators_are_not():
    assert {(line, "".join(text.split())) for line, text in changed()} == {
        (4, "deff(x:int|None=3,*,y:float)->int|str:"),
        (4, "deff(x:int|None=1,*,y:float)->int|str:"),
        (5, 'σ:int|str=g("σ",x)'),
        (6, "ifx:"),
        (6, "ifnotnotx:"),
        (8, "returnzip(*x,yor-x,strict=True)"),
        (8, "returnzip(*x,yandx,strict=True)"),
    }
