"""Converters of command-line values, and options of the files of tests.

These options are also the keys of a file of tests.
"""

import re
import tomllib
from argparse import ArgumentTypeError
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

from ..mesh.user_input import MOST_DEGREES

# Suffix of case files.
_SUFFIX = ".toml"

#: A case file in a help text.
CASE_FILE = f"CASE{_SUFFIX}"

_T = TypeVar("_T")

# Upper bound on the depth of a key path.
_MOST_KEYS = 9


def degrees(word: str) -> float:
    """Angle in degrees, at most a hundred turns."""
    expected = f"an angle of at most {MOST_DEGREES:g} degrees"
    return _number(word, -MOST_DEGREES, MOST_DEGREES, expected)


def acute_degrees(word: str) -> float:
    """Angle in degrees between 0 and 90."""
    return _number(word, _LEAST, 90 - _LEAST, "an angle between 0 and 90 degrees")


def count(word: str) -> int:
    """Positive number of things."""
    if not (word.isdecimal() and int(word) > 0):
        raise ArgumentTypeError(f"expected a positive integer, got {word!r}")
    return int(word)


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


def _named(word: str, of: Callable[[str], _T], expected: str) -> tuple[str, _T]:
    """Name and value of ``NAME=VALUE``; ``of`` raises an error for other values."""
    name, _, value = word.partition("=")
    try:
        if name and value:
            return name, of(value)
    except (ValueError, KeyError):
        pass
    raise ArgumentTypeError(f"expected {expected}, got {word!r}")


def unit(word: str) -> tuple[str, str]:
    """Column and unit of ``COLUMN=UNIT``."""
    return _named(word, str, "COLUMN=UNIT, such as force=kN")


def column(word: str) -> tuple[str, int | str]:
    """Quantity, and number or heading of its column, of ``COLUMN=NUMBER``."""

    def of(where: str) -> int | str:
        return int(where) if where.isdecimal() else where

    return _named(word, of, "COLUMN=NUMBER or COLUMN=HEADING, such as force=3")


def sign(word: str) -> tuple[str, int]:
    """Column and sign of ``COLUMN=SIGN``."""
    signs = {"1": 1, "+1": 1, "-1": -1}
    return _named(word, signs.__getitem__, "COLUMN=1 or COLUMN=-1, such as force=-1")


def bound(word: str) -> tuple[str, tuple[float, float]]:
    """Parameter and bounds of ``NAME=LOW,HIGH``."""

    def of(ends: str) -> tuple[float, float]:
        low, high = (float(end) for end in ends.split(","))
        if not low < high:
            raise ValueError
        return low, high

    return _named(word, of, "NAME=LOW,HIGH with LOW below HIGH, such as c1=0,1")


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


def unquoted(path: str) -> str:
    """Path to a key, whose keys may be in quotation marks as in TOML, without these.

    Examples
    --------
    >>> unquoted('phases.up.tools."*".friction')
    'phases.up.tools.*.friction'
    """
    return re.sub(r"""(?<![^.])(["'])([^"']+)\1(?![^.])""", r"\2", path)


def setting(word: str) -> tuple[str, Any]:
    """Path and value of ``path.to.key=value``, the value as in a case file."""
    path, equals, value = word.partition("=")
    path = unquoted(path)
    keys = path.split(".")
    if not equals or not 1 < len(keys) < _MOST_KEYS or not all(keys):
        raise ArgumentTypeError(
            f"expected KEY=VALUE, such as stepping.steps=5, got {word!r}"
        )
    return path, _value(value)


def variation(word: str) -> tuple[str, list[Any]]:
    """Path and values of ``path.to.key=value,value,...``, as in a case file."""
    (path, _), values = setting(word), word.partition("=")[2]
    try:
        return path, tomllib.loads(f"x = [{values}]")["x"]
    except (ValueError, RecursionError):
        # commas in brackets belong to a value, such as a lay-up
        return path, [_value(x) for x in re.split(r",(?![^\[\]]*\])", values)]


def pair(word: str) -> tuple[str, Any]:
    """Name and value of ``NAME=VALUE``; several values are separated by commas."""

    def of(value: str) -> Any:
        parts = [_value(part) for part in value.split(",")]
        return parts if len(parts) > 1 else parts[0]

    return _named(word, of, "NAME=VALUE, such as top=0,40")


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


