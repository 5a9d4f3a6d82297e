"""Reads a command line word by word, without the library's parser."""

import re
from collections.abc import Mapping, Sequence
from itertools import takewhile
from typing import Any, NamedTuple

from .documented import MOVES, OPTIONS, UNNAMED, Option, UnreadableError


class RunLine(NamedTuple):
    """What a line that begins with ``run`` says.

    Attributes
    ----------
    scene
        The scene.
    values
        The value of every option, given or not.
    given
        The options that are on the line.
    """

    scene: str
    values: dict[str, Any]
    given: set[str]


class AskedError(Exception):
    """The line asks for help or the version; it runs nothing."""


def read(line: Sequence[str]) -> RunLine:
    """Read a line that begins with ``run``.

    Raises
    ------
    UnreadableError
        If it must be refused.
    AskedError
        If it asks for help.
    """
    if len(line) < 2 or line[1] not in OPTIONS:
        raise UnreadableError("no scene")
    options = OPTIONS[line[1]]
    values = {
        name: [] if option.repeated == "all" else option.default
        for name, option in options.items()
    }
    given: set[str] = set()
    rest = list(line[2:])
    while rest:
        name, attached = _name(rest, options)
        option = options[name]
        value = _value(option, _words(name, option, attached, rest))
        if option.repeated == "all":
            values[name] = values[name] + value
        elif option.repeated == "count":
            values[name] += value
        else:
            values[name] = value
        given.add(name)
    if "out" not in given:
        raise UnreadableError("no --out")
    if values.get("move") == []:
        values["move"] = MOVES
    return RunLine(line[1], values, given)


def _name(rest: list[str], options: Mapping[str, Option]) -> tuple[str, str | None]:
    """The option that the next word names, and what is attached to it."""
    word = rest.pop(0)
    if word == "-h":
        raise AskedError
    if re.fullmatch("-v+", word) and "verbose" in options:
        rest[:0] = [word[:-1]] if word != "-v" else []
        return "verbose", None
    if not _is_option(word) or not word.startswith("--"):
        raise UnreadableError(f"{word!r} is no option")
    text, sign, attached = word[2:].partition("=")
    if text in options:
        name = text
    else:
        known = [n for n in (*options, "help") if text and n.startswith(text)]
        if len(known) != 1:
            raise UnreadableError(f"{word!r} means {known}")
        (name,) = known
    if name == "help":
        raise AskedError
    return name, attached if sign else None


def _is_option(word: str) -> bool:
    """Whether a word is an option and not a value."""
    if not word.startswith("-") or word == "-":
        return False
    if re.fullmatch(r"-\d+|-\d*\.\d+", word):
        return False
    return word.startswith("--") or " " not in word


def _words(
    name: str, option: Option, attached: str | None, rest: list[str]
) -> list[str]:
    """The words that belong to an option; they are removed from the rest."""
    if option.words == "0":
        if attached is not None:
            raise UnreadableError(f"{name} takes no word")
        return ["v"]
    if attached is not None:
        return [attached]
    most = 1 if option.words in ("", "?") else len(rest)
    n = len(list(takewhile(lambda word: not _is_option(word), rest[:most])))
    words, rest[:] = rest[:n], rest[n:]
    if not words and option.words in ("", "+"):
        raise UnreadableError(f"{name} takes a word")
    return words


def _value(option: Option, words: list[str]) -> Any:
    try:
        values = [option.read(word) for word in words]
    except ValueError as error:
        raise UnreadableError(str(error)) from None
    if option.words == "0":
        return len(words) if option.repeated == "count" else True
    if option.words == "?":
        return values[0] if values else UNNAMED
    if option.words == "" and option.repeated != "all":
        return values[0]
    return values
