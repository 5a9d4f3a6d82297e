"""Fixtures of several tests of scenes."""

from tests.helpers.estimates import no_estimate  # noqa: F401
