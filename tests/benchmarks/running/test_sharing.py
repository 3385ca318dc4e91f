"""Parts of a surface share the time budget of a method by their area."""

from dataclasses import dataclass
from typing import ClassVar

import pytest

from benchmarks.running.sharing import LEAST, sharing
from parapoint.surfaces.surface import Mesh
from parapoint.testing import irregular_disk


@dataclass(frozen=True)
class Budgeted:
    """Says how many seconds it was given, in place of a map."""

    time_budget: float | None = 10.0
    other: int = 3

    requires: ClassVar[frozenset[str]] = frozenset()

    def parameterize(self, surface, *, seed):
        return self.time_budget, self.other, len(surface.faces), seed


def sized(times):
    mesh = irregular_disk()
    return Mesh(mesh.vertices * times, mesh.faces)


def test_a_part_gets_as_much_time_as_it_has_area():
    parts = [sized(1), sized(2), sized(1e-9)]
    made = sharing(Budgeted(other=5), parts)
    found = [made.parameterize(part, seed=7) for part in parts]
    assert [budget for budget, *_ in found] == pytest.approx([2, 8, LEAST])
    assert {(other, faces, seed) for _, other, faces, seed in found} == {
        (5, len(parts[0].faces), 7)
    }


def test_one_part_and_a_method_without_a_budget_are_left_as_they_are():
    one, without = Budgeted(), Budgeted(None)
    assert sharing(one, [sized(1)]) is one
    assert sharing(without, [sized(1), sized(2)]) is without
