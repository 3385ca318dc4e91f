"""Files of any name that the system takes are written, read back, and shown as plain text."""

import logging

import numpy as np
import pytest

from parapoint import Mesh, Parameterization, cli
from parapoint.files.meshes.painting import painting_of
from parapoint.files.reading import read_polygons
from parapoint.files.writing.mesh_writers import write_textured
from parapoint.surfaces.parameterization import Charted

NAMES = {
    "Latin-1": "lat\udcf6",
    "Japanese": "日本",
    "blank": "two words",
    "escape": "esc\x1b[31m",
    "line": "new\nline",
    "quote": 'quo"te',
    "backslash": "back\\slash",
    "number sign": "#1",
}
"""Names: one in Latin-1, which is not UTF-8; others have signs that a file or a terminal obeys."""
CORNERS = np.array([[0.1, 0.1], [0.9, 0.1], [0.9, 0.9], [0.1, 0.9]])
SQUARE = Mesh(np.c_[CORNERS, np.zeros(4)], [[0, 1, 2], [0, 2, 3]])
TEXELS = 16


@pytest.mark.parametrize(
    ("sign", "ending"),
    [*((sign, ".obj") for sign in NAMES), *(("Latin-1", of) for of in (".ply", ".glb", ".npz"))],
)
def test_a_mesh_of_any_name_is_written_and_shows_its_texture(
    sign, ending, tmp_path, capsys, monkeypatch
) -> None:
    """Written anew, and again with other UVs: each file finds its picture."""
    name = NAMES[sign]
    # pytest's workers cannot hand over a log that holds such a name.
    monkeypatch.setattr(logging.getLogger("parapoint"), "disabled", True)
    given = tmp_path / f"{name}.obj" if ending != ".ply" else tmp_path / f"{name}.ply"
    texture = np.full((TEXELS, TEXELS, 3), 9, dtype=np.uint8)
    write_textured(given, Charted(SQUARE, Parameterization(CORNERS, SQUARE.faces)), texture)
    files = [given, tmp_path / f"{name} again{ending}"]
    arguments = ["unwrap", str(given), "--out", str(files[1]), "--texture", str(TEXELS)]
    with pytest.raises(SystemExit) as end:
        cli.console.run(cli.parapoint, arguments)
    assert not end.value.code
    shown = capsys.readouterr().out
    assert shown.count("\n") == 4
    assert all(letter.isprintable() for letter in shown.replace("\n", ""))
    for file in files if ending != ".npz" else files[:1]:
        polygons = read_polygons(file)
        painting = painting_of(file, polygons.polygon_of, polygons.uv)
        assert painting is not None
        assert painting.largest == TEXELS
