"""A plain install brings what the library imports."""

import ast
import re
import sys
import tomllib
from importlib import metadata
from pathlib import Path

ROOT = Path(__file__).parents[1]
ASKED_FOR = {"torch", "matplotlib", "sklearn"}
"""Packages that are imported only where a user asks for what needs them."""


def named(distribution: str) -> str:
    """Its name as registries compare it."""
    return distribution.replace("_", "-").lower()


def test_the_library_imports_nothing_that_a_plain_install_lacks() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    brought = {named(re.split(r"[\[<>=; ]", one)[0]) for one in project["dependencies"]}
    distributions = metadata.packages_distributions()
    missing = set()
    for path in sorted((ROOT / "parapoint").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                names = [node.module or ""]
            else:
                continue
            packages = {name.split(".")[0] for name in names} - {*sys.stdlib_module_names}
            packages -= {"parapoint", *ASKED_FOR}
            missing |= {
                f"{path.name}: {package}"
                for package in packages
                if not brought & {named(one) for one in distributions.get(package, [package])}
            }
    assert not missing
