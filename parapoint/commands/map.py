"""`parapoint map`: apply a saved map to other points of its surface."""

from __future__ import annotations

import json
import logging
from pathlib import Path

import click

from parapoint.commands.memory import memory_option
from parapoint.commands.names import NAME
from parapoint.commands.output import target, write
from parapoint.commands.progress import bar
from parapoint.commands.telling import ADVICE_OF_MAPS, lines, warn
from parapoint.files.reading import faults_of, read_surface
from parapoint.fitting import Progress
from parapoint.textures.baking import check_together

logger = logging.getLogger("parapoint")


@click.command("map", no_args_is_help=True, options_metavar="[OPTIONS] --out FILE")
@click.argument("model", type=NAME, metavar="DIR")
@click.argument("surface", type=NAME, metavar="INPUT")
@click.option(
    "--out", type=NAME, required=True, metavar="FILE", help="FILE.obj, .glb, .ply or .npz."
)
@click.option("--device", default="auto", show_default=True, help="auto, cpu or cuda.")
@click.option("--force", is_flag=True, help="Replace files of yours that are in the way.")
@memory_option
@click.option("--json", "as_json", is_flag=True, help="Print the report as one JSON object.")
def map_(model: str, surface: str, out: str, device: str, *, force: bool, as_json: bool) -> None:
    """Apply a saved map to other points of its surface.

    DIR is a folder of `fit`, INPUT a cloud or a mesh of the same surface. The fitted points fill
    the unit square. A mesh written as OBJ is cut along the seams of the map: a face that lies
    across one keeps its shape and stays on one side. Of a cloud a GLB file holds the model's mesh,
    with the cloud's colours as its texture.
    """
    out = target(out, [surface], force=force, textured=False)
    from parapoint.estimator import load

    with bar() as tell:
        tell(Progress("reading"))
        loaded, given = load(model, device=device), read_surface(surface)
        with faults_of(Path(surface)):
            on = check_together(loaded.mesh(), given, loaded.points_, least=0)
        if on < 1:
            logger.warning(
                "%s: about %.3g %% of its points lie off the surface of the model: they get the UV "
                "of its nearest places, or none where they lie far from it",
                surface,
                100 * (1 - on),
            )
        facts = write(loaded, given, out, tell=tell, is_fitted=False)
    warn(facts, ADVICE_OF_MAPS)
    if as_json:
        print(json.dumps(facts))
        return
    print(lines(facts))
    if count := int(str(facts.get("unmapped_points", 0))):
        share = 100 * count / (count + int(str(facts["mapped_points"])))
        print(
            f"{count} points ({share:.3g} %) lie far from the surface and have no UV: "
            f"rows {facts['unmapped_rows']} come first"
        )
