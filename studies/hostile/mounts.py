"""A small disk of its own for a child process, which goes with it."""

import ctypes
import os
import pickle
from collections.abc import Callable
from pathlib import Path

from .trial import RIGHT, Finding, surprised
from .workers import end_with_parent

#: Size of the disk in bytes, and of a block of it.
SIZE, BLOCK = 2**20, 4096

_CLONE_NEWNS = 0x00020000
_MS_RDONLY, _MS_REMOUNT, _MS_REC, _MS_PRIVATE = 1, 32, 0x4000, 1 << 18

NOT_HERE = "not possible here"


def on_small_disk(folder: Path, act: Callable[[Path], Finding]) -> Finding:
    """What a child process finds that has a disk of 1 MB which no other one sees."""

    def mounted() -> Finding:
        try:
            _mount_own(disk)
        except (OSError, AttributeError):  # not allowed, or not Linux
            return Finding(RIGHT, NOT_HERE)
        return act(disk)

    disk = folder / "disk"
    disk.mkdir()
    return in_child(mounted)


def in_child(act: Callable[[], Finding]) -> Finding:
    """What a forked child finds; an error of it if it dies."""
    parent, (theirs, ours) = os.getpid(), os.pipe()
    if not (child := os.fork()):
        try:
            end_with_parent(parent)
            finding = act()
        except BaseException as error:
            finding = surprised("", error)
        os.write(ours, pickle.dumps(finding))
        os._exit(0)
    os.close(ours)
    with open(theirs, "rb") as pipe:
        told = pipe.read()
    _, status = os.waitpid(child, 0)
    if not told:
        raise ChildProcessError(f"a child of the trial died: {status}")
    return pickle.loads(told)


def _mount_own(disk: Path) -> None:
    """Leave the mounts of the machine, and mount a disk there."""
    if ctypes.CDLL(None, use_errno=True).unshare(_CLONE_NEWNS):
        raise OSError(ctypes.get_errno(), "unshare")
    _mount("none", Path("/"), "", _MS_REC | _MS_PRIVATE, "")
    _mount("tmpfs", disk, "tmpfs", 0, f"size={SIZE}")


def make_read_only(disk: Path, read_only: bool = True) -> None:
    """Let nobody write to the disk any more, or let them again.

    Raises
    ------
    OSError
        If a file is being written.
    """
    flags = _MS_REMOUNT | (_MS_RDONLY if read_only else 0)
    _mount("tmpfs", disk, "tmpfs", flags, "")


def _mount(source: str, target: Path, kind: str, flags: int, data: str) -> None:
    texts = (source, str(target), kind)
    words = [text.encode() for text in texts]
    library = ctypes.CDLL(None, use_errno=True)
    if library.mount(*words, ctypes.c_ulong(flags), data.encode()):
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number), str(target))


def fill(disk: Path, free: int) -> Path:
    """Fill the disk but for some bytes, with a file that is returned."""
    ballast = disk / "ballast"
    there = os.statvfs(disk)
    with open(ballast, "wb") as file:
        file.write(bytes(max(0, there.f_bavail * there.f_frsize - free)))
    return ballast
