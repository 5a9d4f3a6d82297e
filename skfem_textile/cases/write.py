"""Cases as tables and as text of a case file; reference of all keys."""

import os
import textwrap
from collections.abc import Iterator
from pathlib import Path
from types import NoneType, UnionType
from typing import (
    Annotated,
    Any,
    Literal,
    NamedTuple,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)
from zlib import crc32

from msgspec import NODEFAULT, Meta, Struct, structs

from .. import __version__
from .phases import RowsOfTravel, ToolInPhase
from .read import ARRAYS, CaseFile, with_files
from .scenes import SCENES
from .schema import Output, Region
from .tables import FILE, named, summary_of

#: First line of a case file that a run has written.
WRITTEN = "# The case of this folder, with every default, written by skfem-textile."

#: Names of the case file and of the folder with the files that it refers to.
CASE, FILES = "case.toml", "case_files"

_LAW_ENDINGS = (".csv", ".json")

# Meshes in these formats, with the whole mesh in one file, are copied.
_OF_MESH = ("mesh", "tool", "punch", "die", "part_mesh")
_WHOLE = (
    *(".dxf", ".svg", ".msh", ".inp", ".vtu", ".vtk"),
    *(".stl", ".obj", ".ply", ".3mf", ".off"),
)

#: Files that `WrittenCase.write` may write.
WRITTEN_FILES = (
    CASE,
    *(f"{FILES}/{law}{end}" for law in ("*tension*", "*shear") for end in _LAW_ENDINGS),
    *(
        f"{FILES}/{key}{end}"
        for key in (*_OF_MESH, "tool_*", "punch_*", "die_*")
        for end in _WHOLE
    ),
    *(f"{FILES}/fabric*{end}" for end in (".json", ".inp", ".rad")),
    *(f"{FILES}/directions{end}" for end in (".vtu", ".csv", ".inp")),
    *(f"{FILES}/{key}*" for key in ("outline", "test_curve", "trim")),
)

_UNITS = "# Lengths in mm, forces in N, angles in degrees; keys end with their units."

_WIDTH = 88


class _Key(NamedTuple):
    """Key of a table, its value and meaning."""

    name: str
    value: Any
    about: str


def tables_of(table: Struct) -> dict[str, Any]:
    """Tables of a declaration as in a case file, without keys that are not given."""
    given = ((name, value) for name, value, _ in _keys(table) if value is not None)
    empty = *ARRAYS, "vary"
    return {
        name: _as_tables(value) for name, value in given if value or name not in empty
    }


def _as_tables(value: Any) -> Any:
    """Value of a key; tables as dictionaries, also in arrays and by name."""
    if isinstance(value, Struct):
        return tables_of(value)
    if isinstance(value, dict):
        return {name: _as_tables(one) for name, one in value.items()}
    if isinstance(value, tuple) and isinstance(next(iter(value), None), Struct):
        return [*map(tables_of, value)]
    return value


def case_text(case: CaseFile, head: str) -> str:
    """Text of a case file, with every default and a comment for each key.

    Parameters
    ----------
    case
        The case.
    head
        First line, a comment.
    """
    parts, hints = [f"{head}\n{_UNITS}\n"], get_type_hints(CaseFile)
    for name, value, _ in _keys(case):
        if name in ("tension", "shear", "bending") and case.fabric.file is not None:
            continue  # the file of the fabric contains all laws
        if name in ARRAYS:
            about = _described(ARRAYS[name])
            parts += [_block(f"[{name}]", one, about) for one in value]
        elif name == "regions":
            for region, entries in value.items():
                parts.append(_block(f"regions.{_toml_key(region)}", entries))
        elif name == "vary":
            if value:
                parts.append("\n".join(["[vary]", *map(_line, value, value.values())]))
        else:
            parts.append(_block(name, value, _described(hints[name])))
    return "\n".join(parts)


