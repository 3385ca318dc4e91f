"""Texts that were read and approved, against which later ones are held.

Where a text changes on purpose, the failing test says where the new one is, to be read and moved.
"""

from pathlib import Path

GOLDEN = Path(__file__).parents[1] / "golden"


def check(name: str, found: str, folder: Path) -> None:
    """Hold a text to the golden one of this name; the new one is kept in `folder`."""
    new, golden = folder / Path(name).name, GOLDEN / name
    new.write_text(found, encoding="utf-8")
    known = golden.read_text(encoding="utf-8") if golden.exists() else ""
    assert found.splitlines() == known.splitlines(), f"if {new} is right, move it to {golden}"
