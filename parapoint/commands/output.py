"""What commands write: a surface with the map of a fitted model, in the unit square."""

from __future__ import annotations

import logging
import time
from pathlib import Path

import numpy as np

from parapoint.commands.progress import Tell, baking, untold
from parapoint.errors import InputError
from parapoint.estimator import Estimator
from parapoint.files.targets import beside, checked_picture, checked_target
from parapoint.files.writing.mesh_writers import write_npz, write_ply, write_textured
from parapoint.files.writing.point_writers import write_points
from parapoint.fitting import Progress
from parapoint.surfaces.across_seams import Transform, edges_across_seam, opened
from parapoint.surfaces.parameterization import Charted
from parapoint.surfaces.sampling import mean_spacing
from parapoint.surfaces.strays import NAMED, are_near, far_from, named, unmapped
from parapoint.surfaces.surface import BoolArray, Mesh, PointCloud, Surface
from parapoint.textures.baking import MARGIN, baked
from parapoint.textures.checkerboard import checkerboard
from parapoint.textures.placing import BORDER, Placing
from parapoint.textures.preview import write_preview
from parapoint.unwrapping.quality import quality

logger = logging.getLogger("parapoint")

ENDINGS = (".obj", ".glb", ".ply", ".npz")
"""Endings of files that a map can be written to."""
SIDES = {".obj": (".mtl", ".png"), ".ply": (".png",)}
"""Endings of the files beside a textured mesh."""
TEXTURE = 2048
"""Texels along a side of a texture, if none were asked for."""
Y_UP = (".obj", ".glb", ".gltf")
"""Endings of files in which y is upwards by rule or by custom; in others it is z."""


def target(out: str, inputs: list[str], *, force: bool, textured: bool) -> str:
    """The file to write for `out`, checked before any work (`parapoint.files.targets`).

    Args:
        out: the file that the user named.
        inputs: the files that are read.
        force: replace whatever is there.
        textured: whether a texture was asked for.

    Raises:
        InputError: its ending is none of ENDINGS, or it cannot or may not be written.
    """
    ending = Path(out).suffix.lower()
    if ending not in ENDINGS:
        raise InputError(f"{out}: cannot write this ending; take {', '.join(ENDINGS)}")
    sides = SIDES.get(ending, ()) if textured or ending == ".obj" else ()
    return str(checked_target(out, sides=sides, inputs=inputs, force=force))


def preview_target(preview: str, out: str, inputs: list[str], *, force: bool) -> Path:
    """The file for the picture beside `out`, checked before any work.

    Raises:
        InputError: it is no .png or the texture of `out`; it cannot be written, or may not, as a
            picture of the user's.
    """
    path = checked_picture(preview, inputs=inputs, force=force, is_side=True)
    is_textured = Path(out).suffix.lower() in SIDES
    if is_textured and path.resolve() == beside(Path(out).resolve(), ".png"):
        raise InputError(f"{preview}: is the texture of {out}; take another name")
    return path


