"""Fixtures of several tests of the command line."""

from tests.helpers.estimates import no_estimate  # noqa: F401
