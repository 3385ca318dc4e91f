"""What holds for all tests."""

import pytest

from parapoint.files import decoding


def pytest_collection_modifyitems(items):
    """Begin with the tests that are marked as long."""
    items.sort(key=lambda item: item.get_closest_marker("long") is None)


@pytest.fixture(autouse=True, scope="session")
def nothing_is_installed():
    """Keep pip from the network, also in the processes that tests start: environments of methods
    would be gigabytes."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PIP_NO_INDEX", "1")
        yield


@pytest.fixture(autouse=True, scope="session")
def output_is_buffered():
    """Python buffers what is printed, as on most machines: what must not be lost is said by us."""
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("PYTHONUNBUFFERED", raising=False)
        yield


@pytest.fixture(autouse=True)
def files_decode_to_little():
    """What one test allows files to decode to, as by `--memory`, is not allowed in the next."""
    decoding.allow(decoding.DECODED_LEAST)
