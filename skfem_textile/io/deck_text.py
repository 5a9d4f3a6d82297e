"""Lines of a deck with its include files, and copies with some lines changed."""

import os
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from ..mesh.checks import MeshError
from ..mesh.user_input import excerpt, printable

_LINE = re.compile(rb"[^\r\n]*(?:\r\n|\n|\r)|[^\r\n]+\Z")


class Include(NamedTuple):
    """Name of an included file, and the number of lines that include it.

    The name is the last of these lines, or a part of it.
    """

    name: bytes
    n_lines: int


#: Finds the include that begins at a line of a file: the lines and the number of one.
FindInclude = Callable[[list[bytes], int], Include | None]


@dataclass
class _File:
    path: Path
    lines: list[bytes]  # with their ends
    # By the line of the name: the file and its name as given.
    includes: dict[int, tuple["_File", bytes]] = field(default_factory=dict)


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
            line += found.n_lines if found else 1
            if found:
                name = found.name.decode("latin-1").strip().replace("\\", "/")
                inner = (self.files[0].path.parent if within else path.parent) / name
                if not inner.is_file() and (path.parent / name).is_file():
                    inner = path.parent / name
                if not inner.is_file():
                    raise MeshError(
                        f"the file {excerpt(name)!r}, which "
                        f"{printable(path.name)} includes, does not exist"
                    )
                child = self._read(inner, include, comment, (*within, path))
                file.includes[line - 1] = child, found.name
        return file

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

    def write(self, folder: Path) -> list[Path]:
        """Write all files with the changes; returns their paths, the deck first.

        Files below the folder of the deck keep their places relative to it.  Others
        are written next to the deck, and the lines that include them are adapted.

        Raises
        ------
        MeshError
            If a file is included twice and its copies would differ, or two have the
            same place.
        """
        by_place: dict[tuple[int, int], list[bytes]] = {}
        for line, by in self._changes.items():
            file, at = self._at[line]
            if by_place.setdefault((id(file), at), by) != by:
                raise MeshError(
                    f"the file {printable(file.path)} is included more than once: "
                    "include copies of it"
                )
        names = self._names()
        written = []
        for file in self.files:
            lines = list(file.lines)
            for at, (child, name) in file.includes.items():
                given = name.strip().replace(b"\\", b"/").decode("latin-1")
                if given != names[child.path]:
                    new = names[child.path].encode("latin-1", "replace")
                    lines[at] = lines[at].replace(name, new)
            for at, line in enumerate(lines):
                end = line[len(line.rstrip(b"\r\n")) :] or b"\n"
                if (by := by_place.get((id(file), at))) is not None:
                    lines[at] = b"".join(one + end for one in by)
            if file is self.files[0] and self._rest:
                end = b"\r\n" if lines and lines[0].endswith(b"\r\n") else b"\n"
                if lines and not lines[-1].endswith((b"\n", b"\r")):
                    lines[-1] += end
                lines += [one + end for one in self._rest]
            path = folder / names[file.path]
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(b"".join(lines))
            written.append(path)
        return list(dict.fromkeys(written))

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
                raise MeshError(f"two include files have the name {printable(name)}")
        return names
