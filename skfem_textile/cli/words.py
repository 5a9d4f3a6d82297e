"""Converters of command-line values."""

from argparse import ArgumentTypeError

from ..mesh.user_input import MOST_DEGREES


def degrees(word: str) -> float:
    """Angle in degrees, at most a hundred turns."""
    try:
        angle = float(word)
    except ValueError:
        angle = float("nan")
    if not abs(angle) <= MOST_DEGREES:
        raise ArgumentTypeError(
            f"expected an angle of at most {MOST_DEGREES:g} degrees, got {word!r}"
        )
    return angle


def acute_degrees(word: str) -> float:
    """Angle in degrees between 0 and 90."""
    try:
        angle = float(word)
    except ValueError:
        angle = float("nan")
    if not 0 < angle < 90:
        raise ArgumentTypeError(
            f"expected an angle between 0 and 90 degrees, got {word!r}"
        )
    return angle


def length(word: str) -> float:
    """Positive length in mm."""
    try:
        size = float(word)
    except ValueError:
        size = float("nan")
    if not 0 < size < float("inf"):
        raise ArgumentTypeError(f"expected a positive length in mm, got {word!r}")
    return size


def unit(word: str) -> tuple[str, str]:
    """Column and unit of ``COLUMN=UNIT``."""
    name, _, unit = word.partition("=")
    if not (name and unit):
        raise ArgumentTypeError(f"expected COLUMN=UNIT, such as force=kN, got {word!r}")
    return name, unit


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
