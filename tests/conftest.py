"""What holds for all tests."""

import os

import pytest


@pytest.fixture(autouse=True, scope="session")
def nothing_is_installed():
    """Keep pip from the network, also in the processes that tests start: environments of methods
    would be gigabytes."""
    before = os.environ.get("PIP_NO_INDEX")
    os.environ["PIP_NO_INDEX"] = "1"
    yield
    os.environ.pop("PIP_NO_INDEX")
    if before is not None:
        os.environ["PIP_NO_INDEX"] = before
