"""A tool that several tests lay plies on."""

import pytest

from tests.helpers.tools import plate, write


@pytest.fixture(scope="session")
def tool(tmp_path_factory):
    return write(tmp_path_factory.mktemp("tool") / "bump.stl", *plate())
