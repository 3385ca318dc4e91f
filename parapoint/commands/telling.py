"""What commands say of a map: its last lines, and a warning where a bound is passed."""

from __future__ import annotations

import logging

from parapoint.console import LONGEST_MESSAGE, printable
from parapoint.surfaces.areas import MOST_STARVED

logger = logging.getLogger("parapoint")

Facts = dict[str, object]
"""What is known of a map by name: `parapoint.unwrapping.quality`, and what a command adds."""

COUNTS = {
    "mapped_points": "points mapped",
    "unmapped_points": "not",
    "faces": "faces",
    "welded": "doubled vertices taken as one",
    "iterations": "iterations",
}
"""What is counted in the first line, and in which words."""

ADVICE_OF_MESHES = {
    "overlap": "faces without area or a defective mesh can be the cause: clean it, or crop it",
    "starved": "a longer seam helps, as with --seam-price 0.03",
}
ADVICE_OF_MAPS = {
    "overlap": "the map is fitted to points, and faces across its seam may lie on others: unwrap "
    "cuts a mesh along its own edges",
    "starved": "a longer fit helps, or one with --distortion isometric",
}
"""What helps where faces overlap, and where parts are starved."""


def advice_of_cloud(
    time_budget: float | None, distortion: str | None, components: str
) -> dict[str, str]:
    """What helps where a map of a cloud overlaps, and where it starves parts, as it was asked for.

    Args:
        time_budget: seconds that the fit might take, or None.
        distortion: what the map keeps, or None for the paper's training.
        components: how many maps were asked for, one of COMPONENTS.
    """
    helps = ["more time"] * (time_budget is not None)
    helps += ["--distortion isometric"] * (distortion != "isometric")
    starved = " or ".join(helps) + " can help" if helps else "crop it to the part that matters"
    overlap = "denoise it, crop it, or take --components each"
    if components == "each":
        overlap = "denoise it or crop it"
    cause = "noise, strays or parts that only touch can be the cause"
    return {"overlap": f"{cause}: {overlap}", "starved": starved}


def lines(facts: Facts) -> str:
    """The facts of a map in a few lines for a reader."""
    of = {name: str(value) for name, value in facts.items()}
    counts = [f"{of[name]} {word}" for name, word in COUNTS.items() if facts.get(name)]
    angles = f"angles off by {of['angle_mean']}° in the mean, {of['angle_worst']}° at worst"
    stretch = f"stretch {of['stretch_mean']} in the mean, {of['stretch_worst']} at worst"
    part = f"smallest part at {of['smallest_part']} of its fair area"
    charts = "1 chart" if of["charts"] == "1" else f"{of['charts']} charts"
    seam = f"{charts}, seam {of['seam']} of the square root of the area"
    texels = f"{of['texels_per_unit']} texels per unit, {of['filled']} of the square filled"
    return "\n".join(
        [
            f"{printable(of['file'], LONGEST_MESSAGE)}: {', '.join(counts)} in {of['seconds']} s",
            f"{angles}; {stretch}",
            f"{part}; {of['flipped']} flipped faces, overlap: {of['overlap']}",
            f"{seam}; {texels}",
        ]
    )


def warn(facts: Facts, advice: dict[str, str]) -> None:
    """A line of advice for each bound that a map passes.

    Args:
        facts: of the map.
        advice: what helps, as ADVICE_OF_MESHES has it.
    """
    if facts["flipped"] or facts["overlap"] != "none":
        logger.warning(
            "%s: %s faces are flipped, overlap: %s; %s",
            facts["file"],
            facts["flipped"],
            facts["overlap"],
            advice["overlap"],
        )
    starved = float(str(facts["starved"]))
    if starved > MOST_STARVED:
        logger.warning(
            "%s: %.1f %% of the surface has less than a quarter of its fair area: %s",
            facts["file"],
            100 * starved,
            advice["starved"],
        )
