"""The parts that stand out from a seam, and what they hold."""

import numpy as np
import pytest

from parapoint.planar.peaks import peaks
from parapoint.surfaces.cutting import edge_graph, edge_lengths
from parapoint.surfaces.surface import Mesh


def found(distance: list[float], excess: list[float], price: float) -> dict[int, float]:
    """The peaks of a strip in which a vertex has edges to the next two, at given distances."""
    first = np.arange(len(distance) - 2)
    flipped = first % 2  # every other triangle, so that all are oriented alike
    faces = np.stack([first, first + 1 + flipped, first + 2 - flipped], axis=1)
    rows = np.arange(len(distance))
    mesh = Mesh(np.stack([rows / 2, rows % 2, 0 * rows], axis=1), faces)
    graph = edge_graph(mesh, edge_lengths(mesh))
    return peaks(mesh, graph, np.array(distance), np.array(excess), lambda rise: price * rise)


TWO = [
    0.0,
    2.0,
    3.0,
    1.0,
    0.5,
    2.0,
    2.5,
    0.0,
]  # peaks at 2 and 6, which meet at 3, at a height of 1
EXCESS = [1.0, 0.25, 0.25, 0.5, 0.5, 1.0]


@pytest.mark.parametrize(
    ("price", "expected"),
    [
        # The part of 6 stands 1.5 above where they meet, and holds the last three faces.
        (1.3, {2: 1.5, 6: 2.0}),
        (1.4, {2: 3.5}),
    ],
)
def test_a_lower_part_that_cannot_pay_belongs_to_the_higher(price, expected) -> None:
    assert found(TWO, EXCESS, price) == expected


def test_a_spike_of_one_vertex_holds_all_of_its_faces() -> None:
    assert found([1.0, 1.0, 4.0, 1.0, 1.0], [1.0, 2.0, 3.0], 0.1)[2] == 6.0


def test_parts_that_meet_on_the_seam_alone_are_apart_at_any_price() -> None:
    distance = [1.0, 0.5, 0.0, 0.0, 0.7, 0.9]
    assert found(distance, [1.0, 2.0, 3.0, 4.0], 1e9) == {0: 3.0, 5: 7.0}
