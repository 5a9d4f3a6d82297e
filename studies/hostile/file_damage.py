"""Ways to damage files of a folder, and bytes."""

import os
from collections.abc import Callable
from pathlib import Path

from numpy.random import Generator


def flipped(rng: Generator, content: bytes) -> bytes:
    """Some bytes with other bits."""
    some = bytearray(content)
    for i in rng.integers(len(some), size=rng.integers(1, 9)) if some else ():
        some[i] ^= int(rng.integers(1, 256))
    return bytes(some)


def truncated(rng: Generator, content: bytes) -> bytes:
    """The content without its end, or without all of it."""
    return content[: rng.integers(len(content) + 1) * (rng.random() > 0.1)]


def lengthened(rng: Generator, content: bytes) -> bytes:
    """The content with bytes of chance, or of its own, somewhere in it."""
    i, a, b = rng.integers(len(content) + 1, size=3)
    i = rng.choice([0, i, len(content)])
    more = rng.bytes(rng.integers(1, 99)) if rng.random() < 0.5 else content[a:b]
    return content[:i] + more + content[i:]


def shortened(rng: Generator, content: bytes) -> bytes:
    """The content without a part in it."""
    a, b = sorted(rng.integers(len(content) + 1, size=2))
    return content[:a] + content[b:]


#: What may happen to bytes.
CHANGES: tuple[Callable[[Generator, bytes], bytes], ...] = (
    flipped,
    truncated,
    lengthened,
    shortened,
)


def changed(rng: Generator, path: Path) -> str:
    """Change the bytes of a file."""
    change = CHANGES[rng.integers(len(CHANGES))]
    path.write_bytes(change(rng, path.read_bytes()))
    return f"{path.name} {change.__name__}"


def emptied(rng: Generator, path: Path) -> str:
    """Leave a file without bytes."""
    path.write_bytes(b"")
    return f"{path.name} emptied"


def removed(rng: Generator, path: Path) -> str:
    """Remove a file."""
    path.unlink()
    return f"{path.name} removed"


def exchanged(rng: Generator, path: Path) -> str:
    """Let two files have each other's bytes."""
    other = rng.choice(sorted(p for p in path.parent.iterdir() if p.is_file()))
    ours, theirs = path.read_bytes(), other.read_bytes()
    path.write_bytes(theirs)
    other.write_bytes(ours)
    return f"{path.name} and {other.name} exchanged"


def replaced(rng: Generator, path: Path) -> str:
    """Put what is no file, or a link, in the place of a file."""
    content = path.read_bytes()
    path.unlink()
    beside = path.parent.parent / f"moved {path.name}"
    kinds = {
        "a folder": path.mkdir,
        "a link to itself": lambda: path.symlink_to(path.name),
        "a link to nothing": lambda: path.symlink_to("nothing"),
        "a link to zeros": lambda: path.symlink_to("/dev/zero"),
        "a pipe": lambda: os.mkfifo(path),
        "a link to it": lambda: path.symlink_to(beside),
    }
    kind = str(rng.choice(list(kinds)))
    beside.write_bytes(content)
    kinds[kind]()
    return f"{path.name} is {kind}"
