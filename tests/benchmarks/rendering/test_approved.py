"""Small pictures as they were when somebody looked at them, in eight by eight mean colours.

`tests/golden/pictures.json` holds them. Another processor's rounding moves a colour by less than
TOLERANCE; a light, a tone or a line that is not where it was moves some by more.
"""

import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks.cases import builtin
from benchmarks.rendering import maps
from benchmarks.rendering.maps import (
    ANGLE_SCALE,
    AREA_SCALE,
    Layout,
    Map,
    heat,
    meshed,
    normal_colours,
    textured,
)
from benchmarks.rendering.scene import Scene
from benchmarks.rendering.viewpoints import two_cameras
from parapoint.surfaces.parameterization import Parameterization

GOLDEN = Path(__file__).parents[2] / "golden" / "pictures.json"
TOLERANCE = 3
"""Levels, of 255, that a mean colour may be off."""
SIZE = 48


def finger() -> Map:
    """A finger under a map that drops a coordinate, so that its far side is turned over."""
    mesh = builtin.finger()
    x, y, z = (mesh.vertices @ np.linalg.qr([[3.0, 1, 0], [1, 2, 1], [0, 1, 4]])[0]).T
    return Map(mesh, Parameterization(np.stack([x + 0.2 * z, y], axis=1), mesh.faces))


def torn_ball() -> Map:
    """A ball by longitude and latitude: the faces across the date line span the seam."""
    mesh = builtin.sphere(3)
    x, y, z = mesh.vertices.T
    uv = np.stack([np.arctan2(y, x), np.arcsin(z)], axis=1)
    return Map(mesh, Parameterization(uv, mesh.faces))


def pictures(found: Map) -> dict[str, np.ndarray]:
    """Pictures of a surface and of its map."""
    scene = Scene(found.mesh)
    front, back = two_cameras(scene)
    view, layout = scene.view(front, SIZE, maps.SAMPLES), Layout(found, SIZE)
    colours = normal_colours(scene, front)
    return {
        "textured": textured(view, found),
        "meshed": meshed(scene.view(back, SIZE, maps.SAMPLES)),
        "angle": view.image(heat(found.angle, ANGLE_SCALE)[view.face]),
        "area in the plane": layout.image(heat(found.area, AREA_SCALE)),
        "normals in the plane": layout.image(colours),
    }


def means(picture: np.ndarray) -> np.ndarray:
    """(64, 4) mean colours of eight by eight parts of a picture."""
    rows = np.array_split(picture.astype(np.float64), 8)
    return np.array([part.mean(axis=(0, 1)) for row in rows for part in np.array_split(row, 8, 1)])


@pytest.mark.parametrize("found", [finger, torn_ball], ids=lambda found: found.__name__)
def test_pictures_look_as_they_did(found):
    golden = json.loads(GOLDEN.read_text())[found.__name__]
    made = pictures(found())
    assert made.keys() == golden.keys()
    for name, picture in made.items():
        apart = np.abs(means(picture) - np.array(golden[name])).max()
        assert apart <= TOLERANCE, f"{name}: {apart:.0f} levels apart"
