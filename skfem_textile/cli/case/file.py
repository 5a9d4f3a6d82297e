"""Values of a case from a file in TOML."""

import datetime
import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from ...mesh.user_input import excerpt, printable
from ...registration import Option
from .laws import BENDING, FIBRES, PREFIXES
from .table import Table, Tables

# Tables beside those of options.
_SCENE, _REGIONS = "scene", "regions"

# Larger files are none that a person writes, and take long to read.
_MOST_BYTES = 1_000_000

# An option of the command line in a message.
_OPTION = re.compile(r"--([a-z][a-z-]*[a-z])")


class CaseFileError(ValueError):
    """A case file that says nothing, or nothing that can be run."""


def read_case_file(path: Path, tables: Tables) -> dict[str, Any]:
    """The values that a case file gives, with defaults for all that it does not say.

    Names of files are taken from the folder of the case file.

    Parameters
    ----------
    path
        The file, in TOML.
    tables
        The tables that a case may have.

    Returns
    -------
    dict
        As `case_of` takes them.

    Raises
    ------
    CaseFileError
        If it is no such file; one line says what is wrong with which key.
    OSError
        If it cannot be read.
    """
    try:
        return values_of(_content(path), path.parent, tables)
    except ValueError as error:
        raise CaseFileError(f"{printable(path)}: {error}") from None


def values_of(
    content: Mapping[str, Any], folder: Path, every: Tables
) -> dict[str, Any]:
    """Values of the content of a case file, each of which is checked.

    Parameters
    ----------
    content
        Its tables.
    folder
        From which the names of files are taken.
    every
        The tables that a case may have.

    Raises
    ------
    ValueError
        If they are no case; one line says what is wrong with which key.
    """
    _refuse_functions("", content)
    scene = _scene(content, every)
    tables = every[scene]
    known = [*(table.name for table in tables), _REGIONS]
    _refuse_unknown("", content, known)
    values: dict[str, Any] = {_SCENE: scene}
    for table in tables:
        given = _table(table.name, content.get(table.name, {}))
        also = ["name"] if table.name == _SCENE else []
        values |= _of_table(table, table.name, given, folder, also)
    laws = [table for table in tables if table.name in (*PREFIXES, BENDING.name)]
    regions = _table(_REGIONS, content.get(_REGIONS, {}))
    values[_REGIONS] = {
        name: _region(f"{_REGIONS}.{printable(name)}", given, values, folder, laws)
        for name, given in regions.items()
    }
    return values


def in_file_words(message: str, tables: Sequence[Table]) -> str:
    """A message about options, with what they are called in a case file."""
    names = {
        option.name: f"{table.name}.{table.key(option)}"
        for table in tables
        for option in table.options
    }
    return _OPTION.sub(lambda found: names.get(found[1], found[0]), message)


def _content(path: Path) -> dict[str, Any]:
    with open(path, "rb") as file:
        data = file.read(_MOST_BYTES + 1)
    if len(data) > _MOST_BYTES:
        raise ValueError(f"more than {_MOST_BYTES} bytes are no case")
    try:
        return tomllib.loads(data.decode("utf-8-sig"))
    except UnicodeDecodeError:
        raise ValueError("no text in UTF-8") from None
    except RecursionError:
        raise ValueError("arrays or tables stand in one another too deep") from None
    except ValueError as error:
        raise ValueError(f"no TOML: {printable(error)}") from None


def _refuse_functions(where: str, content: Mapping[str, Any]) -> None:
    """Refuse what only Python can hold, before anything else is told of it."""
    for key, value in content.items():
        place = f"{where}{printable(key)}"
        if callable(value):
            raise ValueError(
                f"{place} is a function, which a case file cannot hold: make a Case in "
                "Python"
            )
        if isinstance(value, Mapping):
            _refuse_functions(f"{place}.", value)


def _scene(content: Mapping[str, Any], scenes: Iterable[str]) -> str:
    name = _table(_SCENE, content.get(_SCENE, {})).get("name")
    if not isinstance(name, str) or name not in scenes:
        said = "is missing" if name is None else f"is {_shown(name)}"
        raise ValueError(f"scene.name {said}: it must be one of {', '.join(scenes)}")
    return name


def _region(
    where: str,
    given: Any,
    values: dict[str, Any],
    folder: Path,
    laws: Sequence[Table],
) -> dict[str, Any]:
    """What is other in a region: laws that are not given are those of the ply."""
    given = _table(where, given)
    fibres = Table(where, FIBRES)
    found = _of_table(fibres, where, given, folder, [law.name for law in laws])
    for law in laws:
        if law.name in given:
            own = _table(f"{where}.{law.name}", given[law.name])
            found |= _of_table(law, f"{where}.{law.name}", own, folder)
        else:
            found |= {key: values[key] for key in law.nothing}
    return found


