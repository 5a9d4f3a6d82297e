"""A small disk for a child process; it is removed when the process ends."""

import ctypes
import os
import pickle
from collections.abc import Callable
from pathlib import Path

from ..trial import RIGHT, Finding, surprised
from ..workers import end_with_parent

#: Size of the disk in bytes, and of a block of it.
SIZE, BLOCK = 2**20, 4096

# Flags of unshare and mount on Linux.
_CLONE_NEWNS = 0x00020000
_MS_RDONLY, _MS_REMOUNT, _MS_REC, _MS_PRIVATE = 1, 32, 0x4000, 1 << 18

#: Damage of a trial on a system where a disk cannot be mounted.
NOT_HERE = "not possible here"


def on_small_disk(folder: Path, act: Callable[[Path], Finding]) -> Finding:
    """The finding of a child process with a disk of 1 MB that no other process sees."""

    def mounted() -> Finding:
        try:
            _mount_own(disk)
        except (OSError, AttributeError):  # not allowed, or not Linux
            return Finding(RIGHT, NOT_HERE)
        return act(disk)

    disk = folder / "disk"
    disk.mkdir()
    return _in_child(mounted)


def _in_child(act: Callable[[], Finding]) -> Finding:
    """The finding of a forked child.

    Raises
    ------
    ChildProcessError
        If it ends without one.
    """
    parent, (read_end, write_end) = os.getpid(), os.pipe()
    if not (child := os.fork()):
        try:
            end_with_parent(parent)
            finding = act()
        except BaseException as error:
            finding = surprised("", error)
        os.write(write_end, pickle.dumps(finding))
        os._exit(0)
    os.close(write_end)
    with open(read_end, "rb") as pipe:
        pickled = pipe.read()
    _, status = os.waitpid(child, 0)
    if not pickled:
        raise ChildProcessError(f"a child of the trial died: {status}")
    return pickle.loads(pickled)


def _mount_own(disk: Path) -> None:
    """Mount a disk that only this process and its children see."""
    if ctypes.CDLL(None, use_errno=True).unshare(_CLONE_NEWNS):
        raise OSError(ctypes.get_errno(), "unshare")
    _mount("none", Path("/"), "", _MS_REC | _MS_PRIVATE, "")
    _mount("tmpfs", disk, "tmpfs", 0, f"size={SIZE}")


def make_read_only(disk: Path, read_only: bool = True) -> None:
    """Make the disk read-only, or writable again.

    Raises
    ------
    OSError
        If a file is being written.
    """
    flags = _MS_REMOUNT | (_MS_RDONLY if read_only else 0)
    _mount("tmpfs", disk, "tmpfs", flags, "")


def _mount(source: str, target: Path, kind: str, flags: int, data: str) -> None:
    words = [word.encode() for word in (source, str(target), kind)]
    library = ctypes.CDLL(None, use_errno=True)
    if library.mount(*words, ctypes.c_ulong(flags), data.encode()):
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number), str(target))


def fill(disk: Path, free: int) -> Path:
    """Fill the disk with a file, up to some free bytes; returns the file."""
    ballast = disk / "ballast"
    room = os.statvfs(disk)
    with open(ballast, "wb") as file:
        file.write(bytes(max(0, room.f_bavail * room.f_frsize - free)))
    return ballast
