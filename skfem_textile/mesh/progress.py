"""Progress of long computations, and their log, on stderr.

Nothing is shown in the first two seconds.  A terminal or a notebook then shows one
line, which is erased at the end.  Elsewhere the command line prints a line after ten
seconds, and others after twice the time each, and other programs print nothing unless
`SWITCH` is 1.
"""

import logging
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from datetime import timedelta
from multiprocessing import parent_process
from threading import Event, Thread, current_thread, main_thread
from time import perf_counter
from typing import TextIO

#: Environment variable: with 0 no progress is shown, with 1 it is also printed where
#: stderr is not a terminal.
SWITCH = "SKFEM_TEXTILE_PROGRESS"

# Seconds before a line is shown, between its updates, and before one is printed.
_DELAY, _REFRESH, _PRINTED = 2.0, 0.5, 10.0

# Width of a line where a terminal reports none, as in a notebook.
_WIDTH = 100

# Running computations; the last one is shown.
_running: list[Callable[[], str]] = []

# Stream and width of the visible line.
_visible: tuple[TextIO, int] | None = None


@contextmanager
def shown(work: str | Callable[[], str], printed: bool = False) -> Iterator[None]:
    """Show what is being computed.

    An inner computation replaces the outer one until it ends.  Worker threads and
    processes show nothing.  Where something may be shown, a second thread displays it,
    so that the computation itself checks no time.

    Parameters
    ----------
    work
        Description, or a function that returns the current one.
    printed
        Print lines where stderr is not a terminal.
    """
    text = work if callable(work) else lambda: work
    stream = sys.stderr
    if current_thread() is not main_thread() or parent_process():
        yield
    elif _running:
        _running.append(text)
        try:
            yield
        finally:
            _running.pop()
    elif not _is_wanted(stream, printed):
        yield
    else:
        end = Event()
        display = Thread(target=_show, args=(stream, end.wait), daemon=True)
        _running.append(text)
        try:
            display.start()
            yield
        finally:
            end.set()
            _running.clear()
            display.join()


@contextmanager
def unlogged() -> Iterator[None]:
    """Omit warnings in the log that a run has given before."""
    log = logging.getLogger("skfem_textile")
    level = log.level
    log.setLevel(logging.ERROR)
    try:
        yield
    finally:
        log.setLevel(level)


def clear() -> None:
    """Erase the visible line before other output; its next update shows it again."""
    global _visible
    if _visible:
        (stream, width), _visible = _visible, None
        with suppress(OSError, ValueError):  # a closed stream
            stream.write(f"\r{'':{width}}\r")
            stream.flush()


def log_to_stderr(verbose: int) -> None:
    """Send the log to stderr, with every step for 1, every iteration for 2."""
    handler = logging.StreamHandler()
    handler.setFormatter(_Formatter("%(message)s"))
    log = logging.getLogger("skfem_textile")
    log.handlers[:] = [handler]
    log.setLevel([logging.WARNING, logging.INFO, logging.DEBUG][min(verbose, 2)])


class _Formatter(logging.Formatter):
    """Formatter that erases the visible line of progress before each message."""

    def format(self, record: logging.LogRecord) -> str:
        clear()
        return super().format(record)


def _show(stream: TextIO, wait: Callable[[float], bool]) -> None:
    """Show the running computation until ``wait``, given seconds, returns true."""
    global _visible
    began, refreshed = perf_counter(), _is_refreshed(stream)
    first, period = (_DELAY, _REFRESH) if refreshed else (_PRINTED, _PRINTED)
    width = _width(stream)
    done = wait(first)
    with suppress(OSError, ValueError, IndexError):  # a closed stream, or the end
        while not done:
            elapsed = timedelta(seconds=round(perf_counter() - began))
            line = f"{elapsed} {_running[-1]()}"
            if refreshed:
                _visible = stream, width
                stream.write(f"\r{line[:width]:{width}}\r")
            else:
                stream.write(f"{line}\n")
            stream.flush()
            done = wait(period)
            period *= 1 if refreshed else 2
    clear()


def _is_wanted(stream: TextIO | None, printed: bool) -> bool:
    switch = os.environ.get(SWITCH)
    if stream is None or switch == "0":
        return False
    return printed or switch == "1" or _is_refreshed(stream)


def _is_refreshed(stream: TextIO) -> bool:
    """True if a carriage return overwrites a line, as on terminals and in notebooks."""
    if "ipykernel" in sys.modules:
        return True
    try:
        return stream.isatty() and os.environ.get("TERM") != "dumb"
    except (AttributeError, ValueError):  # a stream of a user, or a closed one
        return False


def _width(stream: TextIO) -> int:
    columns = 0
    with suppress(AttributeError, OSError, ValueError):
        columns = os.get_terminal_size(stream.fileno()).columns
    return columns - 1 if columns > 1 else _WIDTH
