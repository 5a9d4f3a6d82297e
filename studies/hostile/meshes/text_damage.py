"""Damage to the text or the bytes of a file."""

import re
from collections.abc import Callable

from numpy.random import Generator

_TOKEN = re.compile(rb"[^\s,<>=\"]+")
_NUMBER = re.compile(rb"(?<![\w.+-])[+-]?\d+\.?\d*(?:[eE][+-]?\d+)?(?![\w.])")
_NAME = re.compile(rb"[A-Za-z_$*][\w:]*")

# Words that take the place of numbers.
_VALUES = (
    *(b"nan", b"inf", b"-1", b"0", b"1e308", b"1e-300", b"-1e200", b"1e99"),
    *(
        b"1" + 30 * b"0",
        b"1e",
        b"0x10",
        b"1_0",
        b"2.5",
        b"--1",
        b"1d0",
        b"",
        b"\xd9\xa1",
        b"4294967297",
    ),
)
# Characters that should not be there.
_ODD = (
    *(b"\0", b"\x07", b"\x1b[2J", b"\xff\xfe", b"\xe4", b"\x0b", b"\x85"),
    *(b'"', b",", b"*", b"$"),
)

Damage = Callable[[bytes, Generator], bytes]


def _place(
    content: bytes, rng: Generator, pattern: re.Pattern[bytes]
) -> tuple[int, int]:
    """Where the pattern matches; (0, 0) if it matches nowhere."""
    places = [match.span() for match in pattern.finditer(content)]
    return places[rng.integers(0, len(places))] if places else (0, 0)


def _bit(content: bytes, rng: Generator) -> bytes:
    """Flip a bit."""
    if not content:
        return content
    position = int(rng.integers(0, len(content)))
    other = content[position] ^ (1 << int(rng.integers(0, 8)))
    return content[:position] + bytes([other]) + content[position + 1 :]


def _two_lines(content: bytes, rng: Generator) -> tuple[list[bytes], int, int]:
    """All lines, and the numbers of two of them."""
    lines = content.split(b"\n")
    a, b = rng.integers(0, len(lines), 2).tolist()
    return lines, a, b


def _line_deleted(content: bytes, rng: Generator) -> bytes:
    lines, a, _ = _two_lines(content, rng)
    return b"\n".join(lines[:a] + lines[a + 1 :])


def _line_doubled(content: bytes, rng: Generator) -> bytes:
    lines, a, _ = _two_lines(content, rng)
    return b"\n".join(lines[: a + 1] + lines[a:])


def _lines_swapped(content: bytes, rng: Generator) -> bytes:
    lines, a, b = _two_lines(content, rng)
    lines[a], lines[b] = lines[b], lines[a]
    return b"\n".join(lines)


def _neighbours_swapped(content: bytes, rng: Generator) -> bytes:
    lines, a, _ = _two_lines(content, rng)
    b = max(a - 1, 0)
    lines[a], lines[b] = lines[b], lines[a]
    return b"\n".join(lines)


def _tokens(content: bytes, rng: Generator) -> bytes:
    """Delete, double or swap words."""
    a, b = sorted([_place(content, rng, _TOKEN), _place(content, rng, _TOKEN)])
    one, other = content[slice(*a)], content[slice(*b)]
    kind = rng.integers(0, 3)
    if kind == 0:
        return content[: a[0]] + content[a[1] :]
    if kind == 1:
        return content[: a[1]] + b" " + one + content[a[1] :]
    if a[1] > b[0]:
        return content
    return content[: a[0]] + other + content[a[1] : b[0]] + one + content[b[1] :]


def _number(content: bytes, rng: Generator) -> bytes:
    """Another number in place of one."""
    a, b = _place(content, rng, _NUMBER)
    word = content[a:b]
    kind = rng.integers(0, 4)
    if kind == 0:
        new = _VALUES[rng.integers(0, len(_VALUES))]
    elif kind == 1:
        new = content[slice(*_place(content, rng, _NUMBER))]
    elif word.isdigit():
        new = str(int(word) + int(rng.choice([-1, 1]))).encode()
    else:
        factor = float(rng.choice([1.001, 0.95, 0.5, -1.0]))
        new = repr(float(word or 0) * factor).encode()
    return content[:a] + new + content[b:]


