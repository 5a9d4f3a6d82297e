"""Ways to damage bytes, and files of a folder."""

import os
from collections.abc import Callable
from pathlib import Path

from numpy.random import Generator


def flipped(rng: Generator, content: bytes) -> bytes:
    """Some bytes with other bits."""
    damaged = bytearray(content)
    for i in rng.integers(len(damaged), size=rng.integers(1, 9)) if damaged else ():
        damaged[i] ^= int(rng.integers(1, 256))
    return bytes(damaged)


def truncated(rng: Generator, content: bytes) -> bytes:
    """The content without its end; sometimes nothing of it."""
    return content[: rng.integers(len(content) + 1) * (rng.random() > 0.1)]


def lengthened(rng: Generator, content: bytes) -> bytes:
    """The content with random bytes, or a copy of a part, inserted."""
    i, a, b = rng.integers(len(content) + 1, size=3)
    i = rng.choice([0, i, len(content)])
    more = rng.bytes(rng.integers(1, 99)) if rng.random() < 0.5 else content[a:b]
    return content[:i] + more + content[i:]


def shortened(rng: Generator, content: bytes) -> bytes:
    """The content without a part of it."""
    a, b = sorted(rng.integers(len(content) + 1, size=2))
    return content[:a] + content[b:]


#: Ways to damage bytes.
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
    content = path.read_bytes()
    path.write_bytes(other.read_bytes())
    other.write_bytes(content)
    return f"{path.name} and {other.name} exchanged"


def replaced(rng: Generator, path: Path) -> str:
    """Put a folder, a pipe or a link in the place of a file."""
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
