"""What the library says through the logger "parapoint": left unsaid, or said of somebody."""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Iterator

logger = logging.getLogger("parapoint")


@contextlib.contextmanager
def unsaid() -> Iterator[None]:
    """Leave warnings unsaid inside."""
    before, logger.disabled = logger.disabled, True
    try:
        yield
    finally:
        logger.disabled = before


@contextlib.contextmanager
def said_of(whom: str) -> Iterator[None]:
    """Begin each message inside with whom it is about, where it does not name them already."""

    def named(record: logging.LogRecord) -> bool:
        said = record.getMessage()
        record.msg = said if whom in said else f"{whom}: {said}"
        record.args = ()
        return True

    logger.addFilter(named)
    try:
        yield
    finally:
        logger.removeFilter(named)
