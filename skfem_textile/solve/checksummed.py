"""Checksummed files of arrays and text, and locks for a single writer.

An ``.npz`` file contains a CRC-32 checksum of each array.  The text is one of the
arrays, and contains the names of the others.
"""

import io
import json
import os
import sys
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple
from weakref import WeakSet

import numpy as np
from numpy import ndarray

if sys.platform != "win32":
    import fcntl


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

    ``run`` is the name of the run, and ``name`` the name of the file in it.  ``text``
    must be serialisable as JSON.
    """
    content = json.dumps([run, name, [*arrays], text])
    buffer = io.BytesIO()
    np.savez(buffer, text=np.array(content), **arrays)  # type: ignore[arg-type]
    try:
        with open(path, "wb") as file:
            file.write(buffer.getvalue())
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
    file = io.BytesIO(path.read_bytes())
    try:
        with np.load(file, allow_pickle=False) as content:
            arrays = dict(content)
        stated = json.loads(str(arrays.pop("text")))
        is_earlier = isinstance(stated, dict)
        its_run, name, names, text = ("", "", [], {}) if is_earlier else stated
    except Exception as error:  # numpy and zipfile may raise anything
        raise ValueError(f"is damaged: {str(error).partition(chr(10))[0]}") from None
    if is_earlier:
        raise ValueError("was written by an earlier version: use another folder")
    if [*arrays] != names:
        raise ValueError("is damaged: some of its arrays are missing")
    if run and its_run != run:
        raise ValueError("belongs to another run")
    if name != path.stem:
        raise ValueError(f"was renamed from {name}{path.suffix}")
    return Content(text, arrays, its_run)


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
