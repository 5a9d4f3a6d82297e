"""Numbers in text and binary files, read with validation of their count."""

import contextlib
import csv
import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NoReturn, TypeVar

import numpy as np
from numpy import ndarray

from ..mesh.checks import MeshError
from ..mesh.user_input import errors_in, excerpt, printable

_T = TypeVar("_T")


def by_suffix(path: Path, choices: Mapping[str, _T], what: str) -> _T:
    """Choice by the suffix of a file; a ValueError for any other suffix."""
    if path.suffix.lower() not in choices:
        raise ValueError(f"{what} {', '.join(choices)} files")
    return choices[path.suffix.lower()]


@contextlib.contextmanager
def errors_about(what: object) -> Iterator[None]:
    """Convert exceptions to a `MeshError` that begins with their context."""
    with errors_in(f"{printable(what)}: ", MeshError):
        try:
            yield
        except OSError as error:
            raise ValueError(error.strerror or error) from None


def word_of(x: float | None) -> str:
    """Number as text with 12 significant digits; empty if missing or not finite.

    Examples
    --------
    >>> word_of(3.0000000000000004), word_of(1 / 3), word_of(None)
    ('3', '0.333333333333', '')
    """
    return "" if x is None or not np.isfinite(x) else f"{x:.12g}"


def real_word(x: float, width: int = 20) -> str:
    """Number with a decimal point, as exact as fits into a width.

    Abaqus, CalculiX and OpenRadioss read up to 20 characters, LS-DYNA and Nastran 16.

    Examples
    --------
    >>> real_word(1.0), real_word(-1 / 30), real_word(-1e-17 / 3, 16)
    ('1.0', '-0.03333333333333333', '-3.333333333e-18')
    """
    text = repr(float(x) + 0.0)  # no -0.0
    for digits in range(17, 0, -1):
        mantissa, e, exponent = text.partition("e")
        text = mantissa + "." * ("." not in mantissa) + e + exponent
        if len(text) <= width:
            break
        text = f"{x:.{digits}g}"
    return text


def write_table(
    path: str | os.PathLike[str], header: Iterable[str], rows: Iterable[Iterable[Any]]
) -> None:
    """Write rows of cells below a header as CSV in UTF-8."""
    with open(path, "w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([header, *rows])


def from_words(words: list[bytes], dtype: Any) -> ndarray:
    """Numbers of a type, shape (n,); invalid or too large words are refused."""
    dtype = np.dtype(dtype)
    parse: Any = float if dtype.kind == "f" else int
    try:
        numbers = list(map(parse, words))
    except ValueError:
        _refuse_words(words, parse)
    if b"_" in b"".join(words):  # Python's notation for long numbers
        _refuse_words(words, parse)
    if parse is float:
        with np.errstate(over="ignore"):  # infinite numbers are refused later
            return np.array(numbers, dtype=float).astype(dtype)
    bounds = np.iinfo(dtype)
    for number in (max(numbers, default=0), min(numbers, default=0)):
        if not bounds.min <= number <= bounds.max:
            raise MeshError(f"the number {excerpt(str(number))} is too large")
    return np.array(numbers, dtype=dtype)


def _refuse_words(words: list[bytes], parse: Any) -> NoReturn:
    """Report the first word that is not a number."""
    for word in words:
        with contextlib.suppress(ValueError):
            if b"_" not in word:
                parse(word)
                continue
        break
    kind = "a number" if parse is float else "an integer"
    shown = excerpt(word)
    raise MeshError(f"{shown!r} is not {kind}")


class TextNumbers:
    """Numbers in text form."""

    def __init__(self, text: bytes) -> None:
        self._words, self._position = text.split(), 0

    @property
    def left(self) -> int:
        """Number of remaining words."""
        return len(self._words) - self._position

    def words(self, count: int) -> list[bytes]:
        """Next words."""
        if not 0 <= count <= self.left:
            raise MeshError(f"{count} numbers expected, but {self.left} remain")
        words = self._words[self._position : self._position + count]
        self._position += count
        return words

    def take(self, count: int, dtype: Any) -> ndarray:
        """Next numbers of a type, shape (count,)."""
        return from_words(self.words(count), dtype)

    def refuse_rest(self) -> None:
        """Refuse further numbers."""
        if self.left:
            raise MeshError(
                f"it contains {self.left} more words than its counts declare"
            )


class BinaryNumbers:
    """Numbers in binary form."""

    def __init__(self, content: bytes) -> None:
        self._content, self._position = content, 0

    def take(self, count: int, dtype: Any) -> ndarray:
        """Next numbers of a type, shape (count,)."""
        size = count * np.dtype(dtype).itemsize
        left = len(self._content) - self._position
        if not 0 <= size <= left:
            raise MeshError(f"{size} bytes expected, but {left} bytes remain")
        numbers = np.frombuffer(self._content, dtype, count, self._position)
        self._position += size
        return numbers

    def line(self) -> bytes:
        """Rest of this line."""
        end = self._content.find(b"\n", self._position)
        end = len(self._content) if end < 0 else end
        line = self._content[self._position : end]
        self._position = end + 1
        return line

    def refuse_rest(self) -> None:
        """Refuse further bytes, except the end of a line."""
        rest = self._content[self._position :]
        if rest not in (b"", b"\n", b"\r\n"):
            raise MeshError(
                f"it contains {len(rest)} bytes more than its counts declare"
            )


def tag_positions(tags: ndarray, selected: ndarray, what: str) -> ndarray:
    """Position in ``tags`` of each selected tag, with the shape of ``selected``."""
    if not len(tags):
        raise MeshError(f"no {what} is defined")
    order = np.argsort(tags, kind="stable")
    rank = np.searchsorted(tags[order], selected).clip(max=len(tags) - 1)
    position = order[rank]
    missing = selected[tags[position] != selected]
    if missing.size:
        raise MeshError(f"{what} {missing[0]} is used, but not defined")
    return position


def refuse_duplicates(tags: ndarray, what: str) -> None:
    """Refuse duplicate tags."""
    tags = np.sort(tags)
    if (duplicates := tags[1:][tags[1:] == tags[:-1]]).size:
        raise MeshError(
            f"{what} number {duplicates[0]} is used twice: use unique numbers"
        )
