"""What a user gives, and what a user's functions answer, refused in one line."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy import ndarray


def asked(what: str, function: Callable, *arguments: Any) -> Any:
    """The answer of a user's function.

    Raises
    ------
    ValueError
        If the function fails; the message says ``what`` it is.
    """
    try:
        return function(*arguments)
    except Exception as error:  # a user's function may raise anything
        reason = f"{type(error).__name__} {error}".strip().partition("\n")[0]
        raise ValueError(f"{what} fails: {reason}") from error


def real_numbers(what: str, given: Any) -> ndarray:
    """An array of real numbers.

    Raises
    ------
    ValueError
        If it is none; the message says ``what`` it is.
    """
    try:
        array = np.asarray(given)
        if array.dtype.kind in "biufO":
            return array.astype(float)
    except (TypeError, ValueError):  # as of lists of different lengths
        pass
    raise ValueError(f"{what} must be real numbers, got {_shown(given)}")


def _shown(given: Any) -> str:
    """A thing in a few words of one line."""
    text = " ".join(repr(given).split())
    return text if len(text) <= 60 else type(given).__name__
