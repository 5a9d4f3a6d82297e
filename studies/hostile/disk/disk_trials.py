"""Trials of disks that are full or read-only."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from functools import partial
from pathlib import Path
from random import Random
from time import sleep

from ..trial import Family, Finding, checked
from .command_run import undisturbed
from .mounts import BLOCK, fill, make_read_only, on_small_disk
from .writers import WRITERS, Disk

# Takes the path of a disk; its block ends when the disk can be written to again.
_Spoils = Callable[[Path], AbstractContextManager[Callable[[], None]]]

# Free blocks at most; a run takes a few more.
_MOST_FREE = 30

# Seconds between two attempts to make a disk read-only; an open file prevents it.
_PAUSE = 1e-4


def attempt_full(seed: int, folder: Path) -> Finding:
    """Write to a disk with a random number of free blocks."""
    free = BLOCK * Random(seed).randint(0, _MOST_FREE)

    @contextmanager
    def full(disk: Path) -> Iterator[Callable[[], None]]:
        ballast = fill(disk, free)
        yield lambda: None
        ballast.unlink()

    return _attempt(seed, folder, f"{free} bytes are free", full, 0.0)


def attempt_read_only(seed: int, folder: Path) -> Finding:
    """Write to a disk that becomes read-only at a random moment."""
    random = Random(seed)
    after = random.choice([0.0, random.random()])

    @contextmanager
    def protected(disk: Path) -> Iterator[Callable[[], None]]:
        if not after:
            make_read_only(disk)
        yield partial(_make_read_only_soon, disk)
        make_read_only(disk, read_only=False)

    how = f"read only after {after:.3f} of a run"
    return _attempt(seed, folder, how, protected, after)


def _make_read_only_soon(disk: Path) -> None:
    """Make the disk read-only as soon as no file is open for writing."""
    while True:
        with suppress(OSError):
            return make_read_only(disk)
        sleep(_PAUSE)


def _attempt(
    seed: int, folder: Path, how: str, spoilt: _Spoils, after: float
) -> Finding:
    writer, earlier = list(WRITERS)[seed % len(WRITERS)], bool(seed // len(WRITERS) % 2)
    damage = f"{writer}: {how}" + " over an earlier result" * earlier

    def use(path: Path) -> Finding:
        disk = Disk(path, partial(spoilt, path), after, earlier)
        return checked(damage, WRITERS[writer], disk)

    undisturbed()  # measured here once, and not by every child
    return on_small_disk(folder, use)


FULL = Family("full disk", attempt_full, trials=30, short=2)
READ_ONLY = Family("read-only", attempt_read_only, trials=30, short=2)
