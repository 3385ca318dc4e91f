"""Packages that a method wraps and that need not be installed."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from parapoint.method import MissingError


class Missing:
    """Stands for a package that cannot be imported: each use says what to install.

    Attributes:
        reason: one line.
    """

    def __init__(self, reason: str) -> None:
        self.reason = reason

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):  # looks by copy, pickle and inspect are no use of the package
            raise AttributeError(name)
        raise MissingError(self.reason)


def optional(package: str, install: str) -> Any:
    """The module `package`, or where it cannot be imported a `Missing` in its place.

    Call it when the method's module is imported, or in the method's `preload` where the import
    takes seconds, so that `parameterize` does not time it.

    Args:
        package: name of the module.
        install: what to do to have it, such as "pip install uvunwrap".
    """
    try:
        return import_module(package)
    except (ImportError, OSError) as error:  # OSError: a system library is missing
        cause = " ".join(str(error).split())
        return Missing(f"needs the package {package}: {install} ({cause})")