# Options of a command: keywords of `argparse` by flag.
Options: TypeAlias = dict[str, dict[str, Any]]


def option(
    text: str, of: Any = None, metavar: str | tuple[str, ...] | None = None, **more: Any
) -> dict[str, Any]:
    """Keywords of an option; its help ends with its default, if any."""
    default = " (default: %(default)s)" if more.get("default") else ""
    keywords = {"help": text + default, "type": of, "metavar": metavar, **more}
    return {key: value for key, value in keywords.items() if value is not None}


def repeated(text: str, of: Any, metavar: str) -> dict[str, Any]:
    """Keywords of an option that may be repeated."""
    return option(text, of, metavar, action="append", default=[])


def _size(what: str) -> dict[str, Any]:
    """Option for a specimen size: one value for all files, or one for each."""
    return option(
        f"{what} in mm: one value for all files, or one for each",
        float,
        "MM",
        nargs="+",
    )


_READING: Options = {
    "--encoding": option("encoding of the files (default: from their bytes)"),
    "--separator": option(
        "separator of the columns: ; , | tab or space (default: from the rows)"
    ),
    "--decimal": option("decimal mark (default: from the numbers)", choices=(".", ",")),
    "--column": repeated(
        "column of a quantity, by number or heading (default: from the headings); may "
        "be repeated",
        column,
        "COLUMN=NUMBER",
    ),
    "--unit": repeated(
        "unit of a quantity (default: from the headings); may be repeated",
        unit,
        "COLUMN=UNIT",
    ),
    "--sign": repeated(
        "factor 1 or -1 of a quantity (default: forces are positive at the largest "
        "displacement); may be repeated",
        sign,
        "COLUMN=SIGN",
    ),
}

_BRANCH: Options = {
    "--branch": option(
        "rows that are fitted: loading, unloading or both",
        choices=("loading", "unloading", "both"),
        default="loading",
    ),
    "--cycle": option(
        "number of the fitted cycle (default: the first one that reaches the largest "
        "displacement)",
        int,
        "N",
    ),
    "--keep-outliers": option("fit also outliers", action="store_true"),
}

_CYCLES: Options = {
    "--cycles": option(
        "determine the friction of the law too, by loading and unloading",
        action="store_true",
    ),
}

_SLACK: Options = {
    "--slack": option(
        "displacement at which the fabric begins to carry load; for tests without "
        "displacement 0 or none (default: estimated)",
        float,
        "MM",
    ),
}

_AT_REST: Options = {
    "--force-at-rest": option(
        "force of the undeformed fabric, such as the weight of a clamp (default: "
        "estimated)",
        float,
        "N",
    ),
}

_FAMILY: Options = {
    "--family": option(
        "fibre family along the strips", default="warp", choices=("warp", "weft")
    )
}

#: Options of the files of each kind of test.
OF_FILES: dict[str, Options] = {
    "strip": {
        **_FAMILY,
        "--width": _size("width of the strip"),
        "--length": _size("length of the strip between the clamps"),
        **_READING,
        **_BRANCH,
        **_CYCLES,
        **_SLACK,
    },
    "picture-frame": {
        "--frame-side": _size("side of the frame from hinge to hinge"),
        "--fabric-side": _size("side of the sheared square of fabric"),
        **_READING,
        **_BRANCH,
        **_CYCLES,
        **_SLACK,
        **_AT_REST,
    },
    "bias-extension": {
        "--width": _size("width of the specimen"),
        "--height": _size("height of the specimen between the clamps"),
        "--warp": option(
            "angle between fibres and clamps", degrees, "DEG", default=45.0
        ),
        **_READING,
        **_BRANCH,
        **_CYCLES,
        **_SLACK,
        **_AT_REST,
    },
    "biaxial": {
        "--warp-width": _size("width of the specimen transverse to the warp force"),
        "--weft-width": _size("width of the specimen transverse to the weft force"),
        **_READING,
        **_BRANCH,
        **_SLACK,
    },
    "cantilever": {
        "--weight": option(
            "weight per area in N/mm2, such as 6e-6 for 0.6 kg/m2", float, "W"
        ),
        **_FAMILY,
        "--chord-angle": option(
            "chord angle of all readings, for files without that column, such as 41.5",
            degrees,
            "DEG",
        ),
        **_READING,
    },
    "bending": {**_FAMILY, **_READING, **_BRANCH, **_CYCLES},
}
