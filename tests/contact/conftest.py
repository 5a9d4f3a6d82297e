"""Fixtures of several tests of contact."""

from tests.helpers.forming import files, flanged, hemisphere, stopped  # noqa: F401
