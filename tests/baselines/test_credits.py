"""Whom to credit: every method has a licence, and its citations are entries of one file."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import ClassVar

import pytest

from baselines import credits as credited
from baselines import registry
from parapoint.errors import InputError


def test_every_method_has_a_licence_and_cites_entries_that_there_are():
    assert credited.CREDITS.keys() == registry.METHODS.keys()
    for name in registry.METHODS:
        licence, citations = registry.credit(name)
        assert licence
        assert all(entry.startswith("@") and entry.endswith("\n}") for entry in citations)
    keys = {key for credit in credited.CREDITS.values() for key in credit.keys}
    assert keys == credited.entries().keys()


@pytest.mark.parametrize("key", credited.entries())
def test_an_entry_is_bibtex_with_author_and_title(key):
    entry = credited.entries()[key]
    assert entry.count("{") == entry.count("}")
    fields = re.findall(r"^  (\w+) = \{", entry, re.MULTILINE)
    assert {"author", "title"} <= set(fields)
    assert len(fields) == len(set(fields))


def test_the_citation_is_that_of_the_method():
    assert "Scalable Locally Injective Mappings" in registry.credit("slim")[1][0]
    assert "arXiv:2403.10349" in registry.credit("parapoint")[1][0]
    assert registry.credit("xatlas")[0] == "MIT (xatlas)"


@dataclass(frozen=True)
class Credited:
    """A plugin that says whom to credit."""

    requires: ClassVar[frozenset[str]] = frozenset()
    licence: ClassVar[str] = "ISC"
    citation: ClassVar[str] = "@misc{me, title = {It}}"

    def parameterize(self, surface, *, seed): ...


def test_a_plugin_says_its_own(monkeypatch):
    monkeypatch.setattr(registry, "_plugins", {"credited": Credited})
    assert registry.credit("credited") == ("ISC", ("@misc{me, title = {It}}",))
    found = registry.describe("credited")
    assert (found.licence, found.citations) == ("ISC", ("@misc{me, title = {It}}",))
    monkeypatch.delattr(Credited, "licence")
    monkeypatch.delattr(Credited, "citation")
    assert registry.credit("credited") == ("", ())
    with pytest.raises(InputError):
        registry.credit("nobody")
