"""Fixtures of several tests of the command line."""

from tests.helpers.intervals import no_interval  # noqa: F401
