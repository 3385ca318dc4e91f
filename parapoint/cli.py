"""`parapoint fit | map | unwrap`: maps of files."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Never

import click
import numpy as np
import numpy.typing as npt
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from parapoint import console
from parapoint.errors import InputError
from parapoint.files.surfaces import read_surface, write_obj, write_points
from parapoint.surfaces.components import components
from parapoint.surfaces.sampling import mean_spacing
from parapoint.surfaces.spanning import Transform, opened, spanning_edges
from parapoint.surfaces.surface import Mesh, PointCloud, Surface

if TYPE_CHECKING:
    from parapoint import estimator

ENDINGS = (".obj", ".ply", ".npz")
OPTIONS = (
    click.option("--preset", default="fast", show_default=True, help="fast, smooth or paper."),
    click.option("--points", type=int, help="Training points."),
    click.option("--subset", type=int, help="Points of a step, before the last ones take all."),
    click.option("--iterations", type=int, help="Steps."),
    click.option("--time-budget", type=float, metavar="S", help="Seconds of fitting at most."),
    click.option("--distortion", help="conformal, or isometric in its place."),
    click.option("--distortion-weight", type=float, help="The paper has 1e-4 for complex shapes."),
    click.option("--eigenvalues", help="singular values of the Jacobian, or of its gram matrix."),
    click.option("--branches", help="both, or one: 3d (3D-2D-3D) or 2d (2D-3D-2D)."),
    click.option(
        "--components",
        default="together",
        show_default=True,
        help="One map of all, or of each or the largest component.",
    ),
    click.option("--seed", type=int, default=0, show_default=True),
    click.option("--device", default="auto", show_default=True, help="auto, cpu or cuda."),
    click.option("--threads", type=int, help="Processor threads."),
)


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
def parapoint() -> None:
    """UV maps of point clouds and meshes, learned."""
    logging.basicConfig(format="%(message)s")


def _settings(command: Callable[..., None]) -> Callable[..., None]:
    """The options of a fit, on a command."""
    for option in reversed(OPTIONS):
        command = option(command)
    return command


@parapoint.command()
@click.argument("surface", metavar="INPUT")
@click.option("--out", required=True, metavar="DIR", help="Folder of the model.")
@click.option("--json", "as_json", is_flag=True, help="Print the report as one JSON object.")
@_settings
def fit(surface: str, out: str, as_json: bool, **settings: Any) -> None:
    """Learn the map of a mesh or a point cloud and save it in DIR.

    The state is saved there each minute: the same command goes on after a kill.
    """
    given = read_surface(surface)
    if Path(out).exists() and not Path(out).is_dir():
        raise InputError(f"{out}: is a file; --out names a folder")
    model = _fitted(surface, given, settings, checkpoint=out)
    model.save(out)
    _print({"model": out, **model.report_}, as_json, f"{out}: {_summary(model)}")


@parapoint.command("map")
@click.argument("model", metavar="DIR")
@click.argument("surface", metavar="INPUT")
@click.option("--out", required=True, metavar="FILE", help="FILE.obj, .ply or .npz.")
@click.option("--device", default="auto", show_default=True, help="auto, cpu or cuda.")
@click.option("--json", "as_json", is_flag=True, help="Print the report as one JSON object.")
def map_(model: str, surface: str, out: str, device: str, as_json: bool) -> None:
    """Apply the model in DIR to other points of its surface, or to a mesh of it.

    The training points fill the unit square. A mesh written as OBJ is cut as `unwrap` says.
    """
    _check_target(out)
    from parapoint.estimator import ParaPoint

    fitted = ParaPoint.load(model, device=device)
    given = read_surface(surface)
    facts = _write(fitted, given, out, None)
    _print(facts, as_json, f"{out}: {facts['mapped_points']} points mapped")


@parapoint.command()
@click.argument("surface", metavar="INPUT")
@click.option("--out", required=True, metavar="FILE", help="FILE.obj, .ply or .npz.")
@click.option("--json", "as_json", is_flag=True, help="Print the report as one JSON object.")
@_settings
def unwrap(surface: str, out: str, as_json: bool, **settings: Any) -> None:
    """Learn the map of a mesh or a point cloud and write it, in the unit square.

    A mesh written as OBJ gets a checkerboard and is cut at the learned seams: a face whose corners
    lie on both banks stays at the bank of its one short edge, in its true shape, and is not drawn
    across the plane. With --components largest only that one is written.
    """
    _check_target(out)
    given = read_surface(surface)
    model = _fitted(surface, given, settings, checkpoint=None)
    if model.components == "largest":
        given = components(given)[0]
    facts = _write(model, given, out, checkerboard())
    _print({**facts, **model.report_}, as_json, f"{out}: {_summary(model)}")


def checkerboard(squares: int = 32, pixels: int = 32) -> npt.NDArray[np.uint8]:
    """(H, W, 3) a checkerboard texture."""
    steps = np.arange(squares * pixels) // pixels
    dark = (steps[:, None] + steps[None]) % 2 == 0
    return np.where(dark[:, :, None], np.uint8(70), np.uint8(235)).repeat(3, axis=2)


def _check_target(path: str) -> None:
    if Path(path).suffix.lower() not in ENDINGS:
        raise InputError(f"{path}: cannot write this ending; take {', '.join(ENDINGS)}")
    if not Path(path).absolute().parent.is_dir():
        raise InputError(f"{path}: there is no such folder; make it first")


def _fitted(
    path: str, surface: Surface, settings: dict[str, Any], *, checkpoint: str | None
) -> estimator.ParaPoint:
    """A model fitted under a progress bar on standard error, none where that is no terminal."""
    from parapoint.estimator import ParaPoint
    from parapoint.learned.trainer import DivergedError

    if (
        settings["components"] == "together"
        and isinstance(surface, Mesh)
        and surface.component_count > 1
    ):
        logging.getLogger("parapoint").warning(
            "%d components: one map is fitted to all of them; --components each or largest "
            "fits them apart",
            surface.component_count,
        )
    model = ParaPoint(**settings)
    try:
        with _bar() as advance:
            return model.fit(surface, checkpoint=checkpoint, callback=advance)
    except DivergedError as error:
        raise click.ClickException(str(error)) from error
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


@contextmanager
def _bar() -> Iterator[Callable[[estimator.Progress], None]]:
    """Gives the callback that moves the bar."""
    terminal = Console(stderr=True)
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.fields[loss]}"),
        TextColumn("{task.fields[remaining]}"),
    )
    with Progress(*columns, console=terminal, disable=not terminal.is_terminal) as progress:
        # No end is known before the first step, as while a map is computed: the bar pulses.
        task = progress.add_task("start", total=None, loss="", remaining="")

        def advance(now: estimator.Progress) -> None:
            shown: dict[str, Any] = {"remaining": f"{now.remaining:.0f} s left"}
            if now.step.losses:
                shown["loss"] = f"loss {now.step.losses['total']:.4f}"
            done = now.step.progress
            progress.update(task, completed=done, total=1.0, description=now.step.phase, **shown)

        yield advance


def _write(
    model: estimator.ParaPoint,
    surface: Surface,
    out: str,
    texture: npt.NDArray[np.uint8] | None,
) -> dict[str, object]:
    """Map a surface into the unit square and write it; what was written, as facts."""
    points = surface.vertices if isinstance(surface, Mesh) else surface.points
    transform = _in_unit_square(model)
    uv = transform(points)
    facts: dict[str, object] = {"file": out, "mapped_points": len(points)}
    if isinstance(surface, Mesh) and Path(out).suffix.lower() == ".obj":
        spans = spanning_edges(surface, uv, transform, mean_spacing(model.points_))
        parameterization = opened(surface, uv, spans)
        facts["spanning_faces"] = int((parameterization.corners != surface.faces).any(1).sum())
        write_obj(out, surface, parameterization, texture)
    else:
        cloud = surface if isinstance(surface, PointCloud) else PointCloud(points)
        write_points(out, cloud, uv)
    return facts


def _in_unit_square(model: estimator.ParaPoint) -> Transform:
    """The model's map, scaled so that the images of the training points fill the unit square."""
    known = model.transform(model.points_)
    low, side = known.min(axis=0), np.ptp(known, axis=0).max()
    return lambda points: np.asarray((model.transform(points) - low) / side)


def _summary(model: estimator.ParaPoint) -> str:
    report = model.report_
    return f"{report['iterations']} iterations in {report['seconds']} s"


def _print(facts: dict[str, object], as_json: bool, line: str) -> None:
    print(json.dumps(facts) if as_json else line)


def main() -> Never:
    """The `parapoint` command."""
    console.run(parapoint)
