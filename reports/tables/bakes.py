"""How well colours come back from baked textures."""

from __future__ import annotations

from collections.abc import Mapping

from reports.contents import Contents
from reports.tables.notes import environment_note, failure_notes, load_notes, method_notes
from reports.tables.table import CASE, METHOD, Column, Table, Value

PSNR, SECONDS = "bake_psnr", "bake_cpu_seconds"
"""Entries of a method's report (`baselines.textured`)."""


def bakes(contents: Contents) -> Table | None:
    """The peak signal-to-noise ratio of colours read back; None where no method has baked any."""
    blocks = []
    for case in contents.cases:
        rows: list[Mapping[str, Value]] = []
        for label in contents.methods:
            cells = [row for row in contents.cell(case, label) if PSNR in row.report]
            if not cells:
                continue
            means = {
                name: sum(float(str(row.report[name])) for row in cells) / len(cells)
                for name in (PSNR, SECONDS, "charts")
            }
            rows.append({"case": case, "method": label.text, "label": label.short, **means})
        blocks.append(tuple(rows))
    if not any(blocks):
        return None
    return Table(
        name="bakes",
        title="Colours read back from textures",
        caption=(
            "A fifth of each cloud's points is held out; the others become a textured mesh. The "
            "points held out are projected onto the mesh and read their colours from the texture: "
            "peak signal-to-noise ratio, higher is better. The time is that of the bake alone."
        ),
        columns=(
            CASE,
            METHOD,
            Column(PSNR, "PSNR [dB]", digits=1, better="higher"),
            Column("charts", "charts", digits=0),
            Column(SECONDS, "bake, processor [s]", digits=1),
        ),
        blocks=tuple(blocks),
        notes=(
            *method_notes(contents),
            *failure_notes(contents),
            *load_notes(contents),
            environment_note(contents),
        ),
    )
