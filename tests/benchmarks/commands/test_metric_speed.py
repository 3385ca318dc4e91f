"""The speed table of the metrics: its maps, its rows, its figure, and the limit on time."""

from pathlib import Path

import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
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
    assert values["packing_efficiency"] > 0.1  # no long strip of charts


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


def test_the_figure_has_time_and_memory_of_each_kind_and_a_line_to_compare_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    costs = [
        *(Cost("disk", 1_000, 1, 0.1, 0.01, 0.3), Cost("disk", 10_000, 1, 0.5, 0.5, 0.4)),
        *(Cost("atlas", 1_000, 100, 0.2, 0.01, 0.5), Cost("atlas", 20_000, 2000, 1.0, 0.5, 0.6)),
    ]
    kept: list[Figure] = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, *_, **__: kept.append(figure))
    growth_figure(costs, tmp_path / "growth.png")

    def drawn(axes: Axes) -> dict[str, list[tuple[float, float]]]:
        lines = {str(line.get_label()): line.get_xydata() for line in axes.lines}
        return {name: [tuple(point) for point in points] for name, points in lines.items()}

    time, memory = kept[0].axes
    assert drawn(time)["disk"] == [(1_000, 0.1), (10_000, 0.5)]
    assert drawn(time)["atlas"] == [(1_000, 0.2), (20_000, 1.0)]
    assert drawn(memory)["disk"] == [(1_000, 0.3), (10_000, 0.4)]
    assert drawn(memory)["atlas"] == [(1_000, 0.5), (20_000, 0.6)]
    # In proportion to the faces, through the largest disk, from the fewest faces to the most.
    ends = [value for point in drawn(time)["linear"] for value in point]
    assert ends == pytest.approx([1_000, 0.05, 20_000, 1.0])
    assert {axes.get_xscale() for axes in kept[0].axes} == {"log"}
    assert [axes.get_ylabel() for axes in kept[0].axes] == ["seconds", "peak memory, GB"]
