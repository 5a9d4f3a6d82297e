"""Trials of a full disk and of one that may only be read."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from functools import partial
from pathlib import Path
from random import Random
from time import sleep

from .command_child import undisturbed
from .disk_users import USERS, Disk
from .mechanics import WrongError
from .mounts import BLOCK, fill, make_read_only, on_small_disk
from .trial import RIGHT, SILENT, Family, Finding

_Spoils = Callable[[Path], AbstractContextManager[Callable[[], None]]]

# Blocks that are free at most; a run takes some more.
_MOST_FREE = 30

# Seconds between two tries to let a disk be read only: files are open now and then.
_AGAIN = 1e-4


def attempt_full(seed: int, folder: Path) -> Finding:
    """Use a disk with so little room as the seed says."""
    free = BLOCK * Random(seed).randint(0, _MOST_FREE)

    @contextmanager
    def full(disk: Path) -> Iterator[Callable[[], None]]:
        ballast = fill(disk, free)
        yield lambda: None
        ballast.unlink()

    return _attempt(seed, folder, f"{free} bytes are free", full, 0.0)


def attempt_read_only(seed: int, folder: Path) -> Finding:
    """Use a disk that is read only from a moment on."""
    random = Random(seed)
    after = random.choice([0.0, random.random()])

    @contextmanager
    def protected(disk: Path) -> Iterator[Callable[[], None]]:
        if not after:
            make_read_only(disk)
        yield partial(_insist, disk)
        make_read_only(disk, read_only=False)

    how = f"read only after {after:.3f} of a run"
    return _attempt(seed, folder, how, protected, after)


def _insist(disk: Path) -> None:
    """Make the disk read only as soon as no file is open for writing."""
    while True:
        with suppress(OSError):
            return make_read_only(disk)
        sleep(_AGAIN)


def _attempt(
    seed: int, folder: Path, how: str, spoilt: _Spoils, after: float
) -> Finding:
    user, earlier = list(USERS)[seed % len(USERS)], bool(seed // len(USERS) % 2)
    damage = f"{user}: {how}" + " over an earlier result" * earlier

    def use(path: Path) -> Finding:
        try:
            USERS[user](Disk(path, partial(spoilt, path), after, earlier))
        except WrongError as wrong:
            return Finding(SILENT, damage, str(wrong))
        return Finding(RIGHT, damage)

    undisturbed()  # measured once, not by every child
    return on_small_disk(folder, use)


FULL = Family("full disk", attempt_full, trials=30, short=2)
READ_ONLY = Family("read-only", attempt_read_only, trials=30, short=2)
