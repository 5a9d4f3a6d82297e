"""Fixtures of several tests of the command line."""

from tests.helpers.quick import no_estimate  # noqa: F401
