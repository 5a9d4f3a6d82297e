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
        raise ArgumentTypeError(f"{word!r} is not an angle of at most a hundred turns")
    return angle


def unit(word: str) -> tuple[str, str]:
    """Column and unit of ``COLUMN=UNIT``."""
    name, _, unit = word.partition("=")
    if not (name and unit):
        raise ArgumentTypeError(f"{word!r} is not of the form force=kN")
    return name, unit


def bound(word: str) -> tuple[str, tuple[float, float]]:
    """Parameter and bounds of ``NAME=LOW,HIGH``."""
    name, _, ends = word.partition("=")
    try:
        low, high = (float(end) for end in ends.split(","))
    except ValueError:
        low = high = float("nan")
    if not (name and low < high):
        raise ArgumentTypeError(f"{word!r} is not of the form c1=0,1")
    return name, (low, high)
