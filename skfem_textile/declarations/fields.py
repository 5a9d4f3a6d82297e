"""Metadata of parameters: unit, meaning and limits."""

from dataclasses import dataclass
from typing import Any, ClassVar


@dataclass(frozen=True)
class About:
    """Meaning of a key."""

    text: str


about = About


@dataclass(frozen=True)
class Key:
    """Name of a key without its unit, if it is not the name of the parameter."""

    name: str


@dataclass(frozen=True)
class Unit:
    """Unit in a case file, the end of the key; angles are in radians in Python."""

    name: str


@dataclass(frozen=True)
class Range:
    """Limits of a number in the unit of a case file."""

    above: float
    most: float


@dataclass(frozen=True)
class InFile:
    """Default in a case file, if there is another one in Python.

    The key is required if the default is `REQUIRED`.
    """

    default: Any


@dataclass(frozen=True)
class _Mark:
    """Metadata without a value."""

    name: str


#: Metadata of a key whose value is the name of a file.
FILE = _Mark("file")

REQUIRED = _Mark("required")

MM, DEGREES = Unit("mm"), Unit("deg")
N_PER_MM, N_PER_MM2 = Unit("N_per_mm"), Unit("N_per_mm2")


@dataclass(frozen=True)
class Declared:
    """Base of dataclasses of parameters, each the keys of a table of a case file.

    Parameters without `about` exist in Python only.  A docstring begins with the
    summary that help texts print.

    Parameters
    ----------
    module
        Module of the package that contains the class of the same name, or the function
        of the same name in lower case.
    """

    module: ClassVar[str] = ""

    def __init_subclass__(cls, module: str | None = None, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        if module is not None:
            cls.module = module
