"""Every numeric option of every command: what is no sound number is one line, and nothing is done.

The options are found in the commands themselves, so that a new one is held as well.
"""

from collections.abc import Iterator
from pathlib import Path

import click
import numpy as np
import pytest

from parapoint import console
from parapoint.cli import parapoint
from parapoint.computed.computed_map import ComputedMap
from parapoint.errors import InputError
from parapoint.estimator import load

NO_NUMBERS = ("nan", "inf", "-inf", "", " ", "x", "0x10", "1" * 5000)
HUGE = ("1e308", str(10**23), "-1", "-1e308")
BOUNDLESS = {"--seam-price", "--max-distortion"}
"""Options for which a huge number means what it says: no branch is worth it, or none is asked."""


def numeric() -> Iterator[tuple[str, str]]:
    """Each command with each of its options that is a number."""
    for name in parapoint.list_commands(click.Context(parapoint)):
        _, command, _ = parapoint.resolve_command(click.Context(parapoint), [name])
        assert command is not None
        for option in command.params:
            if isinstance(option.type, (click.types.IntParamType, click.types.FloatParamType)):
                yield name, option.opts[0]


OPTIONS = sorted(numeric())


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A mesh, its map, a cloud and a model of it."""
    folder = tmp_path_factory.mktemp("absurd")
    points = np.random.default_rng(0).uniform(-1, 1, (200, 3)) * [1, 1, 0]
    np.savetxt(folder / "cloud.xyz", np.insert(points, 3, [[1], [2], [3]], axis=1))
    square = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n"
    (folder / "mesh.obj").write_text(square)
    ComputedMap().fit(points).save(folder / "model")
    return folder


def test_there_are_options_to_hold() -> None:
    assert {name for name, _ in OPTIONS} == {"unwrap", "fit", "map", "bake"}
    assert len(OPTIONS) > 18


@pytest.mark.parametrize(("name", "option"), OPTIONS)
def test_absurd_numbers_are_one_line(
    name: str, option: str, folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given = {
        "unwrap": ["mesh.obj", "--out", "a.obj"],
        "fit": ["cloud.xyz", "--out", "m", "--preset", "paper"],
        "map": ["model", "cloud.xyz", "--out", "a.npz"],
        "bake": ["mesh.obj", "cloud.xyz", "--map", "colour", "--out", "a.png"],
    }[name]
    paths = [str(folder / word if (folder / word).exists() else word) for word in given]
    at = paths.index("--out") + 1
    paths[at] = str(tmp_path / paths[at])
    for value in NO_NUMBERS + (() if option in BOUNDLESS else HUGE):
        with pytest.raises(SystemExit) as end:
            console.run(parapoint, [name, *paths, option, value])
        shown = capsys.readouterr()
        assert (end.value.code, shown.out, shown.err.count("\n")) == (2, "", 1), (value, shown.err)
        assert len(shown.err) < 2100, value
        assert option in shown.err, value
        assert not list(tmp_path.iterdir()), value


def test_a_device_that_is_none_is_told(folder: Path) -> None:
    """Also where the model needs none."""
    with pytest.raises(InputError, match="device must be one of auto, cpu, cuda"):
        load(folder / "model", device="abacus")
