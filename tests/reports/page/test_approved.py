"""What a reader finds on the pages of a report: every word, hint and link, in order.

`tests/golden/pages` holds it. Hashes, which name pictures, and the folder are left out.
"""

import re
from html.parser import HTMLParser
from pathlib import Path

import pytest

from ..approving import check

SHOWN = ("title", "alt", "aria-label", "href", "src", "value", "data-value", "colspan", "class")
"""Attributes that a reader sees, or that decide how something looks."""


class Shown(HTMLParser):
    """Gathers what is shown, one line each."""

    def __init__(self) -> None:
        super().__init__()
        self.lines: list[str] = []
        self.is_script = False

    def handle_starttag(self, tag, attrs) -> None:
        self.is_script = tag in {"script", "style"}
        said = [f"{key}={value}" for key, value in attrs if key in SHOWN]
        self.lines += [f"<{tag} {' '.join(said)}>"] if said else []

    def handle_endtag(self, *_) -> None:
        self.is_script = False

    def handle_data(self, data) -> None:
        if not self.is_script and (text := " ".join(data.split())):
            self.lines.append(text)


def shown(path: Path, folder: Path) -> str:
    """What a page shows, line by line."""
    parser = Shown()
    parser.feed(path.read_text(encoding="utf-8"))
    text = "\n".join(parser.lines).replace(str(folder), "FOLDER")
    return re.sub(r"\b[0-9a-f]{6,64}\b", "#", text) + "\n"


@pytest.mark.parametrize("page", ["index", "mannequin-devil", "nefertiti"])
def test_pages_read_as_approved(reported, page, tmp_path):
    (path,) = (reported / "report").rglob(f"{page}*.html")
    check(f"pages/{page}.txt", shown(path, reported), tmp_path)
