"""Messages of packages that read files."""

import contextlib
import io
import logging
import warnings
from collections.abc import Iterator

import numpy as np


@contextlib.contextmanager
def without_messages() -> Iterator[None]:
    """Omit what other packages print, their warnings and log messages."""
    printed, disabled = io.StringIO(), logging.root.manager.disable
    logging.disable()
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
        logging.disable(disabled)
