"""The log of runs whose warnings a study does not show."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager

_NAME = "skfem_textile"


@contextmanager
def errors_only() -> Iterator[None]:
    """Log errors only."""
    log = logging.getLogger(_NAME)
    level = log.level
    log.setLevel(logging.ERROR)
    try:
        yield
    finally:
        log.setLevel(level)


class _Collector(logging.Handler):
    def __init__(self, texts: list[str]) -> None:
        super().__init__(logging.WARNING)
        self.texts = texts

    def emit(self, record: logging.LogRecord) -> None:
        self.texts.append(record.getMessage())


@contextmanager
def warnings_collected() -> Iterator[list[str]]:
    """Collect the texts of warnings and errors in a list, and log none of them."""
    log, texts = logging.getLogger(_NAME), list[str]()
    collector, propagate = _Collector(texts), log.propagate
    log.addHandler(collector)
    log.propagate = False
    try:
        yield texts
    finally:
        log.propagate = propagate
        log.removeHandler(collector)