def _of_table(
    table: Table,
    where: str,
    given: dict[str, Any],
    folder: Path,
    also: Sequence[str] = (),
) -> dict[str, Any]:
    """Values of the options of a table; ``also`` are keys that others read."""
    import msgspec  # not needed without a case file

    keys = {table.key(option): option for option in table.options}
    parts = {part.name: part for part in table.parts}
    _refuse_unknown(where, given, [*keys, *parts, *also])
    own = {key: value for key, value in given.items() if key in keys}
    fields = [(key, _type(o) | None, None) for key, o in keys.items()]
    shape = msgspec.defstruct("Table", fields, kw_only=True)
    try:
        read = msgspec.convert(own, shape)
    except (msgspec.ValidationError, OverflowError) as error:
        raise ValueError(_worded(where, str(error))) from None
    values = table.nothing
    for key in own:
        option = keys[key]
        found = _value(f"{where}.{key}", option, getattr(read, key), folder)
        values[option.key] = found
    for name in parts.keys() & given.keys():
        part, inner = parts[name], f"{where}.{name}"
        own = _table(inner, given[name])
        values[part.entry] = _of_table(part, inner, own, folder)
    return values


def _type(option: Option) -> Any:
    if option.in_file is not None:
        return option.in_file
    if option.words:
        return list[str]
    return option.read if option.read in (int, float) else str


def _value(where: str, option: Option, given: Any, folder: Path) -> Any:
    """The value of an option, which its reader checks as it does a word."""
    if isinstance(given, dict):
        return [_pair(where, option, *pair) for pair in given.items()]
    if not isinstance(given, str):
        words = given if isinstance(given, list) else []
    elif option.names_file and option.names_file(given):
        given, words = str(folder / given), []
    else:
        words = [given]
    for word in words:
        if option.choices and word not in option.choices:
            nearest = _nearest(word, option.choices)
            raise ValueError(
                f"{where} is {_shown(word)}, which is none of "
                f"{', '.join(option.choices)}{nearest}"
            )
    if isinstance(given, str | float | int) and not isinstance(given, bool):
        try:
            return option.read(str(given))
        except ValueError as error:
            raise ValueError(f"{where}: {printable(error)}") from None
    return given


def _pair(where: str, option: Option, name: str, given: Any) -> Any:
    """A name and its value, which the reader checks as it does ``NAME=VALUE``."""
    parts = given if isinstance(given, tuple) else (given,)
    word = f"{name.replace('=', '_')}={','.join(map(str, parts))}"
    try:
        return name, option.read(word)[1]
    except ValueError as error:
        raise ValueError(f"{where}: {printable(error)}") from None


def _table(where: str, given: Any) -> dict[str, Any]:
    if not isinstance(given, dict):
        raise ValueError(f"{where} must be a table, not {_shown(given)}")
    return given


def _refuse_unknown(where: str, given: Iterable[str], known: Iterable[str]) -> None:
    known = list(known)
    for key in given:
        if key not in known:
            place = f"{where} has no key" if where else "there is no table"
            near = _nearest(key, known) or f" (it has: {', '.join(known)})"
            raise ValueError(f"{place} '{excerpt(key)}'{near}")


def _nearest(word: str, known: Iterable[str]) -> str:
    """The known word that is nearest, as the end of a message; empty if none is."""
    known = list(known)
    longer = [name for name in known if word and name.startswith(f"{word}_")]
    near = longer or get_close_matches(word[:100], known, n=1)
    return f"; the nearest is {near[0]!r}" if near else ""


def _worded(where: str, message: str) -> str:
    """A message of msgspec, the place first: ``Expected `int` ... - at `$.steps```."""
    said, _, place = message.partition(" - at `$")
    expected = (
        said.replace("`", "").replace(" | null", "").replace("Expected", "must be")
    )
    return printable(f"{where}{place.rstrip('`')} {expected}")


def _shown(value: Any) -> str:
    """A value of a file in a message, or its kind where it is long."""
    for kind, name in ((dict, "a table"), (list, "an array")):
        if isinstance(value, kind):
            return name
    if isinstance(value, datetime.datetime | datetime.date | datetime.time):
        return "a date or time"
    return f"'{excerpt(value)}'" if isinstance(value, str) else excerpt(str(value))
