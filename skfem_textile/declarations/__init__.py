"""Parameters of laws, formulations, surfaces and scenes, with their keys in case files.

A parameter is a field of a dataclass, with its unit, default and meaning.  The class or
function that has the parameters inherits or takes them, and the table of a case file,
the options of the command line and the reference of all keys are derived from them.
These modules import neither NumPy nor scikit-fem, so that a help text does not either.
"""

from collections.abc import Callable
from dataclasses import MISSING, dataclass, field
from math import radians
from typing import Any, TypeVar, dataclass_transform

_T = TypeVar("_T")

#: Default in a case file of a parameter that it must state.
REQUIRED = MISSING

_AS_IN_PYTHON = object()


@dataclass(frozen=True)
class Key:
    """Key of a case file for a parameter.

    Attributes
    ----------
    about
        Meaning.
    unit
        Unit in the file, with which the key ends; angles are in radians in Python.
    name
        Name without the unit; empty if it is the name of the parameter.
    default
        Default in the file, in its unit; `REQUIRED` if there is none.
    kind
        Type in the file, if it is not the one in Python.
    limits
        Limit that a number must exceed, and its largest value, in the unit of the file.
    words
        Words in the file for False and True; empty if there are none.
    file
        True if the value is the name of a file.
    """

    about: str
    unit: str
    name: str
    default: Any
    kind: Any
    limits: tuple[float, float] | None
    words: tuple[str, ...]
    file: bool


def key(
    about: str,
    *,
    default: Any = MISSING,
    in_file: Any = _AS_IN_PYTHON,
    unit: str = "",
    name: str = "",
    kind: Any = None,
    limits: tuple[float, float] | None = None,
    words: tuple[str, ...] = (),
    file: bool = False,
    kw_only: Any = MISSING,
) -> Any:
    """Field of a `declaration` that a case file states.

    Parameters
    ----------
    default
        Default in Python.
    in_file
        Default in a case file, if it is another one.
    kw_only
        See `dataclasses.field`.
    about, unit, name, kind, limits, words, file
        See `Key`.
    """
    stated = default if in_file is _AS_IN_PYTHON else in_file
    metadata = {"key": Key(about, unit, name, stated, kind, limits, words, file)}
    return field(default=default, kw_only=kw_only, metadata=metadata)


def mm(about: str, *, default: Any = MISSING, **others: Any) -> Any:
    """Length; see `key`."""
    return key(about, default=default, unit="mm", **others)


def deg(about: str, *, default: Any = MISSING, **others: Any) -> Any:
    """Angle, here in degrees and in Python in radians; see `key`."""
    stated = {"in_file": default, "unit": "deg", **others}
    if default is not MISSING and default is not None:
        default = radians(default)
    return key(about, default=default, **stated)


@dataclass_transform(frozen_default=True, field_specifiers=(field, key, mm, deg))
def declaration(
    module: str = "", *, kw_only: bool = False, eq: bool = True
) -> Callable[[type[_T]], type[_T]]:
    """Frozen dataclass of parameters, those with a `key` also in case files.

    Its docstring is the summary in help texts.

    Parameters
    ----------
    module
        Module of the package that contains the class of the same name, or the function
        of the same name in lower case; empty for a base class.
    kw_only, eq
        See `dataclasses.dataclass`.
    """

    def decorated(kind: Any) -> Any:
        kind.implemented_in = module
        return dataclass(frozen=True, kw_only=kw_only, eq=eq)(kind)

    return decorated
