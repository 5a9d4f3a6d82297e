"""The text of a case file: all values, with defaults, and a comment for each."""

import textwrap
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ...registration import Option
from ...scenes import SCENES
from .laws import BENDING, FIBRES, PREFIXES, described, law_table
from .table import Table

_UNITS = "# Lengths are in mm, forces in N and angles in degrees, as the keys say."

_WIDTH = 88

#: What stands in place of the name of a file: ``(key of the option, name) -> name``.
Place = Callable[[str, str], str]

_LAWS = "Laws of tension and shear, and fibres, of a subdomain of the mesh:"


def case_text(
    tables: Sequence[Table],
    values: Mapping[str, Any],
    head: str,
    place: Place = lambda key, name: name,
) -> str:
    """The text of a case file.

    Parameters
    ----------
    tables
        The tables of a case of its scene.
    values
        Values of a case, as `case_of` takes and completes them.
    head
        The first line, a comment.
    place
        What stands for names of files.
    """
    parts = [f"{head}\n{_UNITS}\n"]
    for table in tables:
        of_fabric = *PREFIXES, BENDING.name
        if table.name in of_fabric and values["fabric"] is not None:
            continue  # the file of the fabric has all laws
        lines = []
        if table.name == "scene":
            lines = [_comment(described(SCENES)), _line("name", values["scene"])]
        parts.append(_block(table.name, table, values, place, lines))
    for number, (name, region) in enumerate(values["regions"].items(), 1):
        parts += _region(name, region, _of_part(place, f"region_{number}"))
    return "\n".join(parts)


def _of_part(place: Place, part: str) -> Place:
    return lambda key, name: place(f"{part}_{key}", name)


def _region(name: str, values: Mapping[str, Any], place: Place) -> list[str]:
    where = f"regions.{_key(name)}"
    blocks = [_block(where, Table(where, FIBRES), values, place, [_comment(_LAWS)])]
    for table in (*(law_table(of) for of in PREFIXES), BENDING):
        blocks.append(_block(f"{where}.{table.name}", table, values, place, []))
    return blocks


def _block(
    where: str, table: Table, values: Mapping[str, Any], place: Place, first: list[str]
) -> str:
    """A table: its plain values, then those that are tables themselves."""
    lines, tables = [f"[{where}]", *first], []
    for option in table.given(values):
        value, key = values[option.key], table.key(option)
        if isinstance(value, str) and option.names_file and option.names_file(value):
            value = place(option.key, value)
        comment = _comment(_about(option))
        if _is_mapping(option):
            named = [
                _line(name, list(one)) if isinstance(one, tuple) else _line(name, one)
                for name, one in value
            ]
            tables += ["", comment, f"[{where}.{key}]", *named]
        elif value is None:
            lines += [comment, f"# {key} is not given"]
        else:
            lines += [comment, _line(key, value)]
    for part in table.parts:
        inner = f"{where}.{part.name}"
        if values[part.entry] is None:
            said = f"[{inner}] is not given: {part.about}"
            tables += ["", _comment(said)]
            continue
        own, about = _of_part(place, part.name), [_comment(part.about)]
        block = _block(inner, part, values[part.entry], own, about)
        tables += ["", block.rstrip()]
    return "\n".join([*lines, *tables, ""])


def _is_mapping(option: Option) -> bool:
    return getattr(option.in_file, "__origin__", None) is dict


def _about(option: Option) -> str:
    """What an option is, without the words that are of the command line alone."""
    text = option.help.partition(" (default:")[0]
    text = text.removesuffix("; may be repeated").replace("; may be repeated", "")
    told = all(choice in text for choice in option.choices)
    return text if told else f"{text}: {', '.join(option.choices)}"


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
    import tomli_w  # not needed but for a case file

    value = list(value) if isinstance(value, tuple) else value
    if isinstance(value, list):  # on one line
        inner = ", ".join(_line("x", one).partition(" = ")[2] for one in value)
        return f"{_key(key)} = [{inner}]"
    return tomli_w.dumps({key: value}).rstrip("\n")


def _key(name: str) -> str:
    """A key as TOML has it, in quotes where it needs them."""
    import tomli_w

    return tomli_w.dumps({name: 0}).rpartition(" = ")[0]
