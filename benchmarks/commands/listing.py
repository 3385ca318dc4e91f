"""What `python -m benchmarks list` shows: suites, cases, methods, metrics."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from rich.table import Table
from rich.text import Text

from parapoint.errors import InputError


def _table(*columns: str) -> Table:
    """An empty table."""
    table = Table()
    for column in columns:
        table.add_column(column)
    return table


def _add(table: Table, *texts: str) -> None:
    """Add a row of texts, in which rich must not take brackets for markup."""
    table.add_row(*map(Text, texts))


def _parameters(spec: str) -> tuple[str, Mapping[str, object]]:
    """The name and parameters of a method; of one that is not installed, those in its spec."""
    from baselines import registry
    from benchmarks.running.planning import parameters

    try:
        return parameters(spec)
    except InputError:
        return registry.parsed(spec)


def suites() -> Table:
    """Each suite with its cases and methods, and how long it takes on one core, about."""
    from benchmarks.cases.suites import SUITES
    from benchmarks.running.expectation import about, expectation, size

    table = _table("suite", "title", "cells", "one core", "download", "cases", "methods", "seeds")
    for suite in SUITES.values():
        needs = expectation(suite, _parameters)
        _add(
            table,
            suite.name,
            suite.title,
            str(needs.cells),
            about(needs.seconds),
            size(needs.megabytes),
            ", ".join(suite.cases),
            ", ".join(suite.methods),
            ", ".join(map(str, suite.seeds)),
        )
    return table


def cases() -> Table:
    """Each model with its topology and licence."""
    from benchmarks.cases import models

    table = _table("case", "topology", "claim", "licence")
    for name in models.names():
        model = models.info(name)
        if model is None:
            _add(table, name, "", "made in memory", "")
        else:
            _add(table, name, model.topology, model.claim or "", model.licence)
    return table


def methods() -> Table:
    """Each method with what it requires and its parameters."""
    from baselines import registry

    table = _table("method", "requires", "environment", "deterministic", "parameters", "summary")
    for name in registry.names():
        try:
            about = registry.describe(name)
        except (ImportError, InputError) as error:
            _add(table, name, "", "", "", "", str(error))
            continue
        parameters = ", ".join(f"{key}={value}" for key, value in about.parameters.items())
        requires = ", ".join(about.requires)
        own = ", ".join(about.environment)
        _add(table, name, requires, own, about.deterministic, parameters, about.summary)
    return table


def about(method: str) -> list[str]:
    """What there is to say of a method, line by line; nothing of one that is not installed here."""
    from baselines import registry

    try:
        found = registry.describe(registry.RENAMED.get(method, method))
    except (ImportError, InputError):
        return []
    needs, own = ", ".join(found.requires) or "nothing", ", ".join(found.environment)
    return [
        found.summary,
        f"Needs: {needs}. The same map for the same seed: {found.deterministic}.",
        *([f"A run makes it an environment: {own}."] if own else []),
        *([f"Licence: {found.licence}."] if found.licence else []),
    ]


def credit(method: str) -> tuple[str, tuple[str, ...]]:
    """Licence and BibTeX entries of a method; nothing of one that is not known here."""
    from baselines import registry

    try:
        return registry.credit(registry.RENAMED.get(method, method))
    except (ImportError, InputError):
        return "", ()


def metrics() -> Table:
    """Each metric with its unit, direction and source."""
    from benchmarks.metrics.table import METRICS

    table = _table("metric", "label", "unit", "better", "ideal", "weighting", "source")
    for name, metric in METRICS.items():
        facts = (metric.label, metric.unit, metric.better, metric.ideal, metric.weighting)
        _add(table, name, *(str(fact) for fact in facts), metric.source)
    return table


LISTS: dict[str, Callable[[], Table]] = {
    "suites": suites,
    "cases": cases,
    "methods": methods,
    "metrics": metrics,
}