def write(
    model: Estimator,
    surface: Surface,
    out: str,
    *,
    texture: int | None = None,
    margin: int | None = None,
    preview: Path | None = None,
    is_y_up: bool = False,
    tell: Tell = untold,
    is_fitted: bool = True,
) -> dict[str, object]:
    """Map a surface into the unit square and write it; what was written, as facts.

    Args:
        model: the fitted model.
        surface: a mesh, which is written with its map; or a cloud, whose points are written with
            theirs, or whose colours are baked into the texture of the model's mesh.
        out: the file.
        texture: texels along a side of a texture, or None; .glb has one always.
        margin: texels that stay free around the map, and that repeat the edge of each chart; if
            None, 1 / 256 of the side and MARGIN.
        preview: a PNG file for a picture of the surface beside its layout, or None.
        is_y_up: whether y points upwards in that picture, not z.
        tell: is called with each `Progress`.
        is_fitted: whether the surface is that which the model was fitted to.
    """
    begun = time.perf_counter()
    tell(Progress("mapping"))
    ending = Path(out).suffix.lower()
    size = texture or TEXTURE
    charted = model.mesh()
    placing = Placing.smallest(charted.map.uv, BORDER if margin is None else margin / size)
    shown, pixels = placing.of(charted), checkerboard(size)
    facts: dict[str, object] = {"file": out}
    if isinstance(surface, Mesh):
        shown = _mapped(model, surface, placing, out)
        spanning = (shown.map.corners != surface.faces).any(1).sum()
        facts |= {"mapped_points": len(surface.vertices), "spanning_faces": int(spanning)}
        tell(Progress("writing"))
        if ending == ".npz":
            write_npz(out, shown)
        elif ending == ".ply" and texture is None:
            write_ply(out, shown)
        else:
            write_textured(out, shown, pixels)
    elif ending == ".npz" or (ending in {".ply", ".obj"} and texture is None):
        known = None if is_fitted else model.points_
        uv = unmapped(surface, _then(model.transform, placing)(surface.points), known)
        nowhere = np.flatnonzero(np.isnan(uv[:, 0]))
        facts |= _counted(len(uv), len(nowhere))
        facts["unmapped_rows"] = surface.rows_of(nowhere[:NAMED]).tolist()
        tell(Progress("writing"))
        write_points(out, surface, uv)
    else:
        facts |= _counted(len(surface.points), _off_mesh(model, surface))
        facts["texture"] = size
        if "colours" in surface.attributes:
            texels = MARGIN if margin is None else margin
            made = baked(shown, surface, "colour", size, texels, done=baking(tell))
            pixels = made.pixels.astype(np.uint8, copy=False)
            facts["texture_fill"] = round(made.fill, 3)
        tell(Progress("writing"))
        write_textured(out, shown, pixels)
    if preview is not None:
        write_preview(preview, shown, pixels, is_y_up=is_y_up)
    tell(Progress("measuring"))
    facts |= {"faces": len(shown.mesh.faces), **quality(shown, size).facts()}
    return facts | {"seconds": round(time.perf_counter() - begun, 3)}


def _mapped(model: Estimator, mesh: Mesh, placing: Placing, out: str) -> Charted:
    """A mesh with the model's map in the unit square, cut along the model's seam."""
    transform = _then(model.fitted_.flatten, placing)
    uv = transform(mesh.vertices)
    _warn_of_far(out, far_from(model.points_, mesh.vertices) & mesh.referenced)
    across = edges_across_seam(mesh, uv, transform, mean_spacing(model.points_))
    return Charted(mesh, opened(mesh, uv, across))


def _counted(count: int, missed: int) -> dict[str, object]:
    """How many of some points have a place on the map, and how many have none, as facts."""
    return {"mapped_points": count - missed, "unmapped_points": missed}


def _off_mesh(model: Estimator, cloud: PointCloud) -> int:
    """Points of a cloud that the mesh of the model leaves out, about: it is of some of them."""
    far = int((~are_near(model.mesh().mesh.vertices, cloud.points)).sum())
    if model.components == "each":  # what one map misses another one has
        return far
    missed, drawn = (int(str(model.report_.get(name, 0))) for name in ("missed", "points"))
    return max(far, round(len(cloud.points) * missed / max(drawn, 1)))


def _warn_of_far(out: str, is_far: BoolArray) -> None:
    """Name the rows that lie far from the surface that the model was fitted to."""
    if is_far.any():
        logger.warning(
            "%s: %d of %d points lie far from the surface of the model: row%s %s",
            out,
            is_far.sum(),
            len(is_far),
            "s" * bool(is_far.sum() > 1),
            named(np.flatnonzero(is_far)),
        )


def _then(transform: Transform, placing: Placing) -> Transform:
    """A map, carried into the unit square."""
    return lambda points: placing(transform(points))
