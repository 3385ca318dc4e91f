"""Hashes of source code: a stored result passes for fresh only while its code is the same."""

from __future__ import annotations

import ast
import functools
import hashlib
import importlib.util
from collections.abc import Iterable
from importlib import metadata
from pathlib import Path

from parapoint import LAZY

PROJECT = frozenset({"parapoint", "baselines", "benchmarks", "reports"})
"""Packages whose modules are followed, beside the package that a module itself belongs to."""


def source_hash(*modules: str, packages: Iterable[str] = ()) -> str:
    """Hash of everything that decides what some modules compute, the same on every machine.

    Args:
        modules: names of modules; `sources` says which others count with them.
        packages: installed packages whose versions count too.
    """
    digest = hashlib.sha256()
    for name, path in sorted(sources(*modules).items()):
        text = path.read_text(encoding="utf-8").replace("\r\n", "\n")
        # The name of a plugin's module holds the path of its file, which decides nothing.
        digest.update(f"{name if '.' in name else path.name}\n{text}\n".encode())
    for package in packages:
        digest.update(f"{package} {version(package)}\n".encode())
    return digest.hexdigest()[:16]


def sources(*modules: str) -> dict[str, Path]:
    """Source files, by module name, of some modules and of all that these import.

    Imports are followed through this project's packages and each module's own package, also where
    they stand inside a function. Importing a module runs the `__init__` of each package around it,
    so those count as well.

    Raises:
        ModuleNotFoundError: there is no module of one of these names.
    """
    found: dict[str, Path] = {}
    followed = PROJECT | {name.partition(".")[0] for name in modules}
    pending = list(modules)
    for name in modules:
        if _file(name) is None:
            raise ModuleNotFoundError(f"there is no source of a module {name}")
    while pending:
        name = pending.pop()
        if name in found or name.partition(".")[0] not in followed:
            continue
        path = _file(name)
        if path is None:  # a class or a function; `parapoint` says lazily where its own are
            package, _, leaf = name.rpartition(".")
            if package == "parapoint" and leaf in LAZY:
                pending.append(f"parapoint.{LAZY[leaf]}")
            continue
        found[name] = path
        parents = name.split(".")[:-1]
        pending += [".".join(parents[: depth + 1]) for depth in range(len(parents))]
        pending += imported(path.read_text(encoding="utf-8"), _package(name, path))
    return found


@functools.cache
def imported(source: str, package: str = "") -> tuple[str, ...]:
    """Names that the source of a module imports: modules, and what may be modules in packages.

    Args:
        source: the text of the module.
        package: the package that its relative imports start from.
    """
    names: list[str] = []
    tree = ast.parse(source)
    for node in ast.walk(_Running().visit(tree)):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) - node.level + 1]
            base = ".".join([*(above if node.level else ()), *filter(None, [node.module])])
            names += [base, *(f"{base}.{alias.name}" for alias in node.names)]
    return tuple(names)


class _Running(ast.NodeTransformer):
    """Leaves out what stands under `if TYPE_CHECKING`, which never runs."""

    def visit_If(self, node: ast.If) -> ast.AST:
        if isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
            node.body = [ast.Pass()]
        return self.generic_visit(node)


def version(package: str) -> str:
    """Version of an installed package without its local part (as in 2.13.0+cpu), or "absent"."""
    try:
        return metadata.version(package).partition("+")[0]
    except metadata.PackageNotFoundError:
        return "absent"


def _file(name: str) -> Path | None:
    """The source file of a module; None where there is none of that name.

    No package is run to find it: one that refuses to run here has the same hash as elsewhere.
    """
    top, *rest = name.split(".")
    try:
        spec = importlib.util.find_spec(top)
    except ValueError:  # in memory without a spec, as what a program was started from
        return None
    if spec is None:
        return None
    if not rest:
        origin = spec.origin or ""
        return Path(origin) if origin.endswith(".py") else None
    for root in spec.submodule_search_locations or ():
        place = Path(root, *rest)
        for path in (place / "__init__.py", place.with_suffix(".py")):
            if path.is_file():
                return path
    return None


def _package(name: str, path: Path) -> str:
    """The package that relative imports of a module start from."""
    return name if path.name == "__init__.py" else name.rpartition(".")[0]
