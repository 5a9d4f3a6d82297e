"""Converters of command-line values."""

import re
import tomllib
from argparse import ArgumentTypeError
from pathlib import Path
from typing import Any

from ..mesh.user_input import MOST_DEGREES

# Suffix of case files.
_SUFFIX = ".toml"

#: A case file in a help text.
CASE_FILE = f"CASE{_SUFFIX}"

# Upper bound on the depth of a key path.
_MOST_KEYS = 9


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


def is_case_file(word: str) -> bool:
    """True if the argument given as scene is the name of a case file."""
    return word.lower().endswith(_SUFFIX)


def case_file(text: str) -> Path:
    """Name of a case file to write."""
    if not is_case_file(text):
        raise ArgumentTypeError(
            f"the name of a case file must end with {_SUFFIX}, got {text!r}"
        )
    return Path(text)


def setting(word: str) -> tuple[str, Any]:
    """Path and value of ``path.to.key=value``, the value as in a case file."""
    path, equals, value = word.partition("=")
    keys = path.split(".")
    if not equals or not 1 < len(keys) < _MOST_KEYS or not all(keys):
        raise ArgumentTypeError(
            f"expected KEY=VALUE, such as stepping.steps=5, got {word!r}"
        )
    return path, _value(value)


def pair(word: str) -> tuple[str, Any]:
    """Name and value of ``NAME=VALUE``; several values are separated by commas."""
    name, _, value = word.partition("=")
    if not (name and value):
        raise ArgumentTypeError(f"expected NAME=VALUE, such as top=0,40, got {word!r}")
    parts = [_value(part) for part in value.split(",")]
    return name, parts if len(parts) > 1 else parts[0]


def _value(word: str) -> Any:
    """Value in TOML syntax, comma-separated numbers as an array, else the text."""
    if re.fullmatch(r"[-+]?(\d+|(\d+\.\d*|\.\d+)([eE][-+]?\d+)?)", word):
        return int(word) if word.lstrip("+-").isdigit() else float(word)
    for text in (word, f"[{word}]"):
        try:
            parsed = tomllib.loads(f"x = {text}")
        except (ValueError, RecursionError):
            continue
        if [*parsed] == ["x"]:
            return parsed["x"]
    return word


def size(word: str) -> list[int]:
    """Elements along x and y of ``NXxNY``."""
    try:
        nx, ny = (int(n) for n in word.split("x"))
    except ValueError:
        raise ArgumentTypeError(
            f"expected NXxNY, such as 10x15, got {word!r}"
        ) from None
    return [nx, ny]


def folder(text: str) -> Path:
    """Name of a folder."""
    if not text:
        raise ArgumentTypeError("the name of a folder must not be empty")
    if text.startswith("--"):  # argparse does not recognise it as an option
        raise ArgumentTypeError(
            f"{text!r} is not an option: write ./{text} for a folder of this name"
        )
    return Path(text)
