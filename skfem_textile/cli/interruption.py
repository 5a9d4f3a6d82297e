"""Ctrl-C and SIGTERM on the command line: one line, and exit code 130.

`cli` imports this module first.  While modules are imported, a signal ends the process
of the command line at once, because nothing can be lost.  Within `raised` a signal
raises `KeyboardInterrupt`.  After `raised`, signals are ignored.
"""

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any

#: Exit code after an interruption.
INTERRUPTED = 130

# Seconds until a signal is sent again where its exception would be lost.
_LATER = 0.01

# Module that calls RSLAB, which ends the process if Python code that it calls, such as
# its first import of NumPy, raises an exception.
_RSLAB = "skfem_textile.solve.linear.rslab"

_SIGNALS = signal.SIGINT, signal.SIGTERM


@contextmanager
def raised() -> Iterator[None]:
    """Raise `KeyboardInterrupt` also on SIGTERM."""
    with _handled(_interrupt):
        yield


@contextmanager
def held() -> Iterator[None]:
    """Defer a signal until the block ends; a second signal interrupts it."""
    first: list[tuple[int, Any]] = []

    def note(number: int, frame: Any) -> None:
        if first:
            raise KeyboardInterrupt
        first.append((number, frame))

    with _handled(note) as before:
        yield
    for number, frame in first:
        answer = before[number]
        if callable(answer):
            answer(number, frame)


@contextmanager
def _handled(handler: Callable[[int, Any], None]) -> Iterator[dict[int, Any]]:
    """Handle signals that are not ignored; yields the previous handlers."""
    before: dict[int, Any] = {}
    if threading.current_thread() is threading.main_thread():  # other threads may not
        before = {number: signal.getsignal(number) for number in _SIGNALS}
    handled = [n for n, old in before.items() if old not in (signal.SIG_IGN, None)]
    for number in handled:
        signal.signal(number, handler)
    try:
        yield before
    finally:
        for number in handled:  # a completed command only has to exit
            over = before[number] is _end
            signal.signal(number, signal.SIG_IGN if over else before[number])


def _interrupt(number: int, frame: Any) -> None:
    if _is_lost(frame):
        threading.Timer(_LATER, os.kill, (os.getpid(), number)).start()
    else:
        raise KeyboardInterrupt


def _is_lost(frame: Any) -> bool:
    """True where an exception is dropped, as in finalisers, or ends the process."""
    innermost = frame
    while frame is not None:
        module = frame.f_globals.get("__name__")
        if module == _RSLAB and frame is not innermost:
            return True
        if frame.f_code.co_name == "__del__" or module in ("weakref", "_weakrefset"):
            return True
        frame = frame.f_back
    return False


def _end(number: int, frame: Any) -> None:
    os.write(2, b"skfem-textile: interrupted\n")
    os._exit(INTERRUPTED)


def is_command() -> bool:
    """True if this process is the command line, not one of its workers."""
    script, words = (sys.argv or [""])[0], sys.orig_argv
    if script.endswith("__main__.py"):
        return ("-m", "skfem_textile") in pairwise(words)
    return Path(script).stem == "skfem-textile" and script in words


if is_command():
    for _number in _SIGNALS:
        if signal.getsignal(_number) is not signal.SIG_IGN:
            signal.signal(_number, _end)
