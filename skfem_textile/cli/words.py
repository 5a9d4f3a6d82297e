"""Readers of the words of the command line."""

import argparse
import tomllib
from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

from ..mesh.user_input import MOST_DEGREES

_Value = TypeVar("_Value")


def _told(read: Callable[[str], _Value]) -> Callable[[str], _Value]:
    """A reader whose ValueError argparse reports as it is."""

    @wraps(read)
    def reading(word: str) -> _Value:
        try:
            return read(word)
        except ValueError as error:
            raise argparse.ArgumentTypeError(str(error)) from None

    return reading


@_told
def degrees(word: str) -> float:
    """A finite angle of at most a hundred turns."""
    try:
        angle = float(word)
    except ValueError:
        angle = float("nan")
    if not abs(angle) <= MOST_DEGREES:
        raise ValueError(f"{word!r} is no angle of at most a hundred turns")
    return angle


@_told
def unit(word: str) -> tuple[str, str]:
    """A column and its unit of ``COLUMN=UNIT``."""
    name, _, unit = word.partition("=")
    if not (name and unit):
        raise ValueError(f"{word!r} is not like force=kN")
    return name, unit


@_told
def bound(word: str) -> tuple[str, tuple[float, float]]:
    """A parameter and its ends of ``NAME=LOW,HIGH``."""
    name, _, ends = word.partition("=")
    try:
        low, high = (float(end) for end in ends.split(","))
    except ValueError:
        low = high = float("nan")
    if not (name and low < high):
        raise ValueError(f"{word!r} is not like c1=0,1")
    return name, (low, high)


@_told
def setting(word: str) -> tuple[str, Any]:
    """The path and the value of ``path.to.key=value``, the value as in a case file."""
    path, equals, value = word.partition("=")
    if not equals or "." not in path or not all(path.split(".")):
        raise ValueError(f"{word!r} is not like stepping.steps=5")
    return path, _value(value)


@_told
def pair(word: str) -> tuple[str, Any]:
    """The name and the value of ``NAME=VALUE``, several values with commas."""
    name, _, value = word.partition("=")
    if not (name and value):
        raise ValueError(f"{word!r} is not like top=0,40")
    parts = [_value(part) for part in value.split(",")]
    return name, parts if len(parts) > 1 else parts[0]


def _value(word: str) -> Any:
    """A value as TOML has it, numbers with commas as an array, or else the word."""
    for text in (word, f"[{word}]"):
        try:
            return tomllib.loads(f"x = {text}")["x"]
        except (ValueError, RecursionError):
            continue
    return word


@_told
def size(word: str) -> list[int]:
    """Elements along x and y of ``NXxNY``."""
    try:
        nx, ny = (int(n) for n in word.split("x"))
    except ValueError:
        raise ValueError(f"{word!r} is not like 10x15") from None
    return [nx, ny]
