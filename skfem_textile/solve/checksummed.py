"""Checksummed files of arrays and text, and locks for a single writer.

The last line of a file contains its run, its name, and a CRC-32 checksum of the rest.
"""

import io
import json
import os
import re
import sys
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple
from weakref import WeakSet
from zlib import crc32

import numpy as np
from numpy import ndarray

if sys.platform != "win32":
    import fcntl

# Last line of a file.  Up to version 0.3 its checksum had 64 digits.
_LAST_LINE = re.compile(
    r"([0-9a-f]{32} (?:run|state_[0-9]{6,})) ([0-9a-f]{8}|[0-9a-f]{64})"
)


class Content(NamedTuple):
    """Text and arrays of a file, and its run."""

    text: dict[str, Any]
    arrays: dict[str, ndarray]
    run: str


def write(
    path: Path,
    run: str,
    name: str,
    text: Mapping[str, Any],
    arrays: Mapping[str, ndarray],
) -> None:
    """Write a file to disk, synchronously.

    ``run`` has 32 hexadecimal digits, and ``name`` is the name of the file in the run.
    ``text`` must be serialisable as JSON.
    """
    buffer = io.BytesIO()
    np.savez(buffer, text=np.array(json.dumps(text)), **arrays)  # type: ignore[arg-type]
    buffer.write(f"\n{run} {name}".encode())
    checksum = _checksum(buffer.getvalue())
    try:
        with open(path, "wb") as file:
            file.write(buffer.getvalue())
            file.write(f" {checksum}".encode())
            file.flush()
            os.fsync(file.fileno())
    except OSError:  # an incomplete file must not occupy space on a full disk
        with suppress(OSError):
            path.unlink()
        raise


def read(path: Path, run: str) -> Content:
    """Read a file; an empty ``run`` matches any run.

    Raises a ValueError if the file is damaged, belongs to another run, has another name
    or was written by version 0.3 or earlier.
    """
    if path.exists() and not path.is_file():  # a pipe or device may never end
        raise ValueError("is not a file")
    body, _, last = path.read_bytes().rpartition(b"\n")
    if not (match := _LAST_LINE.fullmatch(last.decode(errors="replace"))):
        raise ValueError("is damaged: its last line is not a checksum")
    origin, checksum = match.groups()
    if len(checksum) == 64:
        raise ValueError("was written by an earlier version: use another folder")
    its_run, name = origin.split()
    if run and its_run != run:
        raise ValueError("belongs to another run")
    if name != path.stem:
        raise ValueError(f"was renamed from {name}{path.suffix}")
    if checksum != _checksum(body + b"\n" + origin.encode()):
        raise ValueError("is damaged: its content does not match its checksum")
    try:
        with np.load(io.BytesIO(body), allow_pickle=False) as content:
            arrays = dict(content)
        return Content(json.loads(str(arrays.pop("text"))), arrays, its_run)
    except Exception as error:  # numpy and zipfile may raise anything
        raise ValueError(f"is damaged: {str(error).partition(chr(10))[0]}") from None


def _checksum(content: bytes) -> str:
    return f"{crc32(content):08x}"


class Lock:
    """Lock on an existing file or folder, held until it is released.

    The lock belongs to the open file (``flock``), so that the system releases it when
    the process ends, even if it is killed.  On Windows and some network drives, which
    do not support such locks, nothing is locked.  Raises a BlockingIOError if another
    run, or another part of this one, holds the lock.
    """

    _descriptor = -1  # also of a lock whose creation was interrupted

    def __init__(self, path: Path) -> None:
        if sys.platform == "win32":
            return
        self._descriptor = os.open(path, os.O_RDONLY)
        _HELD.add(self)
        try:
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            self.release()
            raise BlockingIOError(
                f"another run is writing to {path}: wait for it to end, or specify "
                "another path"
            ) from None
        except OSError:  # no such lock on this drive
            self.release()

    @property
    def is_held(self) -> bool:
        """True if no other process can hold the lock; False without system locks."""
        return self._descriptor >= 0

    def release(self) -> None:
        """Release the lock; has no effect the second time."""
        descriptor, self._descriptor = self._descriptor, -1
        if descriptor >= 0:
            os.close(descriptor)

    __del__ = release


_HELD: WeakSet[Lock] = WeakSet()


def _release_all() -> None:
    for lock in list(_HELD):
        lock.release()


if sys.platform != "win32":  # a forked process must not release the locks of its parent
    os.register_at_fork(after_in_child=_release_all)
