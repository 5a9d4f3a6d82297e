"""Families of trials, and the outcomes that a trial may have."""

import traceback
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

#: Accepted with the right answer; refused in one clear line.
RIGHT, REFUSED = "right", "refused"
#: Refused, but not in one clear line.
UNCLEAR = "unclear"
#: Accepted with a wrong answer.
SILENT = "silent"
#: Other errors, trials over their time limit, and processes that ended.
TRACEBACK, HANG, DIED = "traceback", "hang", "died"
#: Every outcome, in the order of the table.
OUTCOMES = (RIGHT, REFUSED, UNCLEAR, SILENT, TRACEBACK, HANG, DIED)
GOOD = (RIGHT, REFUSED)


class Finding(NamedTuple):
    """The result of a trial: one of `OUTCOMES`, the damage, and a message."""

    outcome: str
    damage: str
    message: str = ""


class WrongAnswerError(Exception):
    """An answer that differs from the right one."""


class Family(NamedTuple):
    """Trials of one kind.

    Parameters
    ----------
    name
        Shown in the table.
    attempt
        Makes the input of a seed in an empty folder, gives it to the library, and
        compares the answer with the right one.
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


def refused(damage: str, message: str) -> Finding:
    """The finding of a refusal: its message must be one clear line."""
    return Finding(REFUSED if is_clear(message) else UNCLEAR, damage, message)


def checked(damage: str, check: Callable[..., object], *arguments: object) -> Finding:
    """The finding of an answer, from a check that raises `WrongAnswerError`."""
    try:
        check(*arguments)
    except WrongAnswerError as wrong:
        return Finding(SILENT, damage, str(wrong))
    return Finding(RIGHT, damage)


def is_clear(message: str) -> bool:
    """Whether a message is one line of at most 500 printable characters."""
    return bool(message.strip()) and message.isprintable() and len(message) <= 500


def surprised(damage: str, error: BaseException) -> Finding:
    """The finding of an error that the library does not promise."""
    return Finding(TRACEBACK, damage, "".join(traceback.format_exception(error)))
