"""Frozen dataclasses as JSON: written field by field, and checked field by field when read.

The rows of a results folder and the messages between the processes of a run both go through here,
so neither can hand on a field of the wrong type.
"""

from __future__ import annotations

import dataclasses
import functools
import json
import math
import types
import typing
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import numpy as np

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

    Record = TypeVar("Record", bound=DataclassInstance)

_NOT_FINITE = {"inf": math.inf, "-inf": -math.inf, "nan": math.nan}
"""The numbers that JSON lacks, by the text that `plain` writes for them."""


def plain(value: object) -> Any:
    """`value` as JSON can hold it: numpy becomes Python, and a number that is not finite text."""
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if isinstance(value, float):
        return value if math.isfinite(value) else str(value)
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, Mapping):
        return {str(key): plain(entry) for key, entry in value.items()}
    if isinstance(value, set | frozenset):
        return sorted(plain(entry) for entry in value)
    if isinstance(value, list | tuple):
        return [plain(entry) for entry in value]
    return str(value)


def fields_of(record: DataclassInstance) -> dict[str, Any]:
    """The fields of `record` by name, as JSON can hold them."""
    return {field.name: plain(getattr(record, field.name)) for field in dataclasses.fields(record)}


def from_fields(kind: type[Record], fields: object) -> Record:
    """The record of class `kind` whose `fields_of` are given.

    Raises:
        ValueError: a field is missing, unknown, or of the wrong type; the message names it.
    """
    if not isinstance(fields, dict):
        raise ValueError(f"{kind.__name__} needs an object with its fields")  # noqa: TRY004  bad input
    readers = _readers(kind)
    values = {}
    for name, value in fields.items():
        if name not in readers:
            raise ValueError(f"{kind.__name__} has no field {name!r:.100}")
        try:
            values[name] = readers[name](value)
        except (ValueError, OverflowError):
            raise ValueError(f"{kind.__name__}.{name} cannot be {value!r:.100}") from None
    try:
        return kind(**values)
    except TypeError as error:
        raise ValueError(f"{kind.__name__} lacks a field: {error}") from None


def loaded(line: bytes) -> Any:
    """What a line of JSON says.

    Raises:
        ValueError: the line is not JSON, or is nested too deeply to read.
    """
    try:
        return json.loads(line)
    except RecursionError:
        raise ValueError("the line is nested too deeply") from None


@functools.cache
def _readers(kind: type) -> dict[str, Callable[[Any], Any]]:
    """For each field of a dataclass, what turns its JSON value back and raises on a wrong one."""
    hints = typing.get_type_hints(kind)
    return {field.name: _reader(hints[field.name]) for field in dataclasses.fields(kind)}


def _reader(hint: Any) -> Callable[[Any], Any]:
    """What turns a JSON value into one of type `hint`, or raises ValueError."""
    origin, options = typing.get_origin(hint), typing.get_args(hint)
    if hint is object:
        return lambda value: value
    if hint is float:
        return _number
    if hint is Path:
        return lambda value: Path(_of_type(value, str))
    if origin is Literal:
        return lambda value: value if _of_type(value, str) in options else _refuse(value)
    if origin is types.UnionType:  # `X | None` is the only one in use
        (inner,) = (_reader(option) for option in options if option is not types.NoneType)
        return lambda value: None if value is None else inner(value)
    if origin is tuple:  # `tuple[X, ...]` is the only one in use
        inner = _reader(options[0])
        return lambda value: tuple(inner(entry) for entry in _of_type(value, list))
    if origin is not None and issubclass(origin, Mapping):
        inner = _reader(options[1])
        if options[1] is object:
            return lambda value: _of_type(value, dict)
        return lambda value: {key: inner(entry) for key, entry in _of_type(value, dict).items()}
    return lambda value: _of_type(value, hint)


def _number(value: Any) -> float:
    """A float from its JSON value."""
    if isinstance(value, str) and value in _NOT_FINITE:
        return _NOT_FINITE[value]
    if isinstance(value, bool) or not isinstance(value, int | float):
        _refuse(value)
    return float(value)


def _of_type(value: Any, kind: type) -> Any:
    """`value`, which must be of type `kind`; a bool passes only for a bool."""
    if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
        _refuse(value)
    return value


def _refuse(value: Any) -> typing.Never:
    """Refuse a value; `from_fields` says which field it was for.

    Raises:
        ValueError: always.
    """
    raise ValueError(value)
