"""Damage to texts, to bytes and to files, drawn by Hypothesis.

Each kind of damage is a function ``(draw, content) -> content``.
"""

import os
import re
from functools import partial
from pathlib import Path

from hypothesis import strategies as st

# ------------------------------------------------------------------------------- texts

_TOKEN = re.compile(rb"[^\s,<>=\"]+")
_NUMBER = re.compile(rb"(?<![\w.+-])[+-]?\d+\.?\d*(?:[eE][+-]?\d+)?(?![\w.])")
_NAME = re.compile(rb"[A-Za-z_$*][\w:]*")
_LINE_OF_NUMBERS = re.compile(rb"(?m)^.*\d[\s,]+\d.*$")
_LINE_WITH_COUNT = re.compile(rb"(?m)^(?:\d+|[A-Z_]+ \d.*|<Piece.*)$")

# Words in place of a number, and unexpected characters.
_VALUES = (
    *(b"nan", b"inf", b"-1", b"0", b"1e308", b"1e-300", b"-1e200", b"1e99", b"2.5"),
    *(b"1" + 30 * b"0", b"1e", b"0x10", b"1_0", b"--1", b"1d0", b"", b"\xd9\xa1"),
    b"4294967297",
)
_ODD = (
    *(b"\0", b"\x07", b"\x1b[2J", b"\xff\xfe", b"\xe4", b"\x0b", b"\x85"),
    *(b'"', b",", b"*", b"$"),
)


def _span(draw, content, pattern):
    """Span of a match of the pattern; (0, 0) if it matches nowhere."""
    spans = [match.span() for match in pattern.finditer(content)]
    return draw(st.sampled_from(spans)) if spans else (0, 0)


def _two_spans(draw, content, pattern):
    return sorted(_span(draw, content, pattern) for _ in range(2))


def _position(draw, content):
    return draw(st.integers(0, len(content)))


def _bit(draw, content):
    i = draw(st.integers(0, len(content) - 1))
    other = content[i] ^ (1 << draw(st.integers(0, 7)))
    return content[:i] + bytes([other]) + content[i + 1 :]


def _lines(draw, content, *, kind):
    """A line deleted or doubled, or two lines swapped."""
    lines = content.split(b"\n")
    a, b = (draw(st.integers(0, len(lines) - 1)) for _ in range(2))
    if kind == "deleted":
        del lines[a]
    elif kind == "doubled":
        lines.insert(a, lines[a])
    else:
        b = b if kind == "swapped" else max(a - 1, 0)
        lines[a], lines[b] = lines[b], lines[a]
    return b"\n".join(lines)


def _words(draw, content):
    """A word deleted or doubled, or two words swapped."""
    a, b = _two_spans(draw, content, _TOKEN)
    kind = draw(st.sampled_from(("delete", "double", "swap")))
    if kind == "delete":
        return content[: a[0]] + content[a[1] :]
    if kind == "double":
        return content[: a[1]] + b" " + content[slice(*a)] + content[a[1] :]
    return _swap(content, a, b)


def _swap(content, a, b):
    if a[1] > b[0]:
        return content
    one, other = content[slice(*a)], content[slice(*b)]
    return content[: a[0]] + other + content[a[1] : b[0]] + one + content[b[1] :]


def _number(draw, content):
    """Another number, or a word, in place of a number."""
    a, b = _span(draw, content, _NUMBER)
    word = content[a:b]
    kind = draw(st.sampled_from(("value", "other", "near", "near")))
    if kind == "value":
        new = draw(st.sampled_from(_VALUES))
    elif kind == "other":
        new = content[slice(*_span(draw, content, _NUMBER))]
    elif word.isdigit():
        new = str(int(word) + draw(st.sampled_from((-1, 1)))).encode()
    else:
        factor = draw(st.sampled_from((1.001, 0.95, 0.5, -1.0)))
        new = repr(float(word or 0) * factor).encode()
    return content[:a] + new + content[b:]


def _numbers(draw, content):
    """Two numbers of a line swapped, such as two nodes of a cell."""
    a, b = _span(draw, content, _LINE_OF_NUMBERS)
    line = content[a:b]
    swapped = _swap(line, *_two_spans(draw, line, _NUMBER))
    return content[:a] + swapped + content[b:]


def _count(draw, content):
    """Another count: a number that is alone or in a line with a word."""
    a, b = _span(draw, content, _LINE_WITH_COUNT)
    return content[:a] + _number(draw, content[a:b]) + content[b:]


