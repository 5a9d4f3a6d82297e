"""Lines of a deck with its include files, and copies with some lines changed."""

import os
import re
from codecs import BOM_UTF8
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from ..mesh.checks import MeshError
from ..mesh.user_input import excerpt, printable

_LINE = re.compile(rb"[^\r\n]*(?:\r\n|\n|\r)|[^\r\n]+\Z")

#: Encoding of decks, and how other bytes are kept.
UTF8 = "utf-8", "surrogateescape"


class Include(NamedTuple):
    """Names of included files by the line after the first, and lines in their place."""

    names: dict[int, str]
    lines: list[str]


#: Finds the include that begins at a line of a file: the lines and the number of one.
FindInclude = Callable[[list[str], int], Include | None]


@dataclass
class _File:
    path: Path
    lines: list[bytes]  # with their ends
    # By the line of the name: the file and its name as given.
    includes: dict[int, tuple["_File", str]] = field(default_factory=dict)

    def copy(self, changes: dict[int, list[str]], names: dict[Path, str]) -> bytes:
        """Content with changed lines, and new names of include files."""
        lines = list(self.lines)
        for at, (child, name) in self.includes.items():
            if _path(name) != names[child.path]:
                old, new = name.encode(*UTF8), names[child.path].encode(*UTF8)
                lines[at] = lines[at].replace(old, new)
        for at, by in changes.items():
            end = lines[at][len(lines[at].rstrip(b"\r\n")) :] or b"\n"
            lines[at] = b"".join(line.encode(*UTF8) + end for line in by)
        return b"".join(lines)


class DeckText:
    """All lines of a deck and its include files, in the order of a solver.

    Attributes
    ----------
    lines
        Lines without their ends.  Those that include a file are replaced.
    files
        The file of the deck, and the files that it includes.

    Raises
    ------
    MeshError
        If an include file cannot be read, or includes itself.
    OSError
        If the deck cannot be read.
    """

    def __init__(self, path: Path, include: FindInclude) -> None:
        self.lines: list[str] = []
        self.files: list[_File] = []
        self.places: list[tuple[_File, int]] = []  # of the lines
        self._include = include
        self._read(path, ())

    def _read(self, path: Path, within: tuple[Path, ...]) -> _File:
        file = _File(path, _LINE.findall(path.read_bytes()))
        self.files.append(file)
        bare = [line.rstrip(b"\r\n").decode(*UTF8) for line in file.lines]
        if bare:
            bare[0] = bare[0].removeprefix(BOM_UTF8.decode())
        line = 0
        while line < len(bare):
            found = self._include(bare, line) or Include({}, [bare[line]])
            self.lines += found.lines
            self.places += [(file, line + k) for k in range(len(found.lines))]
            for after, name in found.names.items():
                child = self._included(path, name, (*within, path))
                file.includes[line + after] = child, name
            line += len(found.lines)
        return file

    def _included(self, path: Path, given: str, within: tuple[Path, ...]) -> _File:
        """Read a file, relative to the deck or to the file that includes it."""
        name = _path(given)
        for folder in (self.files[0].path.parent, path.parent):
            found = folder / name
            if found in within:
                raise MeshError(f"the file {printable(found)} includes itself")
            if found.is_file():
                try:
                    return self._read(found, within)
                except OSError as error:
                    reason = printable(error.strerror or error)
                    raise MeshError(f"the file {printable(found)}: {reason}") from None
        raise MeshError(
            f"the file {excerpt(name)!r}, which {printable(path.name)} includes, does "
            "not exist"
        )

    @property
    def content(self) -> bytes:
        """All lines, separated by line feeds."""
        return "\n".join(self.lines).encode(*UTF8)


class DeckCopy:
    """Copy of a deck with changed lines."""

    def __init__(self, text: DeckText) -> None:
        self._text = text
        self._changes: dict[int, list[str]] = {}
        self._rest: list[str] = []

    def replace(self, line: int, by: list[str]) -> None:
        """Replace a line."""
        self._changes[line] = by

    def comment_out(self, lines: list[int], mark: str) -> None:
        """Comment out lines."""
        for line in lines:
            self.replace(line, [mark + self._text.lines[line]])

    def insert(self, line: int | None, more: list[str]) -> None:
        """Insert lines before a line, or at the end of the main file."""
        if line is None:
            self._rest += more
        else:
            kept = self._changes.get(line, [self._text.lines[line]])
            self.replace(line, [*more, *kept])

    def content(self) -> bytes:
        """All lines in one file."""
        kept = (self._changes.get(i, [x]) for i, x in enumerate(self._text.lines))
        lines = [line for some in kept for line in some]
        return "\n".join([*lines, *self._rest, ""]).encode(*UTF8)

    def files(self, more: Mapping[str, list[str]]) -> dict[str, bytes]:
        """Content of all files with the changes, and of more files, by their names.

        The deck is the first.  Files below its folder keep their places relative to
        it.  Others are next to it, and the lines that include them are adapted.

        Raises
        ------
        MeshError
            If a changed file is included more than once, or two files would be written
            to one place.
        """
        files = self._text.files
        changes, names = self._by_file(), self._names()
        if taken := set(more) & {file.path.name for file in files}:
            name = printable(min(taken))
            raise MeshError(f"the deck includes {name} already: take the deck before")
        copies = {names[f.path]: f.copy(changes.get(f.path, {}), names) for f in files}
        main = names[files[0].path]
        if self._rest:
            whole = copies[main]
            end = b"\r\n" if b"\r\n" in whole else b"\n"
            whole += b"" if whole.endswith((b"\n", b"\r")) else end
            rest = (line.encode(*UTF8) + end for line in self._rest)
            copies[main] = whole + b"".join(rest)
        for name, lines in more.items():
            copies[name] = "\n".join([*lines, ""]).encode(*UTF8)
        return copies

    def _by_file(self) -> dict[Path, dict[int, list[str]]]:
        """New lines by file and line in it."""
        changes: dict[Path, dict[int, list[str]]] = {}
        for line, by in self._changes.items():
            file, at = self._text.places[line]
            changes.setdefault(file.path, {})[at] = by
        paths = [file.path for file in self._text.files]
        for path in changes:
            if paths.count(path) > 1:
                raise MeshError(
                    f"the file {printable(path)} is included more than once: include "
                    "copies of it"
                )
        return changes

    def _names(self) -> dict[Path, str]:
        """Name of the copy of each file, relative to the folder of the copies."""
        files = self._text.files
        home = files[0].path.parent.resolve()
        names, by_name = dict[Path, str](), dict[str, Path]()
        for file in files:
            place = file.path.resolve()
            inside = place.is_relative_to(home)
            name = os.fspath(place.relative_to(home)) if inside else file.path.name
            if by_name.setdefault(name, place) != place:
                raise MeshError(
                    f"the name {printable(name)} of an include file occurs twice"
                )
            names[file.path] = name
        return names


def _path(name: str) -> str:
    """Name of a file in UTF-8, or else in Latin-1, with slashes."""
    given = name.encode(*UTF8)
    try:
        text = given.decode()
    except UnicodeDecodeError:
        text = given.decode("latin-1")
    return text.strip().replace("\\", "/")
