"""Messages are left unsaid where nobody asked for them, or name whom they are about."""

import logging

import pytest

from parapoint.messages import said_of, unsaid

logger = logging.getLogger("parapoint")


def test_nothing_is_said_inside_also_where_it_ends_in_an_error(caplog):
    def fail():
        logger.warning("of points that we drew")
        raise ValueError("wrong")

    with pytest.raises(ValueError, match="wrong"), unsaid():
        fail()
    logger.warning("of the user's")
    assert caplog.messages == ["of the user's"]


def test_a_message_names_once_whom_it_is_about(caplog):
    with said_of("a 100%.off"):
        logger.warning("%d lines left out", 2)
        logger.warning("%s: its picture is not found", "a 100%.off")
    logger.warning("%d more", 3)
    assert caplog.messages == [
        "a 100%.off: 2 lines left out",
        "a 100%.off: its picture is not found",
        "3 more",
    ]
