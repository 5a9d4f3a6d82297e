"""Numbers in files, as text or as bytes: all that are due, and nothing else."""

import contextlib
from typing import Any, NoReturn

import numpy as np
from numpy import ndarray

from ..mesh.checks import MeshError
from ..mesh.user_input import printable


def from_words(words: list[bytes], dtype: Any) -> ndarray:
    """Numbers of a type from words, shape (n,).

    Raises
    ------
    MeshError
        If a word is no such number, or it is too large for the type.
    """
    dtype = np.dtype(dtype)
    parse: Any = float if dtype.kind == "f" else int
    try:
        numbers = list(map(parse, words))
    except ValueError:
        _refuse_words(words, parse)
    if b"_" in b"".join(words):  # Python's own way to write long numbers
        _refuse_words(words, parse)
    if parse is float:
        with np.errstate(over="ignore"):  # then infinite, and refused as such
            return np.array(numbers, dtype=float).astype(dtype)
    bounds = np.iinfo(dtype)
    for number in (max(numbers, default=0), min(numbers, default=0)):
        if not bounds.min <= number <= bounds.max:
            raise MeshError(f"the number {str(number)[:30]} is too large")
    return np.array(numbers, dtype=dtype)


def _refuse_words(words: list[bytes], parse: Any) -> NoReturn:
    """Name the first word that is no number."""
    for word in words:
        with contextlib.suppress(ValueError):
            if b"_" not in word:
                parse(word)
                continue
        break
    kind = "number" if parse is float else "whole number"
    shown = printable(word[:30].decode(errors="replace"))
    raise MeshError(f"{shown!r} is no {kind}")


class Words:
    """Numbers that are written as words."""

    def __init__(self, text: bytes) -> None:
        self._words, self._at = text.split(), 0

    @property
    def left(self) -> int:
        """How many words are left."""
        return len(self._words) - self._at

    def words(self, count: int) -> list[bytes]:
        """The next words."""
        if not 0 <= count <= self.left:
            raise MeshError(f"{count} numbers are due where {self.left} are left")
        words = self._words[self._at : self._at + count]
        self._at += count
        return words

    def take(self, count: int, dtype: Any) -> ndarray:
        """The next numbers, of a type, shape (count,)."""
        return from_words(self.words(count), dtype)

    def end(self) -> None:
        """Refuse that there are more numbers."""
        if self.left:
            raise MeshError(f"{self.left} more words than its counts say")


class Bytes:
    """Numbers that are written as bytes."""

    def __init__(self, content: bytes) -> None:
        self._content, self._at = content, 0

    def take(self, count: int, dtype: Any) -> ndarray:
        """The next numbers, of a type, shape (count,)."""
        size, left = count * np.dtype(dtype).itemsize, len(self._content) - self._at
        if not 0 <= size <= left:
            raise MeshError(f"{size} bytes are due where {left} are left")
        taken = np.frombuffer(self._content, dtype, count, self._at)
        self._at += size
        return taken

    def line(self) -> bytes:
        """The rest of this line."""
        end = self._content.find(b"\n", self._at)
        end = len(self._content) if end < 0 else end
        line = self._content[self._at : end]
        self._at = end + 1
        return line

    def end(self) -> None:
        """Refuse that there are more bytes than an end of a line."""
        left = self._content[self._at :]
        if left not in (b"", b"\n", b"\r\n"):
            raise MeshError(f"{len(left)} more bytes than its counts say")


def places(tags: ndarray, wanted: ndarray, what: str) -> ndarray:
    """Where wanted tags stand among tags, shape of those wanted.

    Raises
    ------
    MeshError
        If one that is wanted is not there.
    """
    if not len(tags):
        raise MeshError(f"it has no {what}")
    order = np.argsort(tags, kind="stable")
    at = np.searchsorted(tags[order], wanted).clip(max=len(tags) - 1)
    there = tags[order[at]] == wanted
    if not there.all():
        raise MeshError(f"it names {what} {wanted[~there][0]}, which is not there")
    return order[at]


def refuse_twice(tags: ndarray, what: str) -> None:
    """Refuse that a tag is there twice.

    Raises
    ------
    MeshError
        If there is one.
    """
    tags = np.sort(tags)
    if (twice := tags[1:][tags[1:] == tags[:-1]]).size:
        raise MeshError(f"there are two of {what} {twice[0]}; number them apart")
