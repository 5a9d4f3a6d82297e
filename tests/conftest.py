"""What every test leaves as it was."""

import logging

import pytest


@pytest.fixture(autouse=True)
def _log_as_before():
    """A run of the command line sets up the log of its whole process."""
    log = logging.getLogger("skfem_textile")
    handlers, level = log.handlers[:], log.level
    yield
    log.handlers[:] = handlers
    log.setLevel(level)
