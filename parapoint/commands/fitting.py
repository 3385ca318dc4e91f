"""What the commands share: an estimator of the options, and its fit."""

from __future__ import annotations

import dataclasses
import logging
from typing import Any

import click

from parapoint.commands.progress import Tell
from parapoint.errors import InputError
from parapoint.estimator import Estimator
from parapoint.surfaces.surface import Surface

logger = logging.getLogger("parapoint")

PRESETS = ("computed", "learned", "paper")
"""What `--preset` may say: the computed map, or ParaPoint by our training or by the paper's."""
FALLBACK_SECONDS = 300.0
"""Budget of the training that stands in where no map can be computed, if none was given."""


def estimator_of(preset: str, settings: dict[str, Any]) -> Estimator:
    """The estimator of a preset; settings that are None were not given.

    Raises:
        InputError: there is no such preset, or it does not use a setting that was given, or a
            setting is out of range.
    """
    given = {name: value for name, value in settings.items() if value is not None}
    if preset not in PRESETS:
        raise InputError(f"--preset must be one of {', '.join(PRESETS)}, not {preset!r}")
    if preset == "computed":
        from parapoint.computed.computed_map import ComputedMap

        own = {field.name for field in dataclasses.fields(ComputedMap)}
        if unused := [name for name in given if name not in own]:
            option = f"--{unused[0].replace('_', '-')}"
            raise InputError(
                f"{option} is not used by --preset computed; --preset learned and paper take it"
            )
        model: Estimator = ComputedMap(**given)
    else:
        from parapoint.learned.parapoint import ParaPoint

        model = ParaPoint(preset, **given)
    try:
        model.check()
    except InputError as error:
        name, rest = str(error).split(maxsplit=1)
        option = f"--{name.replace('_', '-')}" if name in given else name
        raise InputError(f"{option} {rest}") from None
    return model


def fitted(
    path: str, surface: Surface, model: Estimator, tell: Tell, *, checkpoint: str | None = None
) -> Estimator:
    """The model fitted to a surface.

    Where no map can be computed, ParaPoint is trained in its place, and a warning says so.

    Args:
        path: the file of the surface, for messages.
        surface: what is fitted.
        model: an estimator.
        tell: is called with each `Progress`.
        checkpoint: folder of the state of a training, or None.

    Raises:
        InputError: the surface or a parameter is not as it has to be.
    """
    from parapoint.computed.reconstruction import ReconstructionError

    def fit(estimator: Estimator) -> Estimator:
        return estimator.fit(surface, checkpoint=checkpoint, callback=tell)

    try:
        try:
            return fit(model)
        except ReconstructionError as error:
            from parapoint.learned.parapoint import ParaPoint

            logger.warning("no map could be computed, so one is trained: %s", error)
            stand_in = ParaPoint(
                "learned",
                time_budget=model.time_budget or FALLBACK_SECONDS,
                components=model.components,
                seed=model.seed,
                **_asked(model, ("points", "distortion")),
            )
            return fit(stand_in)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    except RuntimeError as error:  # the training diverged
        raise click.ClickException(f"{path}: {error}") from error


def _asked(model: Estimator, names: tuple[str, ...]) -> dict[str, Any]:
    """The parameters of these names that are not as they are where nobody asks for them."""
    given, own = model.get_params(), type(model)().get_params()
    return {name: given[name] for name in names if given[name] != own[name]}
