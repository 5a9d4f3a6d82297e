"""Messages of packages that read files."""

import contextlib
import io
import logging
import warnings
from collections.abc import Iterator

import numpy as np

# Packages that log messages about files.
_LOGGING = ("trimesh", "ezdxf")


@contextlib.contextmanager
def without_messages() -> Iterator[None]:
    """Omit what other packages print, their warnings and log messages."""
    printed = io.StringIO()
    logs = [logging.getLogger(name) for name in _LOGGING]
    levels = [log.level for log in logs]
    for log in logs:
        log.setLevel(logging.CRITICAL + 1)
    try:
        with (
            contextlib.redirect_stdout(printed),
            contextlib.redirect_stderr(printed),
            warnings.catch_warnings(),
            np.errstate(all="ignore"),
        ):
            warnings.simplefilter("ignore")
            yield
    finally:
        for log, level in zip(logs, levels, strict=True):
            log.setLevel(level)
