"""Files as other tools write them: none is read wrong, and the check finds one that is."""

from pathlib import Path

import pytest
from click.testing import CliRunner

from benchmarks.checks import wild
from parapoint.errors import InputError
from parapoint.files.reading import read_surface


@pytest.mark.parametrize("family", wild.FAMILIES)
def test_every_file_of_a_family_is_right(family: str, tmp_path: Path) -> None:
    """Five at least, most of them read."""
    cases = list(wild.FAMILIES[family]())
    assert len({case.name for case in cases}) == len(cases) >= 5
    found = wild.tally(cases, tmp_path)
    assert not found.wrong
    assert found.read + found.refused == len(cases)
    assert found.refused == sum(case.may_refuse for case in cases)


def test_a_wrong_file_and_a_refusal_are_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A refusal is right only where it may be."""

    def refuses(path: Path) -> bool:
        read_surface(path)
        raise InputError("no")

    line = b"1 2 3\n"
    cases = [
        wild.Case("right.xyz", line, lambda _: True),
        wild.Case("wrong.xyz", line, lambda _: False),
        wild.Case("refused.xyz", line, refuses),
        wild.Case("may_refuse.xyz", line, refuses, may_refuse=True),
    ]
    assert wild.tally(cases, tmp_path) == (1, 2, ["wrong.xyz", "refused.xyz"])
    monkeypatch.setattr(wild, "FAMILIES", {"four": lambda: iter(cases)})
    ended = CliRunner().invoke(wild.main)
    assert ended.exit_code == 1
    assert "four: 4 files, 1 read, 2 refused (50%), wrong: wrong.xyz, refused.xyz" in ended.output


@pytest.mark.parametrize(
    ("family", "name", "other_family", "other"),
    [
        ("polygons", "l0.obj", "polygons", "arrow0.obj"),  # another area
        ("split vertices", "soup.obj", "polygons", "l0.obj"),  # no seam
        ("glTF", "plain.gltf", "glTF", "scaled.gltf"),  # another area
        ("glTF", "plain.gltf", "glTF", "twice.gltf"),  # more faces
        ("LAS", "whole_8.las", "LAS", "low_noise_8.las"),  # fewer points
        ("LAS", "whole_8.las", "LAS", "whole_16.las"),  # colours of more bits
        ("marks", "utf-16.xyz", "writers", "writer_0.obj"),  # other points
    ],
)
def test_a_file_that_means_something_else_is_wrong(
    family: str, name: str, other_family: str, other: str, tmp_path: Path
) -> None:
    own = {case.name: case for case in wild.FAMILIES[family]()}[name]
    another = {case.name: case for case in wild.FAMILIES[other_family]()}[other]
    path = tmp_path / other
    path.write_bytes(another.data)
    assert another.is_right(path)
    assert not own.is_right(path)
