"""What a file paints on its mesh, seen through the old UVs and painted through the new ones."""

from pathlib import Path

import numpy as np
import pytest

from parapoint import Mesh, Parameterization
from parapoint.commands.mesh_output import MeshOutput
from parapoint.files.meshes.painting import Painting
from parapoint.files.meshes.pictures import WHITE, Material, Wrap
from parapoint.files.reading import Polygons
from parapoint.surfaces.parameterization import Charted
from parapoint.textures.repainting import repainted

UV = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
FACES = np.array([[0, 1, 2], [0, 2, 3]])
SQUARE = Charted(Mesh(np.pad(UV, ((0, 0), (0, 1))), FACES), Parameterization(UV, FACES))
GREY = np.full((4, 4, 3), 200, dtype=np.uint8)
ROSE = (255, 137, 137)
"""As sRGB, what is 1, 1/4, 1/4 as light."""


@pytest.mark.parametrize(
    ("material", "tints", "seen"),
    [
        (Material(ROSE, GREY), True, [200, 106, 106]),
        (Material(ROSE, GREY), False, [200] * 3),
        (Material((0, 0, 0), GREY), True, [0] * 3),
        (Material(WHITE, GREY), True, [200] * 3),
        (Material(ROSE), True, ROSE),
        (Material(ROSE, np.dstack([GREY, GREY[..., :1] // 2])), True, [200, 106, 106, 100]),
        (Material((255, 12, 255), GREY // 200 * 20), True, [20, 0, 20]),
    ],
)
def test_a_colour_tints_a_picture_as_light_does(
    material: Material, tints: bool, seen: list[int]
) -> None:
    painting = Painting((material,), np.zeros(2, dtype=np.int64), UV[FACES])
    picture = repainted(SQUARE, painting, 16, tints=tints)
    assert np.abs(picture.astype(int) - seen).max() <= 1


@pytest.mark.parametrize(("source", "seen"), [("a.glb", 106), ("a.GLTF", 106), ("a.obj", 200)])
def test_only_the_colours_of_gltf_tint_pictures(source: str, seen: int) -> None:
    """In a Wavefront library they stand for the picture, and are often black beside one."""
    painting = Painting((Material(ROSE, GREY),), np.zeros(2, dtype=np.int64), UV[FACES])
    given = Polygons(SQUARE.mesh, FACES, np.arange(2), ())
    output = MeshOutput(given, Path(source), Path("new.ply"), 16, 4, asked=False, painting=painting)
    assert abs(int(output.picture(SQUARE)[0, 0, 1]) - seen) <= 1


STRIPES = np.repeat(np.array([[[10], [60], [110], [160]]], dtype=np.uint8), 3, axis=2)
"""One line of four texels."""
BEYOND = {
    "repeat": [10, 60, 110, 160, 10, 60, 110, 160, 10, 60, 110, 160],
    "mirror": [160, 110, 60, 10, 10, 60, 110, 160, 160, 110, 60, 10],
    "clamp": [10, 10, 10, 10, 10, 60, 110, 160, 160, 160, 160, 160],
}
"""What is seen from -1 to 2 at the middles of texels."""


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("wrap", ["repeat", "mirror", "clamp"])
def test_a_picture_goes_on_as_its_material_says(wrap: Wrap, axis: int) -> None:
    """Along either axis; the other one repeats."""
    wraps: tuple[Wrap, Wrap] = (wrap, "repeat") if axis == 0 else ("repeat", wrap)
    shown = STRIPES if axis == 0 else STRIPES.transpose(1, 0, 2)[::-1]
    uv = UV[FACES] * 3 - 1
    painting = Painting((Material(picture=shown, wraps=wraps),), np.zeros(2, dtype=np.int64), uv)
    picture = repainted(SQUARE, painting, 12)[..., 0]
    along = picture[6] if axis == 0 else picture[::-1, 6]
    assert along.tolist() == BEYOND[wrap]
