import numpy as np
import pytest
from numpy.testing import assert_allclose

from benchmarks.commands import bake
from benchmarks.commands.bake import looked_up, nearest_baked, wave_colours
from parapoint import InputError, Mesh, Parameterization, PointCloud
from parapoint.surfaces.parameterization import Charted

FACES = np.array([[0, 1, 2], [0, 2, 3]])
PLATE = Charted(
    Mesh([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], FACES),
    Parameterization(np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]]), FACES),
)
RNG = np.random.default_rng(0)


def test_a_texture_is_read_bilinearly_at_the_nearest_place() -> None:
    ramp = np.arange(256, dtype=np.uint8)
    texture = np.stack(np.broadcast_arrays(ramp[None], 255 - ramp[:, None], 0 * ramp[None]), axis=2)
    at = 0.05 + 0.9 * RNG.random((100, 2))
    read = looked_up(PLATE, texture, np.column_stack([at, 0.3 * RNG.random(100)]))
    wanted = (at * 256 - 0.5) / 255
    assert_allclose(read, np.column_stack([wanted, np.zeros(100)]), atol=1e-12)


def test_the_bake_of_today_takes_the_nearest_colour() -> None:
    points = np.array([[0.2, 0.5, 0.0], [0.9, 0.5, 0.0]])
    colours = np.array([[9, 0, 0], [0, 7, 0]], dtype=np.uint8)
    pixels = nearest_baked(PLATE, PointCloud(points, attributes={"colours": colours}), 20)
    assert (pixels[:, :11] == colours[0]).all()
    assert (pixels[:, 11:] == colours[1]).all()


def test_waves_are_no_finer_than_said() -> None:
    line = np.column_stack([np.linspace(0, 1, 5000), np.zeros((5000, 2))])
    steps = np.abs(np.diff(wave_colours(line, 5.0), axis=0)).max() * 5000
    assert 5 < steps < 2 * np.pi * 5 * 12 / 8 * 3


def test_a_failure_is_a_row_and_ours_beats_todays_on_a_small_model(monkeypatch) -> None:
    monkeypatch.setattr(bake, "load", lambda _: PLATE.mesh)
    monkeypatch.setattr(bake, "TEXELS", 128)
    monkeypatch.setattr(bake, "OURS", "computed(points=300)")
    monkeypatch.setattr(bake, "TODAY", ("failing",))
    ours = bake.method("computed(points=300)")

    class Failing:
        def charted(self, _, *, seed):
            assert seed == 0
            raise RuntimeError("no surface")

    monkeypatch.setattr(bake, "method", lambda s: ours if s.startswith("c") else (s, Failing()))
    rows = list(bake.bakings(("plate",), 3000))
    assert [row.reason for row in rows] == ["", "", "no surface", "no surface"]
    assert rows[0].psnr > rows[1].psnr > 15
    assert rows[0].psnr > 30
    monkeypatch.setattr(bake, "load", lambda _: PointCloud(PLATE.mesh.vertices))
    with pytest.raises(InputError, match="is a cloud"):
        list(bake.bakings(("scan",), 3000))
