"""`parapoint unwrap`: a surface in, the same surface with UVs out."""

from __future__ import annotations

import json
from typing import Any

import click

from parapoint.commands.fitting import estimator_of, fitted, summary
from parapoint.commands.output import TEXTURE, preview_target, target, write
from parapoint.files.reading import read_surface
from parapoint.surfaces.components import components
from parapoint.textures.baking import check_size


@click.command()
@click.argument("surface", metavar="INPUT")
@click.option("--out", required=True, metavar="FILE", help="FILE.glb, .obj, .ply or .npz.")
@click.option("--time-budget", type=float, metavar="S", help="Seconds at most.")
@click.option(
    "--components",
    default="together",
    show_default=True,
    help="One map of all, or of each or the largest component.",
)
@click.option("--texture", type=int, metavar="N", help="Texels along a side of a texture.")
@click.option("--margin", type=int, metavar="TEXELS", help="Free texels around the map.")
@click.option("--preview", metavar="FILE", help="FILE.png: the surface beside its layout.")
@click.option("--seed", type=int, default=0, show_default=True)
@click.option("--force", is_flag=True, help="Replace files of yours that are in the way.")
@click.option("--json", "as_json", is_flag=True, help="Print the report as one JSON object.")
def unwrap(
    surface: str,
    out: str,
    *,
    texture: int | None,
    margin: int | None,
    preview: str | None,
    force: bool,
    as_json: bool,
    **settings: Any,
) -> None:
    """Compute the map of a mesh or a point cloud and write it, in the unit square.

    A mesh written as OBJ gets a checkerboard and is cut along the seams of the map: a face whose
    corners lie on both sides of one keeps its true shape, at the side of its one short edge. With
    --components largest only that one is written.

    Of a cloud FILE.glb is a mesh of it, with its colours baked into a texture (a checkerboard where
    it has none); so are .obj and .ply with --texture. Without they are its points and their UVs.
    """
    out = target(out, surface, force=force, textured=texture is not None)
    check_size(TEXTURE if texture is None else texture, margin or 0)
    picture = None if preview is None else preview_target(preview, out, surface, force=force)
    given = read_surface(surface)
    model = fitted(surface, given, estimator_of("computed", settings))
    if model.components == "largest":
        given = components(given)[0]
    facts = write(model, given, out, texture=texture, margin=margin, preview=picture)
    print(json.dumps({**facts, **model.report_}) if as_json else f"{out}: {summary(model)}")
