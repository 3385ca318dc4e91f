"""`parapoint unwrap`: a surface in, the same surface with UVs out."""

from __future__ import annotations

import json
from typing import Any

import click

from parapoint.commands.fitting import estimator_of, fitted
from parapoint.commands.memory import memory_option
from parapoint.commands.output import TEXTURE, preview_target, target, write
from parapoint.commands.telling import lines
from parapoint.errors import InputError
from parapoint.files.reading import Polygons, read_polygons
from parapoint.parameters import check_choice
from parapoint.surfaces.components import COMPONENTS, components, largest_component
from parapoint.textures.baking import MARGIN, check_size
from parapoint.textures.placing import BORDER


@click.command(no_args_is_help=True, options_metavar="[OPTIONS] --out FILE")
@click.argument("surface", type=click.Path(), metavar="INPUT")
@click.option(
    "--out",
    type=click.Path(),
    required=True,
    metavar="FILE",
    help="FILE.glb, .obj, .ply or .npz.",
)
@click.option("--time-budget", type=float, metavar="S", help="Seconds at most.")
@click.option(
    "--components",
    default="together",
    show_default=True,
    help="One map of all, or of each or the largest component.",
)
@click.option(
    "--distortion",
    metavar="D",
    help="conformal, balanced (default of a cloud) or isometric (of a mesh).",
)
@click.option("--seam-price", type=float, metavar="P", help="Energy a branch must gain a length.")
@click.option("--max-distortion", type=float, metavar="E", help="Cut on until the energy is E.")
@click.option("--seams", metavar="FILE", help="Cut along these edges: two vertex numbers a line.")
@click.option("--per-vertex", is_flag=True, help="One uv for each vertex, whatever the seams.")
@click.option("--texture", type=int, metavar="N", help="Texels along a side of a texture.")
@click.option("--margin", type=int, metavar="TEXELS", help="Free texels around the map.")
@click.option("--preview", metavar="FILE", help="FILE.png: the surface beside its layout.")
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
    force: bool,
    as_json: bool,
    seams: str | None,
    per_vertex: bool,
    distortion: str | None,
    seam_price: float | None,
    max_distortion: float | None,
    **settings: Any,
) -> None:
    """Lay a mesh or a point cloud out in the unit square.

    A mesh is cut along a clean path of its edges and laid out without flips or overlaps. An OBJ
    file written as OBJ keeps all its lines but for the UVs; without materials of its own it gets a
    checkerboard. Components are mapped one by one; with --components largest only that one is
    written. Branches of the seam grow where each lowers the energy (symmetric Dirichlet, 4 at
    least) by --seam-price (1) for a length of the square root of the area; or, with
    --max-distortion, until the energy is as low and no longer, within --time-budget.

    --distortion isometric keeps angles and areas alike; balanced keeps angles as far as every part
    keeps its area; conformal keeps angles alone, whatever becomes of an ear or a finger.

    Of a cloud FILE.glb is a mesh of it, with its colours baked into a texture (a checkerboard where
    it has none); so are .obj and .ply with --texture. Without they are its points and their UVs.
    """
    out = target(out, surface, force=force, textured=texture is not None)
    check_size(TEXTURE if texture is None else texture, margin or 0)
    picture = None if preview is None else preview_target(preview, out, surface, force=force)
    given = read_polygons(surface)
    border = BORDER if margin is None else margin / (texture or TEXTURE)
    if isinstance(given, Polygons):
        from parapoint.commands.mesh_output import mesh_output
        from parapoint.commands.unwrapping import Request, unwrap_mesh
        from parapoint.unwrapping.unwrap import Unwrap

        check_choice("components", settings["components"], COMPONENTS)
        grown: dict[str, object] = {
            "--seam-price": seam_price,
            "--max-distortion": max_distortion,
            "--distortion": distortion,
        }
        grown["--components largest"] = settings["components"] == "largest" or None
        for option, given_value in grown.items():
            if seams is not None and given_value is not None:
                raise InputError(f"{option} does not go with --seams, which are cut as they are")
        if seam_price is not None and max_distortion is not None:
            raise InputError(
                "--seam-price does not go with --max-distortion, which alone says how far to cut"
            )
        if seam_price is not None and distortion == "conformal":
            raise InputError("--seam-price does not go with --distortion conformal")
        method = Unwrap(
            time_budget=settings["time_budget"],
            price=Unwrap.price if seam_price is None else seam_price,
            max_distortion=max_distortion,
            distortion=distortion or Unwrap.distortion,
        )
        mesh, chosen = given.mesh, None
        if settings["components"] == "largest" and mesh.component_count > 1:
            mesh, chosen = largest_component(mesh)
        output = mesh_output(
            given,
            surface,
            out,
            texture,
            MARGIN if margin is None else margin,
            chosen=chosen,
            per_vertex=per_vertex,
        )
        output.check(force=force)
        request = Request(method, border, settings["seed"], seams, picture)
        facts = unwrap_mesh(mesh, request, output)
        print(json.dumps(facts) if as_json else lines(facts))
        return
    unused = {"--seams": seams, "--seam-price": seam_price, "--max-distortion": max_distortion}
    for option, value in {**unused, "--per-vertex": per_vertex or None}.items():
        if value is not None:
            raise InputError(f"{option} is for meshes; {surface} is a point cloud")
    settings["distortion"] = distortion
    model = fitted(surface, given, estimator_of("computed", settings))
    written = components(given)[0] if model.components == "largest" else given
    facts = write(model, written, out, texture=texture, margin=margin, preview=picture)
    facts |= model.report_
    print(json.dumps(facts) if as_json else lines(facts))
