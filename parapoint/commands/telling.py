"""What commands say of a map in their last lines."""

from __future__ import annotations


def lines(facts: dict[str, object]) -> str:
    """The facts of a map (`parapoint.unwrapping.quality`) in a few lines for a reader."""
    of = {name: str(value) for name, value in facts.items()}
    angles = f"angles off by {of['angle_mean']}° in the mean, {of['angle_worst']}° at worst"
    stretch = f"stretch {of['stretch_mean']} in the mean, {of['stretch_worst']} at worst"
    part = f"smallest part at {of['smallest_part']} of its fair area"
    charts = "1 chart" if of["charts"] == "1" else f"{of['charts']} charts"
    seam = f"{charts}, seam {of['seam']} of the square root of the area"
    texels = f"{of['texels_per_unit']} texels per unit, {of['filled']} of the square filled"
    overlap = f", overlap: {of['overlap']}" if "overlap" in of else ""
    return "\n".join(
        [
            f"{of['file']}: {of['faces']} faces in {of['seconds']} s",
            f"{angles}; {stretch}",
            f"{part}; {of['flipped']} flipped faces{overlap}",
            f"{seam}; {texels}",
        ]
    )
