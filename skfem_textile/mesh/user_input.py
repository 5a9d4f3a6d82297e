"""Functions, numbers and text of users, with one-line errors."""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from copyreg import __newobj__  # type: ignore[attr-defined]
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from numpy import ndarray

#: Lengths of units in mm.
IN_MM: dict[str, float] = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4}

#: Largest angle in degrees, a hundred turns: beyond it decimals are lost.
MOST_DEGREES = 36_000.0

# Maximum length of a value or of foreign text in a message.  Chosen: two lines in
# total.
_LONGEST_TEXT = 60

# Beginnings of names with the article "an".
_WITH_AN = *"aeiou", "hour", "ndarray"


class CopiedError(Exception):
    """Base of exceptions with attributes, which copies and pickled ones keep."""

    def __reduce__(self) -> tuple:
        return __newobj__, (type(self), *self.args), vars(self)


def call_user_function(what: str, function: Callable, *arguments: Any) -> Any:
    """Call a user's function.

    Raises
    ------
    ValueError
        If the function fails; the message names it as ``what``.
    """
    try:
        return function(*arguments)
    except Exception as error:  # a user's function may raise anything
        raise ValueError(f"{what} raised {error_text(error)}") from error


@contextmanager
def errors_in(place: str, kind: type[ValueError] = ValueError) -> Iterator[None]:
    """Let errors in a block begin with their place; they become a kind of error."""
    try:
        yield
    except ValueError as error:
        raise kind(f"{place}{printable(error)}") from None


def error_text(error: Exception) -> str:
    """Type and first line of the message of an exception."""
    line = str(error).strip().partition("\n")[0]
    return f"{type(error).__name__}: {line}" if line else type(error).__name__


def refuse_unknown(what: str, name: object, known: Iterable[str]) -> None:
    """Refuse a name that is not a known one; it may have any type."""
    names = [*known]
    if name not in names:
        raise ValueError(f"unknown {what} {name!r}: choose one of {', '.join(names)}")


def refuse_in_files(what: str, name: str) -> None:
    """Refuse a name with characters that names of files and columns cannot contain."""
    if found := re.search(r"[/\\\x00-\x1f]", str(name)):
        raise ValueError(
            f"{what}: the name contains {found[0]!r}, which names of files and columns "
            "cannot contain: rename it"
        )


def real_numbers(what: str, value: Any) -> "ndarray":
    """Convert a user's value to an array of real numbers.

    Raises
    ------
    ValueError
        If it cannot be converted; the message names it as ``what``.
    """
    import numpy as np  # text needs no arrays

    try:
        array = np.asarray(value)
        if array.dtype.kind in "biufO":
            return array.astype(float)
    except (TypeError, ValueError):  # as of lists of different lengths
        pass
    raise ValueError(f"{what} must be real-valued, got {shortened(value)}")


def with_article(x: Any) -> str:
    """Name of the class of an object, with its article."""
    name = type(x).__name__
    return f"{'an' if name.lower().startswith(_WITH_AN) else 'a'} {name}"


def parameter(w: Mapping[str, Any], name: str) -> Any:
    """Parameter of a form; a ValueError if it is missing."""
    if name not in w:
        raise ValueError(
            f"the form requires the parameter {name!r}: asm(form, basis, {name}=...)"
        )
    return w[name]


def keep_copies(owner: Any, *names: str) -> None:
    """Replace arrays in attributes of a frozen object by copies that are read-only.

    Arrays are also replaced in tuples and lists.  Later changes of the user's arrays
    then do not change the object.
    """
    for name in names:
        object.__setattr__(owner, name, _own(getattr(owner, name)))


def _own(value: Any) -> Any:
    import numpy as np  # text needs no arrays

    if type(value) in (tuple, list):
        return type(value)(map(_own, value))
    if isinstance(value, np.ndarray):
        value = value.copy()
        value.flags.writeable = False
    elif hasattr(value, "toarray"):  # a sparse matrix
        value = value.copy()
    return value


def refuse_unit(unit: str | None) -> None:
    """Refuse a unit of length that is neither None nor in `IN_MM`."""
    if unit is not None and unit not in IN_MM:
        raise ValueError(f"the unit must be one of {', '.join(IN_MM)}, got {unit!r}")


def number_of_text(text: str) -> float:
    """Number in a table cell, in decimal digits.

    Raises
    ------
    ValueError
        If it is not a number, or is in a notation specific to Python: ``1_000``, or
        digits of another script.
    """
    if "_" in text or not text.isascii():
        raise ValueError(f"{excerpt(text)!r} is not a number")
    return float(text)


def printable(text: object) -> str:
    """Foreign text on one line, with control characters as escape codes."""
    return "".join(
        char
        if char.isprintable()
        else char.encode("unicode_escape", "replace").decode()
        for char in str(text)
    )


def excerpt(text: bytes | str) -> str:
    """Beginning of foreign text, printable on one line."""
    if isinstance(text, bytes):
        text = text[:_LONGEST_TEXT].decode(errors="replace")
    return printable(text[:_LONGEST_TEXT])


def coords(point: Any, digits: int = 6) -> str:
    """Coordinates in a message, of an array or a shapely point."""
    numbers = getattr(point, "coords", [point])[0]
    return f"({', '.join(f'{round(float(x), 6) + 0.0:.{digits}g}' for x in numbers)})"


def shortened(value: Any) -> str:
    """Value as text on one line, or its type if that is too long."""
    text = " ".join((repr if isinstance(value, str) else str)(value).split())
    return text if len(text) <= _LONGEST_TEXT else type(value).__name__
