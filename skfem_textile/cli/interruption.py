"""Ctrl-C and SIGTERM on the command line: one line, and exit code 130.

The package imports this module first.  If it is the command line that runs, a signal
ends the process at once from here on, as there is nothing to lose while modules are
imported; within `raised` signals are a `KeyboardInterrupt`, and after it of no account.
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

# Seconds until a signal is sent again that came where nothing can be raised.
_LATER = 0.01

_SIGNALS = signal.SIGINT, signal.SIGTERM


@contextmanager
def raised() -> Iterator[None]:
    """Raise `KeyboardInterrupt` on SIGTERM too."""
    with _answered(_interrupt):
        yield


@contextmanager
def held() -> Iterator[None]:
    """Let what must not be cut in two end first; a second signal cuts it."""
    first: list[tuple[int, Any]] = []

    def note(number: int, frame: Any) -> None:
        if first:
            raise KeyboardInterrupt
        first.append((number, frame))

    with _answered(note) as before:
        yield
    for number, frame in first:
        answer = before[number]
        if callable(answer):
            answer(number, frame)


@contextmanager
def _answered(answer: Callable[[int, Any], None]) -> Iterator[dict[int, Any]]:
    """Answer signals that are not ignored; gives the answers before."""
    before: dict[int, Any] = {}
    if threading.current_thread() is threading.main_thread():  # no other may
        before = {number: signal.getsignal(number) for number in _SIGNALS}
    answered = [n for n, old in before.items() if old not in (signal.SIG_IGN, None)]
    for number in answered:
        signal.signal(number, answer)
    try:
        yield before
    finally:
        for number in answered:  # a command that has said all has only to end
            over = before[number] is _end
            signal.signal(number, signal.SIG_IGN if over else before[number])


def _interrupt(number: int, frame: Any) -> None:
    if _is_ignored(frame):
        threading.Timer(_LATER, os.kill, (os.getpid(), number)).start()
    else:
        raise KeyboardInterrupt


def _is_ignored(frame: Any) -> bool:
    """Whether Python prints and forgets what is raised: where objects are removed."""
    while frame is not None:
        module = frame.f_globals.get("__name__")
        if frame.f_code.co_name == "__del__" or module in ("weakref", "_weakrefset"):
            return True
        frame = frame.f_back
    return False


def _end(number: int, frame: Any) -> None:
    os.write(2, b"skfem-textile: interrupted\n")
    os._exit(INTERRUPTED)


def _is_command() -> bool:
    """Whether this process was started as the command line; its workers were not."""
    script, words = (sys.argv or [""])[0], sys.orig_argv
    if script == "-m":  # what comes after it is being looked for
        return ("-m", "skfem_textile") in pairwise(words)
    return Path(script).stem == "skfem-textile" and script in words


if _is_command():
    for _number in _SIGNALS:
        if signal.getsignal(_number) is not signal.SIG_IGN:
            signal.signal(_number, _end)