def _numbers(content: bytes, rng: Generator) -> bytes:
    """Two numbers of a line swapped, as two nodes of a cell."""
    lines = re.compile(rb"(?m)^.*\d[\s,]+\d.*$")
    a, b = _place(content, rng, lines)
    line = content[a:b]
    one, other = sorted([_place(line, rng, _NUMBER), _place(line, rng, _NUMBER)])
    if one[1] > other[0]:
        return content
    middle = line[other[0] : other[1]] + line[one[1] : other[0]] + line[slice(*one)]
    return content[: a + one[0]] + middle + content[a + other[1] :]


def _count(content: bytes, rng: Generator) -> bytes:
    """Another count: a number that is alone or in a line with a word."""
    lines = re.compile(rb"(?m)^(?:\d+|[A-Z_]+ \d.*|<Piece.*)$")
    a, b = _place(content, rng, lines)
    return content[:a] + _number(content[a:b], rng) + content[b:]


def _word(content: bytes, rng: Generator) -> bytes:
    """Another keyword or name: in capitals, shorter, longer, or from another place."""
    a, b = _place(content, rng, _NAME)
    word = content[a:b]
    new = (
        word.swapcase(),
        word[:-1],
        word + b"x",
        content[slice(*_place(content, rng, _NAME))],
    )[rng.integers(0, 4)]
    return content[:a] + new + content[b:]


def _odd(content: bytes, rng: Generator) -> bytes:
    """A character that should not be there, in a name or anywhere."""
    a, b = _place(content, rng, _NAME if rng.integers(0, 2) else _TOKEN)
    position = int(rng.integers(a, b + 1))
    character = _ODD[rng.integers(0, len(_ODD))]
    return content[:position] + character + content[position:]


def _cut(content: bytes, rng: Generator) -> bytes:
    """Cut off the end, or a piece."""
    a, b = sorted(rng.integers(0, len(content) + 1, 2).tolist())
    return content[:a] if rng.integers(0, 2) else content[:a] + content[b:]


def _empty(content: bytes, rng: Generator) -> bytes:
    return (b"", b"\n", b"\0" * 100)[rng.integers(0, 3)]


def _ends(content: bytes, rng: Generator) -> bytes:
    """Other ends of lines."""
    return content.replace(b"\n", (b"\r\n", b"\r", b"\n\n")[rng.integers(0, 3)])


def _twice(content: bytes, rng: Generator) -> bytes:
    """The file, and it or its end once more."""
    start = int(rng.integers(0, len(content) + 1) * rng.integers(0, 2))
    return content + content[start:]


# Kinds of damage, and how often each is done relative to the others.
_KINDS: dict[str, tuple[Damage, float]] = {
    "bit": (_bit, 3),
    "line deleted": (_line_deleted, 2),
    "line doubled": (_line_doubled, 2),
    "lines swapped": (_lines_swapped, 1),
    "neighbours swapped": (_neighbours_swapped, 1),
    "words": (_tokens, 2.5),
    "number": (_number, 9),
    "numbers swapped": (_numbers, 4),
    "count": (_count, 2),
    "word": (_word, 3),
    "odd character": (_odd, 2),
    "cut": (_cut, 1.5),
    "empty": (_empty, 0.1),
    "ends of lines": (_ends, 0.4),
    "twice": (_twice, 0.4),
}

# One in this many files is left as it is.
_WHOLE = 15


def damaged(content: bytes, rng: Generator) -> tuple[bytes, str]:
    """The content with one or a few kinds of damage, and what they were."""
    if rng.integers(0, _WHOLE) == 0:
        return content, ""
    names, weights = list(_KINDS), [weight for _, weight in _KINDS.values()]
    shares = [weight / sum(weights) for weight in weights]
    done = []
    for _ in range(rng.choice([1, 1, 1, 1, 2, 3])):
        name = str(rng.choice(names, p=shares))
        content = _KINDS[name][0](content, rng) if content else content
        done.append(name)
    return content, ", ".join(done)
