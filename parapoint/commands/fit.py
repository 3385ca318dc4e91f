"""`parapoint fit`: find the map of a surface and save it."""

from __future__ import annotations

import json
import logging
from pathlib import Path
from typing import Any

import click

from parapoint import saving
from parapoint.commands.fitting import estimator_of, fitted
from parapoint.commands.memory import memory_option
from parapoint.commands.names import NAME
from parapoint.commands.output import TEXTURE
from parapoint.commands.progress import bar
from parapoint.commands.telling import advice_of_cloud, lines, warn
from parapoint.errors import InputError
from parapoint.files.reading import read_surface
from parapoint.files.targets import check_folder
from parapoint.fitting import Progress
from parapoint.textures.placing import Placing
from parapoint.unwrapping.quality import quality

logger = logging.getLogger("parapoint")


@click.command(no_args_is_help=True, options_metavar="[OPTIONS] --out DIR")
@click.argument("surface", type=NAME, metavar="INPUT")
@click.option("--out", type=NAME, required=True, metavar="DIR", help="Folder of the model.")
@click.option("--preset", default="computed", show_default=True, help="computed, learned or paper.")
@click.option("--points", type=int, help="Most points that the map is fitted to.")
@click.option("--iterations", type=int, help="Training steps.")
@click.option("--subset", type=int, help="Points of a training step, before the last take all.")
@click.option("--time-budget", type=float, metavar="S", help="Seconds of processor time at most.")
@click.option(
    "--distortion",
    help="What the map keeps: conformal, balanced (computed alone; its default) or isometric.",
)
@click.option("--distortion-weight", type=float, help="The paper has 1e-4 for complex shapes.")
@click.option("--eigenvalues", help="Training: singular, or gram, as the paper is read.")
@click.option("--branches", help="Training: both, or one: 3d (3D-2D-3D) or 2d (2D-3D-2D).")
@click.option(
    "--components",
    default="together",
    show_default=True,
    help="One map of all, or of each or the largest component.",
)
@click.option("--seed", type=int, default=0, show_default=True)
@click.option("--device", help="Training: auto, cpu or cuda.")
@click.option("--threads", type=int, help="Training: processor threads.")
@memory_option
@click.option("--json", "as_json", is_flag=True, help="Print the report as one JSON object.")
def fit(surface: str, out: str, preset: str, as_json: bool, **settings: Any) -> None:
    """Find the map of a mesh or a point cloud and save it.

    The state of a training is saved in DIR each minute: the same command goes on after a kill.
    """
    model = estimator_of(preset, settings)
    _check_folder(Path(out))
    try:
        with bar() as tell:
            tell(Progress("reading"))
            given = read_surface(surface)
            model = fitted(surface, given, model, tell, checkpoint=out)
            tell(Progress("writing"))
            model.save(out)
            tell(Progress("measuring"))
            charted = model.mesh()
            found = quality(Placing.smallest(charted.map.uv).of(charted), TEXTURE)
    except KeyboardInterrupt:
        logger.warning("%s", _how_to_go_on(out))
        raise
    facts = {"file": out, "faces": len(charted.mesh.faces), **found.facts(), **model.report_}
    distortion = model.get_params()["distortion"]
    warn(facts, advice_of_cloud(model.time_budget, distortion, model.components))
    if as_json:
        print(json.dumps({"model": out, "estimator": type(model).__name__, **facts}))
    else:
        print(lines(facts))


def _check_folder(folder: Path) -> None:
    """Check that the folder of a model can be made and written to.

    Raises:
        InputError: it cannot, or something that is not ours is in the way.
    """
    for stem in ("model", "checkpoint"):
        saving.check_free(folder, stem)
    there = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    if not there.is_dir():
        raise InputError(f"{there}: is a file; name a folder")
    check_folder(there)


def _how_to_go_on(out: str) -> str:
    """What to do after a fit that was broken off."""
    if any(Path(out).rglob("checkpoint.json")):
        return f"{out}: keeps the training of up to a minute ago; the same command goes on from it"
    return f"{out}: nothing is saved yet; --time-budget SECONDS lets a fit end early with a map"