def _word(draw, content):
    """Another keyword or name: in capitals, shorter, longer, or from another place."""
    (a, b), other = (_span(draw, content, _NAME) for _ in range(2))
    word = content[a:b]
    new = word.swapcase(), word[:-1], word + b"x", content[slice(*other)]
    return content[:a] + draw(st.sampled_from(new)) + content[b:]


def _odd_character(draw, content):
    """An unexpected character, in a name or anywhere."""
    a, b = _span(draw, content, draw(st.sampled_from((_NAME, _TOKEN))))
    i = draw(st.integers(a, b))
    return content[:i] + draw(st.sampled_from(_ODD)) + content[i:]


def _cut(draw, content):
    """The end cut off, or a piece cut out."""
    a, b = sorted(_position(draw, content) for _ in range(2))
    return content[:a] + draw(st.sampled_from((b"", content[b:])))


def _empty(draw, content):
    return draw(st.sampled_from((b"", b"\n", b"\0" * 100)))


def _ends(draw, content):
    """Other ends of lines."""
    return content.replace(b"\n", draw(st.sampled_from((b"\r\n", b"\r", b"\n\n"))))


def _repeat(draw, content):
    """The content, followed by all or the end of it once more."""
    return content + content[draw(st.sampled_from((0, _position(draw, content)))) :]


# Kinds of damage to a text, and their relative frequencies.
_KINDS = {
    "bit": (_bit, 30),
    "line deleted": (partial(_lines, kind="deleted"), 20),
    "line doubled": (partial(_lines, kind="doubled"), 20),
    "lines swapped": (partial(_lines, kind="swapped"), 10),
    "neighbours swapped": (partial(_lines, kind="neighbours"), 10),
    "words": (_words, 25),
    "number": (_number, 90),
    "numbers swapped": (_numbers, 40),
    "count": (_count, 20),
    "word": (_word, 30),
    "odd character": (_odd_character, 20),
    "cut": (_cut, 15),
    "empty": (_empty, 1),
    "ends of lines": (_ends, 4),
    "twice": (_repeat, 4),
}
_WEIGHTED = [name for name, (_, weight) in _KINDS.items() for _ in range(weight)]


@st.composite
def damaged(draw, content: bytes) -> tuple[bytes, str]:
    """The content with one or a few kinds of damage, and their names.

    One content in fifteen is unchanged.
    """
    if not draw(st.integers(0, 14)):
        return content, ""
    names = draw(
        st.sampled_from((1, 1, 1, 1, 2, 3)).flatmap(
            lambda n: st.lists(st.sampled_from(_WEIGHTED), min_size=n, max_size=n)
        )
    )
    for name in names:
        content = _KINDS[name][0](draw, content) if content else content
    return content, ", ".join(names)


# ------------------------------------------------------------------------------- bytes


def _flip_bits(draw, content):
    """Some bytes with other bits."""
    changed = bytearray(content)
    for _ in range(draw(st.integers(1, 8)) if changed else 0):
        changed[draw(st.integers(0, len(changed) - 1))] ^= draw(st.integers(1, 255))
    return bytes(changed)


def _truncate(draw, content):
    return content[: _position(draw, content)]


def _lengthen(draw, content):
    """Random bytes, or a copy of a part, inserted."""
    i, a, b = (_position(draw, content) for _ in range(3))
    i = draw(st.sampled_from((0, i, len(content))))
    more = draw(st.binary(min_size=1, max_size=99) | st.just(content[a:b]))
    return content[:i] + more + content[i:]


def _shorten(draw, content):
    a, b = sorted(_position(draw, content) for _ in range(2))
    return content[:a] + content[b:]


#: Damage to the bytes of any file.
TO_BYTES = (_flip_bits, _truncate, _lengthen, _shorten)

# ------------------------------------------------------------------------------- files

#: Replacements of a file.
REPLACEMENTS = (
    *("a folder", "a link to itself", "a link to nothing", "a link to zeros"),
    *("a pipe", "a link to it"),
)


def replace_file(path: Path, kind: str) -> None:
    """Put a folder, a pipe or a link in the place of a file."""
    beside = path.parent.parent / f"moved {path.name}"
    path.rename(beside)
    if kind == "a folder":
        path.mkdir()
    elif kind == "a pipe":
        os.mkfifo(path)
    else:
        targets = {
            "a link to itself": path.name,
            "a link to nothing": "nothing",
            "a link to zeros": "/dev/zero",
            "a link to it": beside,
        }
        path.symlink_to(targets[kind])
