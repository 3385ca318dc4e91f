"""`parapoint unwrap`: a surface in, the same surface with UVs out."""

from __future__ import annotations

import json
import logging
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from parapoint.commands.fitting import estimator_of, fitted
from parapoint.commands.memory import memory_option
from parapoint.commands.names import NAME
from parapoint.commands.output import TEXTURE, Y_UP, preview_target, target, write
from parapoint.commands.progress import Tell, bar
from parapoint.commands.telling import Facts, advice_of_cloud, lines, warn
from parapoint.errors import InputError
from parapoint.files.reading import Polygons, read_polygons
from parapoint.fitting import Progress
from parapoint.parameters import (
    LARGEST_SEED,
    LONGEST_SECONDS,
    check_choice,
    check_number,
    check_whole,
)
from parapoint.surfaces.components import COMPONENTS, components, largest_component
from parapoint.surfaces.surface import PointCloud
from parapoint.textures.baking import MARGIN, check_size
from parapoint.textures.placing import BORDER

logger = logging.getLogger("parapoint")


@click.command(no_args_is_help=True, options_metavar="[OPTIONS] --out FILE")
@click.argument("surface", type=NAME, metavar="INPUT")
@click.option(
    "--out",
    type=NAME,
    required=True,
    metavar="FILE",
    help="FILE.glb, .obj, .ply or .npz.",
)
@click.option("--time-budget", type=float, metavar="S", help="Seconds of processor time at most.")
@click.option(
    "--components",
    default="together",
    show_default=True,
    help="Of a cloud one map of all, of each or of the largest component.",
)
@click.option(
    "--distortion",
    metavar="D",
    help="conformal, balanced (default of a cloud) or isometric (of a mesh).",
)
@click.option(
    "--seam-price",
    type=float,
    metavar="P",
    help="Fall of the energy that a length of seam must bring.",
)
@click.option("--max-distortion", type=float, metavar="E", help="Cut on until the energy is E.")
@click.option(
    "--seams",
    type=NAME,
    metavar="FILE",
    help="Cut along the edges it lists, or the seams of its map.",
)
@click.option("--per-vertex", is_flag=True, help="One uv for each vertex, whatever the seams.")
@click.option("--texture", type=int, metavar="N", help="Texels along a side of a texture.")
@click.option(
    "--margin", type=int, metavar="TEXELS", help="Free texels around the map and its charts."
)
@click.option(
    "--preview", type=NAME, metavar="FILE", help="FILE.png: the surface beside its layout."
)
@click.option("--seed", type=int, default=0, show_default=True)
@click.option("--force", is_flag=True, help="Replace files of yours that are in the way.")
@memory_option
@click.option("--json", "as_json", is_flag=True, help="Print the report as one JSON object.")
def unwrap(
    surface: str,
    out: str,
    *,
    texture: int | None,
    margin: int | None,
    preview: str | None,
    seams: str | None,
    force: bool,
    as_json: bool,
    **options: Any,
) -> None:
    """Lay a mesh or a point cloud out in the unit square.

    A mesh is cut along a clean path of its edges and laid out without flips or overlaps. An OBJ
    file written as OBJ keeps all its lines but for the UVs; without materials of its own it gets a
    checkerboard. Components are mapped one by one; with --components largest only that one is
    written. Branches of the seam grow where each lowers the energy (symmetric Dirichlet, 4 at
    least) by --seam-price (1) for a length of the square root of the area; or, with
    --max-distortion, until the energy is as low and no longer, within --time-budget. With
    --per-vertex a vertex on a seam keeps one of its UVs, and the faces there span the map.

    The FILE of --seams lists edges, two vertex numbers a line; or it is a mesh that has UVs, such
    as INPUT itself, and the seams of its map are followed.

    --distortion isometric keeps angles and areas alike; balanced keeps angles as far as every part
    keeps its area; conformal keeps angles alone, whatever becomes of an ear or a finger.

    Of a cloud FILE.glb is a mesh of it, with its colours baked into a texture (a checkerboard where
    it has none); so are .obj and .ply with --texture. Without they are its points and their UVs.
    """
    inputs = [surface] if seams is None else [surface, seams]
    out = target(out, inputs, force=force, textured=texture is not None)
    check_size(TEXTURE if texture is None else texture, margin or 0)
    picture = None if preview is None else preview_target(preview, out, inputs, force=force)
    asked = Asked(surface, out, texture, margin, picture, force, seams=seams, **options)
    with bar() as tell:
        tell(Progress("reading"))
        given = read_polygons(surface)
        if isinstance(given, Polygons):
            facts = _unwrap_mesh(given, asked, tell)
        else:
            facts = _unwrap_cloud(given, asked, tell)
    print(json.dumps(facts) if as_json else lines(facts))


