"""A mesh, drawn under any map."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from PIL import Image as Images

from benchmarks.rendering.colours import Image
from benchmarks.rendering.maps import (
    ANGLE_SCALE,
    AREA_SCALE,
    FIELDS,
    SAMPLES,
    Layout,
    Map,
    heat,
    meshed,
    normal_colours,
    textured,
)
from benchmarks.rendering.scene import Scene
from benchmarks.rendering.viewpoints import two_cameras
from parapoint.errors import InputError
from parapoint.files.targets import complete_file, write_text
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import Mesh
from reports.page import viewer
from reports.pictures import clouds
from reports.pictures.curves import Curves, curves, written
from reports.pictures.names import CLOUD_PICTURES, CURVES, MODEL_PICTURES, VIEWED

Content = Image | viewer.Script | Curves
"""What is in a file: a picture, what the viewer reads, or what figures draw as curves."""


class Portrait:
    """A mesh, ready to be drawn under any map."""

    def __init__(self, mesh: Mesh, size: int) -> None:
        """Pictures of `size` pixels."""
        self.mesh = mesh
        self._size = size
        self._scene = Scene(mesh)
        cameras = two_cameras(self._scene)
        self._views = [self._scene.view(camera, size, SAMPLES) for camera in cameras]

    def model(self) -> Mapping[str, Content]:
        """The files of the mesh itself by their kind."""
        made: dict[str, Content] = {
            kind: meshed(view) for kind, view in zip(MODEL_PICTURES, self._views, strict=True)
        }
        sky = self._scene.coarse_openness
        return made | {VIEWED: viewer.shape(self.mesh, self._views[0].camera, sky)}

    def map(
        self, result: object, kinds: Sequence[str], points: int = clouds.SPARSE
    ) -> Mapping[str, Content]:
        """The files of a map by their kind, those of `kinds`; a cloud is drawn of `points`.

        Raises:
            InputError: the map is not of this mesh, or there is nothing to see.
        """
        if not isinstance(result, Parameterization) or len(result.corners) != len(self.mesh.faces):
            raise InputError("the map is not of this mesh")
        found = Map(self.mesh, result)
        if not found.has_area:
            raise InputError("the map has no area")
        first, second = self._views
        layout = Layout(found, self._size)
        colours = normal_colours(self._scene, first.camera)

        makers: dict[str, Callable[[], Content]] = {
            "checker-1": lambda: textured(first, found),
            "checker-2": lambda: textured(second, found),
            "layout": lambda: layout.image(colours),
            "angle": lambda: first.image(heat(found.angle, ANGLE_SCALE)[first.face]),
            "angle-uv": lambda: layout.image(heat(found.angle, ANGLE_SCALE)),
            "area": lambda: first.image(heat(found.area, AREA_SCALE)[first.face]),
            "area-uv": lambda: layout.image(heat(found.area, AREA_SCALE)),
            CURVES: lambda: curves(found),
            VIEWED: lambda: viewed(found),
        }
        made = {kind: makers[kind]() for kind in kinds if kind in makers}
        if CLOUD_PICTURES[0] in kinds:
            # From the side that shows more of the flips, if there are any.
            view = max(self._views, key=lambda one: int(found.flipped[one.face].sum()))
            made |= clouds.images(view, found, colours, FIELDS / self._scene.size, points)
        return made


def viewed(found: Map) -> viewer.Script:
    """Facts and arrays of a map, as the viewer draws it."""
    return viewer.uv_map(
        found.mesh,
        found.parameterization,
        found.uv,
        distortion={
            "angle": (found.angle, *ANGLE_SCALE[1:]),
            "area": (found.area, *AREA_SCALE[1:]),
        },
        spanning=found.spanning,
        flipped=found.flipped,
        covered=found.covered,
    )


def save(content: Content, path: Path) -> None:
    """Write curves, a script, or a picture as WebP: the same content gives the same bytes."""
    if isinstance(content, Curves):
        write_text(path, json.dumps(written(content)) + "\n")
    elif isinstance(content, tuple):
        write_text(path, viewer.script(path.name, *content))
    else:
        with complete_file(path) as file:
            Images.fromarray(content).save(file, format="WebP", quality=78, method=2)
