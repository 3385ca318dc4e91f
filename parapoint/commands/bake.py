"""`parapoint bake`: what the points of a cloud know, painted into a texture of its surface."""

from __future__ import annotations

import json
from pathlib import Path

import click

from parapoint.commands.memory import memory_option
from parapoint.commands.names import NAME
from parapoint.commands.output import TEXTURE
from parapoint.commands.progress import baking, bar
from parapoint.console import LONGEST_MESSAGE, printable
from parapoint.errors import InputError
from parapoint.files.pieces import point_pieces
from parapoint.files.png import png
from parapoint.files.reading import faults_of, read_parameterized
from parapoint.files.targets import checked_picture, complete_file, sealed_png
from parapoint.fitting import Progress
from parapoint.surfaces.parameterization import Charted
from parapoint.textures.baking import (
    MARGIN,
    baked,
    check_in_square,
    check_size,
    check_together,
)
from parapoint.textures.known import MAPS
from parapoint.textures.placing import Placing
from parapoint.textures.thinning import thinned


@click.command(no_args_is_help=True, options_metavar="[OPTIONS] --map KIND --out FILE")
@click.argument("model", type=NAME, metavar="MODEL")
@click.argument("cloud", type=NAME, metavar="CLOUD")
@click.option("--out", type=NAME, required=True, metavar="FILE", help="FILE.png.")
@click.option("--map", "kind", required=True, metavar="KIND", help=f"{', '.join(MAPS)}.")
@click.option("--texture", type=int, default=TEXTURE, show_default=True, help="Texels a side.")
@click.option("--margin", type=int, default=MARGIN, show_default=True, help="In texels.")
@click.option("--force", is_flag=True, help="Replace files of yours that are in the way.")
@memory_option
@click.option("--json", "as_json", is_flag=True, help="Print the report as one JSON object.")
def bake(
    model: str,
    cloud: str,
    out: str,
    *,
    kind: str,
    texture: int,
    margin: int,
    force: bool,
    as_json: bool,
) -> None:
    """Paint what the points of a cloud know into a texture.

    MODEL is a folder of `fit`, or a mesh with UVs, of the same surface. CLOUD may have any number
    of points: LAS, LAZ and binary PLY are read a piece at a time, and no more points are kept than
    the texture can show. Of a folder the texture fits the UVs that `map` writes. A normal map is
    in tangent space, as glTF has it, of a model that is shaded smoothly throughout; a position map
    is a geometry image of 16 bits.
    """
    if kind not in MAPS:
        raise InputError(f"--map must be one of {', '.join(MAPS)}, not {kind!r}")
    check_size(texture, margin)
    path = checked_picture(out, inputs=[model, cloud], force=force)
    with bar() as tell:
        tell(Progress("reading"))
        charted = _charted(model)
        with faults_of(Path(cloud)):
            points, count = thinned(point_pieces(cloud), kind, charted, texture)
            check_together(charted, points)
        made = baked(charted, points, kind, texture, margin, done=baking(tell))
        tell(Progress("writing"))
        data = sealed_png(png(made.pixels, made.text))
        with complete_file(path) as file:
            file.write(data)
    facts = {
        "file": out,
        "map": kind,
        "points": count,
        "points_used": len(points.points),
        "texture": texture,
    }
    facts |= {"texture_fill": round(made.fill, 3), **made.text}
    if as_json:
        print(json.dumps(facts))
    else:
        name = printable(out, LONGEST_MESSAGE)
        print(f"{name}: {kind} of {count} points in {texture} x {texture} texels")


def _charted(model: str) -> Charted:
    """The mesh of a fitted model in the unit square, or the mesh and map of a file."""
    if Path(model).is_dir():
        from parapoint.estimator import load

        fitted = load(model).mesh()
        return Placing.smallest(fitted.map.uv).of(fitted)
    charted = Charted(*read_parameterized(model))
    with faults_of(Path(model)):
        check_in_square(charted)
    return charted