class WrittenCase:
    """Snapshot of a case at the start of a run, written at its end.

    Parameters
    ----------
    case
        The case.

    Raises
    ------
    OSError
        If a file that it names cannot be read.
    """

    def __init__(self, case: CaseFile) -> None:
        self._files: dict[str, bytes] = {}
        self._case = with_files(case, self._store)

    def write(self, folder: Path) -> None:
        """Write ``case.toml`` and the files that it refers to into a folder."""
        text = case_text(self._case, WRITTEN)
        (folder / CASE).write_text(text, encoding="utf-8")
        for name, content in self._files.items():
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).write_bytes(content)

    def checksum(self) -> str:
        """Checksum of the case and of its files, for any outputs and samples."""
        fabric = structs.replace(self._case.fabric, samples=None)
        case = structs.replace(self._case, fabric=fabric, output=Output())
        text = case_text(case, __version__).encode()
        files = (self._files[name] for name in sorted(self._files))
        return f"{crc32(b''.join([text, *files])):08x}"

    def _store(self, path: str, name: str) -> str:
        """Store the content of a file; returns its name in the results folder."""
        *tables, key = path.split(".")
        if key in ("file", "source"):
            key = "_".join(tables)
        ending = Path(name).suffix
        is_mesh = key in _OF_MESH or key.startswith("tool_")
        if key == "deck" or (is_mesh and ending.lower() not in _WHOLE):
            return os.path.abspath(name)
        file, number = f"{FILES}/{key}{ending.lower()}", 1
        while file in self._files:  # a key with several files
            number += 1
            file = f"{FILES}/{key}_{number}{ending.lower()}"
        from ..io.abaqus import content_of

        self._files[file] = content_of(Path(name))
        return file


def refuse_foreign_case(folder: Path) -> None:
    """Refuse a folder with a case file that was not written by a run.

    Raises
    ------
    ValueError
        If the folder contains such a file.
    """
    file = folder / CASE
    if not file.is_file():
        return
    with open(file, "rb") as opened:
        start = opened.read(len(WRITTEN.encode()))
    if start != WRITTEN.encode():
        raise ValueError(
            f"{file} was not written by a run, and this run would replace it: choose "
            "another folder for --out"
        )


def _keys(table: Struct) -> Iterator[_Key]:
    """Keys of a table in the order in which they are written, laws inline."""
    hints = get_type_hints(type(table), include_extras=True)
    config = table.__struct_config__
    if config.tag_field and config.tag and "file" not in table.__struct_fields__:
        yield _Key(config.tag_field, config.tag, "")
    for name in table.__struct_fields__:
        value = getattr(table, name)
        if name == "law":
            first, *rest = _keys(value)
            choices = get_type_hints(type(table))["law"]
            yield _Key("law", first.value, _described(choices))
            yield from rest
        else:
            yield _Key(name, value, _with_words(hints[name]))


def _block(where: str, table: Struct, choices: str = "") -> str:
    """Text of a table: its plain values, then the nested tables."""
    lines, tables = [f"[{where}]"], []
    for name, value, about in _keys(table):
        about = about or choices
        comment = [_comment(about)] if about else []
        inner = f"{where.strip('[]')}.{name}"
        if name == "tools":
            for tool, entries in value.items():
                given = [x for x in _keys(entries) if x.value is not None]
                lines_of = [_line(key, one) for key, one, _ in given]
                tables += ["", f"[{inner}.{_toml_key(tool)}]", *lines_of]
        elif isinstance(value, Struct) and not isinstance(value, RowsOfTravel):
            heading = _comment(summary_of(type(value)))
            tables += ["", heading, _block(inner, value).rstrip()]
        elif isinstance(value, dict):
            named = [_line(key, one) for key, one in value.items()]
            tables += ["", *comment, f"[{inner}]", *named]
        elif value is None:
            lines += [*comment, f"# {name} is not given"]
        else:
            lines += [*comment, _line(name, value)]
    return "\n".join([*lines, *tables, ""])


def meaning(hint: Any) -> str:
    """Meaning of a key."""
    metadata = [one for one in get_args(hint) if isinstance(one, Meta)]
    return "; ".join(one.description for one in metadata if one.description)


def _with_words(hint: Any) -> str:
    """Meaning of a key, with the words that it allows."""
    text, words = meaning(hint), _words(hint)
    if all(word in text for word in words):
        return text
    return f"{text}: {', '.join(words)}"


def _words(hint: Any) -> list[str]:
    if get_origin(hint) is Literal:
        return [str(word) for word in get_args(hint)]
    return [word for part in get_args(hint) for word in _words(part)]


def _described(union: Any) -> str:
    """Choices of a union of tables."""
    if get_origin(union) not in (Union, UnionType):
        return ""
    return "; ".join(f"{name}: {summary_of(one)}" for name, one in named(union).items())


def _comment(text: str) -> str:
    return textwrap.fill(
        text,
        _WIDTH,
        initial_indent="# ",
        subsequent_indent="# ",
        break_long_words=False,
        break_on_hyphens=False,
    )


def _line(key: str, value: Any) -> str:
    if isinstance(value, tuple | list):  # on one line
        inner = ", ".join(_line("x", one).partition(" = ")[2] for one in value)
        return f"{_toml_key(key)} = [{inner}]"
    if isinstance(value, Struct):
        entries = ", ".join(_line(name, one) for name, one, _ in _keys(value))
        return f"{_toml_key(key)} = {{{entries}}}"
    if isinstance(value, dict):
        inner = ", ".join(map(_line, value, value.values()))
        return f"{_toml_key(key)} = {{{inner}}}"
    import tomli_w  # needed for case files only

    return tomli_w.dumps({key: value}).rstrip("\n")


