import numpy as np
import pytest

from benchmarks.commands.heatmap import _scale_end, write_heatmap
from benchmarks.metrics.state import MapState
from parapoint.errors import InputError
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import Mesh


@pytest.mark.parametrize(
    ("ratios", "end"),
    [
        ([1.0] * 20, 1.05),
        ([1.0] * 20 + [50.0], 1.05),  # one face of twenty-one may lie beyond the scale
        ([1.0] * 10 + [1.9] * 10, 2.0),
        ([1.0] * 18 + [3.0] * 3, 4.0),  # three of twenty-one are more than a twentieth
        ([1e6] * 20, 100.0),
        ([np.nan] * 3, 1.05),
        ([1.2, np.nan], 1.2),
    ],
)
def test_the_scale_ends_at_the_first_ratio_that_most_do_not_exceed(ratios, end):
    assert 2 ** _scale_end(np.log2(ratios)) == pytest.approx(end)


def test_a_map_without_area_has_no_heatmap(tmp_path):
    mesh = Mesh(np.eye(3), [[0, 1, 2]])
    flat = MapState(mesh, Parameterization([[0.0, 0], [1, 0], [2, 0]], mesh.faces))
    with pytest.raises(InputError, match="line: the map has no area in the UV plane"):
        write_heatmap(flat, tmp_path / "heat.png", title="line")
    assert not (tmp_path / "heat.png").exists()
