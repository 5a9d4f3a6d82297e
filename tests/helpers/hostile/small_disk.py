"""A small disk for a child process; it is removed when the process ends."""

import ctypes
import os
import pickle
import traceback
from pathlib import Path

from tests.helpers.hostile import RIGHT, end_with_parent

#: Size of the disk in bytes, and of a block of it.
SIZE, BLOCK = 2**20, 4096

# Flags of unshare and mount on Linux.
_CLONE_NEWNS = 0x00020000
_MS_RDONLY, _MS_REMOUNT, _MS_REC, _MS_PRIVATE = 1, 32, 0x4000, 1 << 18


def on_small_disk(act):
    """Let a child process act on a disk of 1 MB that no other process sees.

    Exceptions of the child are raised here; `RIGHT` if no disk can be mounted.
    """
    disk = Path("disk").absolute()
    disk.mkdir()
    parent, (read_end, write_end) = os.getpid(), os.pipe()
    if not (child := os.fork()):
        error = None
        try:
            end_with_parent(parent)
            if _mount_privately(disk):
                act(disk)
        except AssertionError as wrong:
            error = wrong
        except BaseException:
            error = RuntimeError(traceback.format_exc())
        os.write(write_end, pickle.dumps(error))
        os._exit(0)
    os.close(write_end)
    with open(read_end, "rb") as pipe:
        pickled = pipe.read()
    _, status = os.waitpid(child, 0)
    if not pickled:
        raise ChildProcessError(f"the child died: {status}")
    if error := pickle.loads(pickled):
        raise error
    return RIGHT


def _mount_privately(disk):
    """Mount a disk that only this process and its children see, if permitted."""
    try:
        if ctypes.CDLL(None, use_errno=True).unshare(_CLONE_NEWNS):
            return False
        _mount("none", Path("/"), "", _MS_REC | _MS_PRIVATE, "")
        _mount("tmpfs", disk, "tmpfs", 0, f"size={SIZE}")
    except (OSError, AttributeError):  # not allowed, or not Linux
        return False
    return True


def make_read_only(disk, read_only=True):
    """Make the disk read-only, or writable again.

    Raises
    ------
    OSError
        If a file is being written.
    """
    flags = _MS_REMOUNT | (_MS_RDONLY if read_only else 0)
    _mount("tmpfs", disk, "tmpfs", flags, "")


def _mount(source, target, kind, flags, data):
    words = [word.encode() for word in (source, str(target), kind)]
    library = ctypes.CDLL(None, use_errno=True)
    if library.mount(*words, ctypes.c_ulong(flags), data.encode()):
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number), str(target))


def fill(disk, free):
    """Fill the disk with a file, except for some free bytes; returns the file."""
    ballast, room = disk / "ballast", os.statvfs(disk)
    ballast.write_bytes(bytes(max(0, room.f_bavail * room.f_frsize - free)))
    return ballast
