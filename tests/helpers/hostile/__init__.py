"""Families of hostile inputs: refused in one clear line, or answered rightly.

A family has a strategy of inputs, and an attempt that gives an input to the library and
compares the answer with the right one.  Tests try a few inputs of each, the study of
hostile inputs tries many and counts how they end.
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

# Option of prctl on Linux: the signal that a process gets when its parent ends.
_PR_SET_PDEATHSIG = 1

#: Generators of the random numbers of sound inputs, which Hypothesis does not shrink.
seeds = st.integers(0, 2**32 - 1)


class UnclearError(AssertionError):
    """A refusal that is not one clear line."""


class WrongAnswerError(AssertionError):
    """An input that is accepted with a wrong answer, or refused though it is sound."""


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
        or `REFUSED`, and raises `UnclearError`, `WrongAnswerError` or whatever else the
        library lets out.
    trials, short
        How many inputs the study takes, and its short form.
    seconds
        The time limit of one trial of the study.
    """

    name: str
    inputs: Mapping[str, st.SearchStrategy]
    attempt: Callable[[Any], str]
    trials: int
    short: int = 30
    seconds: float = 20.0

    def holds(self, examples: int) -> None:
        """Try a few inputs of all kinds; raises what the simplest bad one raises."""
        if os.name != "posix":
            pytest.skip("pipes, links and signals are POSIX's")

        def attempt(hostile):
            self.outcome(hostile)

        # Hypothesis keeps what has failed by the name.
        attempt.__name__ = re.sub(r"\W", "_", self.name)
        tried = given(st.one_of(*self.inputs.values()))(attempt)
        few = settings(max_examples=examples, suppress_health_check=list(HealthCheck))
        few(tried)()

    def outcome(self, hostile: Any) -> str:
        """`RIGHT` or `REFUSED`, of an attempt in a folder of its own."""
        with (
            tempfile.TemporaryDirectory("", "hostile-", None, True) as folder,
            contextlib.chdir(folder),
        ):
            return self.attempt(hostile)


def refused(message: object) -> str:
    """`REFUSED` if the message of a refusal is one clear line."""
    if not is_clear(str(message)):
        raise UnclearError(message)
    return REFUSED


def refused_if_damaged(message: object, damage: str) -> str:
    """`REFUSED` if the message is clear and the input was damaged at all."""
    if not damage:
        raise WrongAnswerError(f"refused though whole: {message}")
    return refused(message)


def is_clear(message: str) -> bool:
    """Whether a message is one line of at most 500 printable characters."""
    return bool(message.strip()) and message.isprintable() and len(message) <= 500


def demand(holds: object, message: object) -> None:
    """Raise `WrongAnswerError` unless a condition holds."""
    if not holds:
        raise WrongAnswerError(message)


def demand_equal(what: str, value: Any, expected: Any) -> None:
    """Raise `WrongAnswerError` unless a value is as expected."""
    demand(value == expected, f"{what}: {value}, expected {expected}")


def demand_near(what: str, value: Any, expected: Any, tolerance: float) -> None:
    """Raise `WrongAnswerError` if numbers are off by more than a tolerance."""
    off = np.abs(np.asarray(value) - expected).max(initial=0.0)
    demand(off <= tolerance, f"{what}: {value}, expected {expected}, off by {off}")


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