@dataclass(frozen=True)
class Asked:
    """The options of `unwrap`, as its help has them.

    Attributes:
        preview: the file for the picture, checked, or None.
    """

    surface: str
    out: str
    texture: int | None
    margin: int | None
    preview: Path | None
    force: bool
    time_budget: float | None
    components: str
    seed: int
    distortion: str | None
    seam_price: float | None
    max_distortion: float | None
    seams: str | None
    per_vertex: bool

    def __post_init__(self) -> None:
        from parapoint.computed.parts import DISTORTIONS  # here, so that the help comes at once
        from parapoint.planar.descent import LEAST_ENERGY

        check_choice("--components", self.components, COMPONENTS)
        check_whole("--seed", self.seed, 0, LARGEST_SEED)
        if self.time_budget is not None:
            check_number("--time-budget", self.time_budget, most=LONGEST_SECONDS, above=True)
        if self.seam_price is not None:
            check_number("--seam-price", self.seam_price)
        if self.max_distortion is not None:
            check_number("--max-distortion", self.max_distortion, LEAST_ENERGY, above=True)
        if self.distortion is not None:
            check_choice("--distortion", self.distortion, DISTORTIONS)
        unused: dict[str, object] = {
            "--seam-price": self.seam_price,
            "--max-distortion": self.max_distortion,
            "--distortion": self.distortion,
            "--components largest": self.components == "largest" or None,
        }
        for option, value in unused.items():
            if self.seams is not None and value is not None:
                raise InputError(f"{option} does not go with --seams, which are cut as they are")
        if self.seam_price is not None and self.max_distortion is not None:
            raise InputError(
                "--seam-price does not go with --max-distortion, which alone says how far to cut"
            )
        if self.max_distortion is not None and self.distortion in {"balanced", "conformal"}:
            raise InputError(
                f"--max-distortion bounds an energy that --distortion {self.distortion} gives up "
                f"for angles: leave one of them out"
            )
        if self.seam_price is not None and self.distortion == "conformal":
            raise InputError("--seam-price does not go with --distortion conformal")


def _unwrap_mesh(given: Polygons, asked: Asked, tell: Tell) -> Facts:
    """Unwrap a mesh; what was done, as facts."""
    from parapoint.commands.mesh_output import mesh_output
    from parapoint.commands.unwrapping import Request, unwrap_mesh
    from parapoint.unwrapping.unwrap import Unwrap

    method = Unwrap(
        time_budget=asked.time_budget,
        price=Unwrap.price if asked.seam_price is None else asked.seam_price,
        max_distortion=asked.max_distortion,
        distortion=asked.distortion or Unwrap.distortion,
    )
    mesh, chosen = given.mesh, None
    if asked.components == "largest":
        largest, is_part = largest_component(mesh)
        if not is_part.all():
            mesh, chosen = largest, is_part
    output = mesh_output(
        given,
        asked.surface,
        asked.out,
        asked.texture,
        MARGIN if asked.margin is None else asked.margin,
        chosen=chosen,
    )
    output.check(force=asked.force)
    border = BORDER if asked.margin is None else asked.margin / output.texture
    request = Request(
        method,
        border,
        asked.seed,
        asked.seams,
        asked.preview,
        per_vertex=asked.per_vertex,
    )
    return unwrap_mesh(mesh, request, output, tell)


def _unwrap_cloud(given: PointCloud, asked: Asked, tell: Tell) -> Facts:
    """Unwrap a cloud; what was done, as facts."""
    begun = time.perf_counter()
    for_meshes = {
        "--seams": asked.seams,
        "--seam-price": asked.seam_price,
        "--max-distortion": asked.max_distortion,
        "--per-vertex": asked.per_vertex or None,
    }
    for option, value in for_meshes.items():
        if value is not None:
            raise InputError(f"{option} is for meshes; {asked.surface} is a point cloud")
    if asked.texture is not None and Path(asked.out).suffix.lower() == ".npz":
        logger.warning("%s: no texture is written: this format has none", asked.out)
    names = ("time_budget", "components", "seed", "distortion")
    computed = estimator_of("computed", {name: getattr(asked, name) for name in names})
    model = fitted(asked.surface, given, computed, tell)
    written = components(given)[0] if model.components == "largest" else given
    facts = write(
        model,
        written,
        asked.out,
        texture=asked.texture,
        margin=asked.margin,
        preview=asked.preview,
        is_y_up=Path(asked.surface).suffix.lower() in Y_UP,
        tell=tell,
    )
    facts |= model.report_
    facts["seconds"] = round(time.perf_counter() - begun, 3)
    warn(facts, advice_of_cloud(asked.time_budget, asked.distortion, asked.components))
    return facts
