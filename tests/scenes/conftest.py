"""Fixtures of several tests of scenes."""

from tests.helpers.quick import no_estimate  # noqa: F401
