"""Fixtures of several tests of scenes."""

from tests.helpers.forming import files, flanged  # noqa: F401
from tests.helpers.intervals import no_interval  # noqa: F401
