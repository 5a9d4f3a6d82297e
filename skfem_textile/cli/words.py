"""Converters of command-line values."""

from argparse import ArgumentTypeError

from ..mesh.user_input import MOST_DEGREES


def degrees(word: str) -> float:
    """Angle in degrees, at most a hundred turns."""
    expected = f"an angle of at most {MOST_DEGREES:g} degrees"
    return _number(word, -MOST_DEGREES, MOST_DEGREES, expected)


def acute_degrees(word: str) -> float:
    """Angle in degrees between 0 and 90."""
    return _number(word, _LEAST, 90 - _LEAST, "an angle between 0 and 90 degrees")


def length(word: str) -> float:
    """Positive length in mm."""
    return _number(word, _LEAST, 1 / _LEAST, "a positive length in mm")


# Smallest positive number of an option, and the inverse of the largest.
_LEAST = 1e-12


def _number(word: str, low: float, high: float, expected: str) -> float:
    try:
        number = float(word)
    except ValueError:
        number = float("nan")
    if not low <= number <= high:
        raise ArgumentTypeError(f"expected {expected}, got {word!r}")
    return number


def unit(word: str) -> tuple[str, str]:
    """Column and unit of ``COLUMN=UNIT``."""
    name, _, unit = word.partition("=")
    if not (name and unit):
        raise ArgumentTypeError(f"expected COLUMN=UNIT, such as force=kN, got {word!r}")
    return name, unit


def column(word: str) -> tuple[str, int | str]:
    """Quantity, and number or heading of its column, of ``COLUMN=NUMBER``."""
    name, _, where = word.partition("=")
    if not (name and where):
        raise ArgumentTypeError(
            f"expected COLUMN=NUMBER or COLUMN=HEADING, such as force=3, got {word!r}"
        )
    return name, int(where) if where.isdecimal() else where


def sign(word: str) -> tuple[str, int]:
    """Column and sign of ``COLUMN=SIGN``."""
    name, _, factor = word.partition("=")
    if not name or factor not in ("1", "+1", "-1"):
        raise ArgumentTypeError(
            f"expected COLUMN=1 or COLUMN=-1, such as force=-1, got {word!r}"
        )
    return name, int(factor)


def bound(word: str) -> tuple[str, tuple[float, float]]:
    """Parameter and bounds of ``NAME=LOW,HIGH``."""
    name, _, ends = word.partition("=")
    try:
        low, high = (float(end) for end in ends.split(","))
    except ValueError:
        low = high = float("nan")
    if not (name and low < high):
        raise ArgumentTypeError(
            f"expected NAME=LOW,HIGH with LOW below HIGH, such as c1=0,1, got {word!r}"
        )
    return name, (low, high)
