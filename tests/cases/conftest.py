"""Fixtures of several tests of cases."""

from tests.helpers.intervals import no_interval  # noqa: F401
