"""Families of hostile inputs: rejected in one clear line, or computed correctly.

A family has a strategy of inputs, and an attempt that gives an input to the library and
compares the result with the correct one.  Tests try a few inputs of each; the study of
hostile inputs tries many and counts the outcomes.
"""

import contextlib
import ctypes
import os
import re
import signal
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

RIGHT, REFUSED = "right", "refused"

# Option of prctl on Linux: the signal that a process receives when its parent ends.
_PR_SET_PDEATHSIG = 1

#: Generators of the random numbers of valid inputs, which Hypothesis does not shrink.
seeds = st.integers(0, 2**32 - 1)


class UnclearError(AssertionError):
    """A rejection without one clear line."""


class WrongAnswerError(AssertionError):
    """An accepted input with a wrong answer, or a rejected valid input."""


class Family(NamedTuple):
    """Hostile inputs of one family.

    Parameters
    ----------
    name
        Shown in the table of the study.
    inputs
        The inputs of each kind; the study tries all kinds equally often.
    attempt
        Gives an input to the library, in an empty working directory.  Returns `RIGHT`
        or `REFUSED`; raises `UnclearError`, `WrongAnswerError` or other errors of the
        library.
    trials, short
        Number of inputs in the study, and in its short form.
    seconds
        The time limit of one trial of the study.
    """

    name: str
    inputs: Mapping[str, st.SearchStrategy]
    attempt: Callable[[Any], str]
    trials: int
    short: int = 30
    seconds: float = 20.0

    def check(self, examples: int) -> None:
        """Try a few inputs of every kind; raises the error of the simplest failure."""
        if os.name != "posix":
            pytest.skip("pipes, links and signals are POSIX's")

        def attempt(hostile):
            self.outcome(hostile)

        # Hypothesis stores failures by this name.
        attempt.__name__ = re.sub(r"\W", "_", self.name)
        tried = given(st.one_of(*self.inputs.values()))(attempt)
        few = settings(max_examples=examples, suppress_health_check=list(HealthCheck))
        few(tried)()

    def outcome(self, hostile: Any) -> str:
        """`RIGHT` or `REFUSED`, of an attempt in a separate folder."""
        with (
            tempfile.TemporaryDirectory("", "hostile-", None, True) as folder,
            contextlib.chdir(folder),
        ):
            return self.attempt(hostile)


def rejected(message: object) -> str:
    """`REFUSED` if the message of a rejection is one clear line."""
    if not is_clear(str(message)):
        raise UnclearError(message)
    return REFUSED


def rejected_if_damaged(message: object, damage: str) -> str:
    """`REFUSED` if the message is clear and the input was in fact damaged."""
    if not damage:
        raise WrongAnswerError(f"refused though whole: {message}")
    return rejected(message)


def is_clear(message: str) -> bool:
    """True if a message is one line of at most 500 printable characters."""
    return bool(message.strip()) and message.isprintable() and len(message) <= 500


def expect(holds: object, message: object) -> None:
    """Raise `WrongAnswerError` unless a condition holds."""
    if not holds:
        raise WrongAnswerError(message)


def expect_equal(name: str, value: Any, expected: Any) -> None:
    """Raise `WrongAnswerError` unless a value is as expected."""
    expect(value == expected, f"{name}: {value}, expected {expected}")


def expect_close(name: str, value: Any, expected: Any, tolerance: float) -> None:
    """Raise `WrongAnswerError` if numbers differ by more than a tolerance."""
    error = np.abs(np.asarray(value) - expected).max(initial=0.0)
    expect(error <= tolerance, f"{name}: {value}, expected {expected}, off by {error}")


def folder_content(folder: Path) -> dict[str, bytes]:
    """Bytes of every file by name; target of every link, mode of everything else."""
    content = {}
    for path in sorted(folder.rglob("*")):
        name = str(path.relative_to(folder))
        if path.is_symlink():
            content[name] = f"link to {os.readlink(path)}".encode()
        elif path.is_file():
            content[name] = path.read_bytes()
        else:
            content[name] = f"mode {path.lstat().st_mode}".encode()
    return content


def end_with_parent(parent: int) -> None:
    """Let Linux kill this process when its parent ends."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:  # it has ended already
        os._exit(1)
