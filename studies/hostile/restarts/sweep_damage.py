"""Ways to damage the lines of a file of a sweep."""

import json
from collections.abc import Callable
from typing import Any

from numpy.random import Generator

from ..readers import sweep_file

#: Lines that no sweep writes.
_FOREIGN = (
    *(b"", b" ", b"\r", b"[]", b"{}", b"null", b"a note of mine", b"\x00" * 40),
    *(b'{"case": "0", "found": 1}', b'{"case": "0", "found": 1, "digest": "0"}'),
    *(b"load,N", b"\xff\xfe\xfa", b'"' * 30, b"x" * 100_000),
)

#: Starts of lines that no sweep writes; they get a right digest.
_FORGED = (
    *(b"", b"[", b"{", b"null", b'{"case": ', b'{"case": "0"', b'{"found": 1'),
    *(b'{"case": 1, "found": 1', b'{"case": ["0"], "found": 1', b"\xff\xff"),
    *(b'{"case": null, "found": 1', b'{"case": "0", "more": 1, "found": 1'),
    *(b'{"case": "0", "found": ' + b"[" * 50_000, b'{"case": {}, "found": 2'),
)


def reordered(rng: Generator, content: bytes) -> bytes:
    """All lines in another order."""
    lines = content.splitlines(keepends=True)
    return b"".join(lines[i] for i in rng.permutation(len(lines)))


def doubled(rng: Generator, content: bytes) -> bytes:
    """A line, or all, once more."""
    lines = content.splitlines(keepends=True)
    return content + (lines[rng.integers(len(lines))] if lines else content)


def without_a_line(rng: Generator, content: bytes) -> bytes:
    """The content without a line."""
    lines = content.splitlines(keepends=True)
    if lines:
        del lines[rng.integers(len(lines))]
    return b"".join(lines)


def with_foreign(rng: Generator, content: bytes) -> bytes:
    """A line that no sweep writes, among the others."""
    return _with(rng, content, _FOREIGN[rng.integers(len(_FOREIGN))] + b"\n")


def foreign_alone(rng: Generator, content: bytes) -> bytes:
    """A line that no sweep writes, alone."""
    return _FOREIGN[rng.integers(len(_FOREIGN))] + b"\n" * int(rng.integers(2))


def with_foreign_end(rng: Generator, content: bytes) -> bytes:
    """A line that no sweep writes, after the others and without its end."""
    return content + _FOREIGN[rng.integers(len(_FOREIGN))]


def with_forged(rng: Generator, content: bytes) -> bytes:
    """A line that no sweep writes with a right digest, among the others."""
    line = sweep_file.sealed(_FORGED[rng.integers(len(_FORGED))])
    return _with(rng, content, line)


def forged_alone(rng: Generator, content: bytes) -> bytes:
    """A line that no sweep writes with a right digest, alone."""
    return sweep_file.sealed(_FORGED[rng.integers(len(_FORGED))])


def edited(rng: Generator, content: bytes) -> bytes:
    """Another result of a case, in its place, with a right digest or the old one."""
    lines = content.splitlines(keepends=True)
    if not lines:
        return content
    i = int(rng.integers(len(lines)))
    try:
        entry = json.loads(lines[i])
        other = sweep_file.line(entry["case"], _other(rng))
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError):
        return content
    if rng.random() < 0.5:
        other = other[:-19] + lines[i][-19:]
    lines[i : i + int(rng.random() < 0.5)] = [other]
    return b"".join(lines)


def with_other_ends(rng: Generator, content: bytes) -> bytes:
    """Other ends of lines, as an editor or a transfer leaves them."""
    return content.replace(b"\n", (b"\r\n", b"\n\n", b"\r")[rng.integers(3)])


def with_mark(rng: Generator, content: bytes) -> bytes:
    """A byte order mark before the content."""
    return b"\xef\xbb\xbf" + content


def joined(rng: Generator, content: bytes) -> bytes:
    """Two lines in one."""
    return content.replace(b"\n", b"", 1)


def nothing(rng: Generator, content: bytes) -> bytes:
    """No content."""
    return b""


def _other(rng: Generator) -> Any:
    values = (0, 1.5, None, "text", [], {"value": 2}, float("nan"), 10**400)
    return values[rng.integers(len(values))]


def _with(rng: Generator, content: bytes, line: bytes) -> bytes:
    lines = content.splitlines(keepends=True)
    lines.insert(int(rng.integers(len(lines) + 1)), line)
    return b"".join(lines)


#: Ways to damage the lines of a file.
DAMAGES: tuple[Callable[[Generator, bytes], bytes], ...] = (
    *(reordered, doubled, without_a_line, with_foreign, foreign_alone),
    *(with_foreign_end, with_forged, forged_alone, edited, with_other_ends),
    *(with_mark, joined, nothing),
)
