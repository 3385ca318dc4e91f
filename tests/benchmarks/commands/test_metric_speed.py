"""The speed table of the metrics: its maps, its rows, its figure, and the limit on time."""

import pytest
from PIL import Image

from benchmarks.commands.metric_speed import (
    Cost,
    growth_figure,
    metric_cost,
    metric_table,
    speed_map,
)
from benchmarks.metrics.evaluation import evaluate


@pytest.mark.parametrize(("kind", "charts"), [("disk", 1), ("atlas", 100)])
def test_the_maps_are_what_they_are_called(kind, charts):
    mesh, parameterization = speed_map(kind, 1000)
    values = evaluate(mesh, parameterization)
    assert abs(len(mesh.faces) - 1000) < 50
    assert values["chart_count"] == charts
    assert values["bijective"] == 1
    assert values["quasi_conformal_max"] > 1.01


@pytest.mark.parametrize("kind", ["disk", "atlas"])
def test_a_hundred_thousand_faces_take_a_second(kind):
    cost = metric_cost(kind, 100_000)
    # Processor time, which a busy machine does not change; half as much again for a slow one.
    assert cost.cpu_seconds < 1.5


def test_the_table_and_the_figure(tmp_path):
    costs = [
        Cost("disk", 1_000, 1, 0.01, 0.01, 0.1),
        Cost("disk", 99_000, 1, 0.5, 0.5, 0.2),
        Cost("atlas", 1_000, 100, 0.01, 0.01, 0.1),
    ]
    columns = metric_table(costs).columns
    assert [str(column.header) for column in columns] == [
        *("map", "faces", "charts", "seconds", "CPU seconds", "GB", "µs a face", "limit")
    ]
    cells = [list(column.cells) for column in columns]
    assert [column[1] for column in cells[3:7]] == ["0.500", "0.500", "0.20", "5.1"]
    assert cells[1] == ["1,000", "99,000", "1,000"]
    assert cells[-1] == ["", "1 s, 1 GB", ""]
    growth_figure(costs, tmp_path / "growth.png")
    with Image.open(tmp_path / "growth.png") as image:
        assert image.size == (1350, 600)
