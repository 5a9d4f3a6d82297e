"""A trial, its outcome, and the families of trials."""

import traceback
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

#: What may come of a trial, the good outcomes first.
RIGHT, REFUSED = "right", "refused"
#: Refused in other words than one clear line.
UNCLEAR = "unclear"
TRACEBACK, HANG, DIED, SILENT = "traceback", "hang", "died", "silent"
OUTCOMES = (RIGHT, REFUSED, UNCLEAR, SILENT, TRACEBACK, HANG, DIED)
GOOD = (RIGHT, REFUSED)


class Finding(NamedTuple):
    """What came of a trial: one of `OUTCOMES`, what was done, what was said."""

    outcome: str
    damage: str
    said: str = ""


class Family(NamedTuple):
    """Trials of one kind.

    Parameters
    ----------
    name
        Shown in the table.
    attempt
        Makes the input of a seed in an empty folder, gives it to the library, and
        judges the answer.
    trials
        How many seeds, from 0 on, the whole suite takes.
    short
        How many of them the short form takes.
    seconds
        The time limit of one trial.
    """

    name: str
    attempt: Callable[[int, Path], Finding]
    trials: int
    short: int
    seconds: float = 20.0


def refused(damage: str, line: str) -> Finding:
    """The finding of a refusal: what it says must be one clear line."""
    outcome = REFUSED if is_clear(line) else UNCLEAR
    return Finding(outcome, damage, line)


def is_clear(line: str) -> bool:
    """Whether a message is one line of printable characters that a reader can use."""
    return bool(line.strip()) and line.isprintable() and len(line) <= 500


def surprised(damage: str, error: BaseException) -> Finding:
    """The finding of an error that the library does not promise."""
    return Finding(TRACEBACK, damage, "".join(traceback.format_exception(error)))
