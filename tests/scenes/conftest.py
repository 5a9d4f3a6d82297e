"""Fixtures of several tests of scenes."""

from tests.helpers.intervals import no_interval  # noqa: F401