def _toml_key(name: str) -> str:
    """Key in TOML syntax, in quotes if necessary."""
    import tomli_w

    return tomli_w.dumps({name: 0}).rpartition(" = ")[0]


class Entry(NamedTuple):
    """Entry of the reference of keys.

    Attributes
    ----------
    table
        Path of its table.
    choice
        Name of the table to which this key belongs; empty if it belongs to all.
    key, kind, default, about
        Key, type, default and meaning as text.
    """

    table: str
    choice: str
    key: str
    kind: str
    default: str
    about: str


def reference() -> Iterator[Entry]:
    """Generate all keys of a case file."""
    for name, hint in get_type_hints(CaseFile, include_extras=True).items():
        if name == "vary":
            yield Entry("vary", "", "TABLE.KEY", "[value, ...]", "", meaning(hint))
        elif name == "regions":
            yield from _entries("regions.NAME", Region)
        elif name in ARRAYS:
            yield from _entries(f"[{name}]", ARRAYS[name])
            if name == "phases":
                yield from _entries("phases.tools.NAME", ToolInPhase)
        else:
            yield from _entries(name, hint)


def key_help(scene: str) -> str:
    """Keys of a case as text for a terminal.

    Parameters
    ----------
    scene
        Name of a scene; any other word selects all scenes.
    """
    lines, table = ["", "keys of a case file, for --set table.key=value:"], ""
    for e in reference():
        if e.table == "scene" and e.choice not in ("", scene) and scene in SCENES:
            continue
        if e.table != table:
            table = e.table
            lines += ["", f"[{table}]"]
        only = f" (only for {e.choice})" if e.choice and e.table != "scene" else ""
        default = f", default {e.default}" if e.default else ""
        for text, indent in (
            (f"{e.key}: {e.kind}{default}{only}", 2),
            (e.about, 6),
        ):
            space = " " * indent
            lines += textwrap.wrap(
                text, _WIDTH, initial_indent=space, subsequent_indent=" " * 6
            )
    return "\n".join([*lines, ""])


def _entries(where: str, hint: Any, choice: str = "") -> Iterator[Entry]:
    if get_origin(hint) in (Union, UnionType):
        choices = named(hint)
        tag = next(iter(choices.values())).__struct_config__.tag_field
        words = " | ".join(choices)
        yield Entry(where, "", str(tag), words, "", _described(hint))
        for name, table in choices.items():
            yield from _entries(where, table, name)
        return
    hints = get_type_hints(hint, include_extras=True)
    for one in structs.fields(hint):
        hint_of = hints[one.name]
        parts = [part for part in get_args(hint_of) if part is not NoneType]
        inner = parts[0] if parts and NoneType in get_args(hint_of) else hint_of
        if one.name == "law":
            yield from _entries(where, hint_of, choice)
        elif isinstance(inner, type) and issubclass(inner, Struct):
            summary = summary_of(inner)
            kind = f"[{where.strip('[]')}.{one.name}]"
            yield Entry(where, choice, one.name, kind, "", summary)
        elif one.name != "file" or not choice:
            kind = "file" if FILE in get_args(hint_of) else _kind(hint_of)
            yield Entry(where, choice, one.name, kind, _default(one), meaning(hint_of))


def _kind(hint: Any) -> str:
    """Description of a type."""
    plain = {float: "number", int: "integer", str: "text", bool: "true or false"}
    if hint in plain:
        return plain[hint]
    parts = [part for part in get_args(hint) if part is not NoneType]
    origin = get_origin(hint)
    if origin is Annotated:
        return _kind(parts[0])
    if origin is Literal:
        return " | ".join(map(str, parts))
    if origin is tuple and get_origin(parts[0]) is Literal:
        return f"[some of {_kind(parts[0]).replace(' |', ',')}]"
    if origin is tuple:
        return f"[{', '.join('...' if p is ... else _kind(p) for p in parts)}]"
    if isinstance(hint, type) and issubclass(hint, Struct):
        return f"{{{', '.join(hint.__struct_fields__)}}}"
    if origin is dict:
        return f"NAME = {_kind(parts[1])}"
    return " | ".join(map(_kind, parts))


def _default(key: structs.FieldInfo) -> str:
    if key.default in (None, NODEFAULT, ()):
        return ""
    return _line("x", key.default).removeprefix("x = ")
