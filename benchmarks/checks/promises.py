"""What the methods promise of their maps: whether the same seed gives the same one."""

from __future__ import annotations

from collections.abc import Mapping

from parapoint.errors import InputError


def repeats(method: str, params: Mapping[str, object]) -> bool:
    """Whether a method with these parameters gives the same map for the same seed.

    Not so for what torch computes: another number of threads gives another rounding, and training
    turns it into another map. Nothing is promised where this version of the benchmark does not know
    the method or a parameter.

    Args:
        method: registry name.
        params: its parameters by name, as a row of results has them.
    """
    from baselines import registry  # here, so that importing reports leaves the registry alone

    arguments = ", ".join(f"{name}={value!r}" for name, value in params.items())
    try:
        _, made = registry.method(f"{method}({arguments})")
    except InputError:
        return False
    return not registry.depends_on_threads(made) and bool(getattr(made, "deterministic", True))
