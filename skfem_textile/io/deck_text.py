"""Lines of a deck with its include files, and copies with some lines changed."""

import os
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from ..mesh.checks import MeshError
from ..mesh.user_input import excerpt, printable

_LINE = re.compile(rb"[^\r\n]*(?:\r\n|\n|\r)|[^\r\n]+\Z")


class Include(NamedTuple):
    """Names of included files by the line after the first, and the number of lines."""

    names: dict[int, bytes]
    n_lines: int = 1


#: Finds the include that begins at a line of a file: the lines and the number of one.
FindInclude = Callable[[list[bytes], int], Include | None]


@dataclass
class _File:
    path: Path
    lines: list[bytes]  # with their ends
    # By the line of the name: the file and its name as given.
    includes: dict[int, tuple["_File", bytes]] = field(default_factory=dict)

    def copy(self, changes: dict[int, list[bytes]], names: dict[Path, str]) -> bytes:
        """Content with changed lines, and new names of include files."""
        lines = list(self.lines)
        for at, (child, name) in self.includes.items():
            if _path(name) != names[child.path]:
                new = names[child.path].encode("latin-1", "replace")
                lines[at] = lines[at].replace(name, new)
        for at, by in changes.items():
            end = lines[at][len(lines[at].rstrip(b"\r\n")) :] or b"\n"
            lines[at] = b"".join(line + end for line in by)
        return b"".join(lines)


@dataclass
class DeckText:
    """All lines of a deck in the order in which a solver reads them.

    Attributes
    ----------
    lines
        Lines without their ends.  Those that include a file are replaced by empty
        comments.
    files
        The file of the deck, and those that it includes.
    """

    lines: list[bytes]
    files: list[_File]
    _at: list[tuple[_File, int]]
    _changes: dict[int, list[bytes]] = field(default_factory=dict)
    _rest: list[bytes] = field(default_factory=list)

    @classmethod
    def read(cls, path: Path, include: FindInclude, comment: bytes) -> "DeckText":
        """Read a deck and its include files.

        Raises
        ------
        MeshError
            If a file cannot be read, or includes itself.
        """
        text = cls([], [], [])
        text._read(path, include, comment, ())
        return text

    def _read(
        self, path: Path, include: FindInclude, comment: bytes, within: tuple[Path, ...]
    ) -> _File:
        if path in within:
            raise MeshError(f"the file {printable(path)} includes itself")
        try:
            file = _File(path, _LINE.findall(path.read_bytes()))
        except OSError as error:
            reason = printable(error.strerror or error)
            raise MeshError(f"the file {printable(path)}: {reason}") from None
        self.files.append(file)
        bare, line = [one.rstrip(b"\r\n") for one in file.lines], 0
        while line < len(bare):
            found = include(bare, line)
            for one in range(line, line + (found.n_lines if found else 1)):
                self.lines.append(comment if found else bare[one])
                self._at.append((file, one))
            for after, name in found.names.items() if found else ():
                child = self._read(
                    self._found(path, name), include, comment, (*within, path)
                )
                file.includes[line + after] = child, name
            line += found.n_lines if found else 1
        return file

    def _found(self, path: Path, given: bytes) -> Path:
        """Included file, relative to the deck or to the file that includes it."""
        name = _path(given)
        for folder in (self.files[0].path.parent, path.parent):
            if (folder / name).is_file():
                return folder / name
        raise MeshError(
            f"the file {excerpt(name)!r}, which {printable(path.name)} includes, does "
            "not exist"
        )

    def unchanged(self) -> "DeckText":
        """The same lines without changes."""
        return DeckText(self.lines, self.files, self._at)

    @property
    def content(self) -> bytes:
        """All lines, separated by line feeds."""
        return b"\n".join(self.lines)

    def replace(self, line: int, by: list[bytes]) -> None:
        """Replace a line in copies."""
        self._changes[line] = by

    def comment_out(self, lines: list[int], mark: bytes) -> None:
        """Comment out lines in copies."""
        for line in lines:
            self.replace(line, [mark + self.lines[line]])

    def insert(self, line: int | None, more: list[bytes]) -> None:
        """Insert lines in copies before a line, or at the end of the main file."""
        if line is None:
            self._rest += more
        else:
            kept = self._changes.get(line, [self.lines[line]])
            self.replace(line, [*more, *kept])

    def changed(self) -> list[bytes]:
        """All lines with the changes."""
        kept = (self._changes.get(i, [x]) for i, x in enumerate(self.lines))
        return [x for lines in kept for x in lines] + self._rest

    def write(self, folder: Path, more: Mapping[str, list[str]]) -> list[Path]:
        """Write all files with the changes, and more files by name; returns all paths.

        Files below the folder of the deck keep their places relative to it.  Others
        are written next to the deck, and the lines that include them are adapted.

        Raises
        ------
        MeshError
            If a changed file is included more than once, or two files would be written
            to one place.
        """
        changes, names = self._by_file(), self._names()
        if taken := set(more) & {file.path.name for file in self.files}:
            name = printable(min(taken))
            raise MeshError(f"the deck includes {name} already: take the deck before")
        copies = {
            names[f.path]: f.copy(changes.get(f.path, {}), names) for f in self.files
        }
        main = names[self.files[0].path]
        if self._rest:
            whole = copies[main]
            end = b"\r\n" if b"\r\n" in whole else b"\n"
            whole += b"" if whole.endswith((b"\n", b"\r")) else end
            copies[main] = whole + b"".join(line + end for line in self._rest)
        for name, lines in more.items():
            copies[name] = "\n".join([*lines, ""]).encode("latin-1", "replace")
        for name, content in copies.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(content)
        return [folder / name for name in copies]

    def _by_file(self) -> dict[Path, dict[int, list[bytes]]]:
        """New lines by file and line in it."""
        changes: dict[Path, dict[int, list[bytes]]] = {}
        for line, by in self._changes.items():
            file, at = self._at[line]
            changes.setdefault(file.path, {})[at] = by
        for path in changes:
            if [file.path for file in self.files].count(path) > 1:
                raise MeshError(
                    f"the file {printable(path)} is included more than once: include "
                    "copies of it"
                )
        return changes

    def _names(self) -> dict[Path, str]:
        """Name of the copy of each file, relative to the folder of the copies."""
        home = self.files[0].path.parent.resolve()
        names = {}
        for file in self.files:
            inside = os.path.relpath(file.path.resolve(), home)
            outside = inside.startswith("..") or os.path.isabs(inside)
            names[file.path] = file.path.name if outside else inside
        by_name: dict[str, Path] = {}
        for path, name in names.items():
            if by_name.setdefault(name, path.resolve()) != path.resolve():
                raise MeshError(
                    f"the name {printable(name)} of an include file occurs twice"
                )
        return names


def _path(name: bytes) -> str:
    return name.decode("latin-1").strip().replace("\\", "/")
