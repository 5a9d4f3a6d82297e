"""Files of arrays and text with a seal, and locks for one writer at a time.

A seal is the last line of a file: run, name, and a digest of the content, of the rest
of the seal and of the digest of the file before it in a series.  A file that was edited
disagrees with the others even if it is given a new digest.
"""

import io
import json
import os
import re
import sys
from collections.abc import Mapping
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple
from weakref import WeakSet

import numpy as np
from numpy import ndarray

if sys.platform != "win32":
    import fcntl

_SEAL = re.compile(r"([0-9a-f]{32}) (run|state_[0-9]{6,}) ([0-9a-f]{64})")


class Content(NamedTuple):
    """Text and arrays of a file, and its seal."""

    text: dict[str, Any]
    arrays: dict[str, ndarray]
    run: str
    digest: str


def write(
    path: Path,
    run: str,
    name: str,
    before: str,
    text: Mapping[str, Any],
    arrays: Mapping[str, ndarray],
) -> str:
    """Write a file, which is on the disk when the function returns; its digest.

    ``run`` has 32 hexadecimal digits, ``name`` is the file's name in the run, and
    ``before`` the digest of the file before it, empty for the first.  ``text`` is what
    JSON can hold.
    """
    buffer = io.BytesIO()
    np.savez(buffer, text=np.array(json.dumps(text)), **arrays)  # type: ignore[arg-type]
    digest = _digest(before, run, name, buffer.getvalue())
    try:
        with open(path, "wb") as file:
            file.write(buffer.getvalue())
            file.write(f"\n{run} {name} {digest}".encode())
            file.flush()
            os.fsync(file.fileno())
    except OSError:  # half a file must not take the room of results on a full disk
        with suppress(OSError):
            path.unlink()
        raise
    return digest


def read(path: Path, run: str, before: str) -> Content:
    """Read a file; an empty ``run`` stands for any.

    A ValueError says that it is damaged, not of the run, or not what it was called or
    came after.
    """
    if path.exists() and not path.is_file():  # a pipe or device would never end
        raise ValueError("is no file")
    body, _, seal = path.read_bytes().rpartition(b"\n")
    if not (match := _SEAL.fullmatch(seal.decode(errors="replace"))):
        raise ValueError("is damaged: its last line is no seal")
    its_run, name, its_digest = match.groups()
    if run and its_run != run:
        raise ValueError("is of another run")
    if name != path.stem:
        raise ValueError(f"is {name}{path.suffix} under another name")
    if (digest := _digest(before, its_run, name, body)) != its_digest:
        raise ValueError("is damaged: it, or a file before it, has changed")
    try:
        with np.load(io.BytesIO(body), allow_pickle=False) as content:
            arrays = dict(content)
        return Content(json.loads(str(arrays.pop("text"))), arrays, its_run, digest)
    except Exception as error:  # numpy and zipfile may raise anything
        raise ValueError(f"is damaged: {str(error).partition(chr(10))[0]}") from None


def _digest(before: str, run: str, name: str, body: bytes) -> str:
    return sha256(f"{before} {run} {name} ".encode() + body).hexdigest()


class Lock:
    """A lock on a file or folder that is there, until it is released.

    The system keeps it with the open file (``flock``), and lifts it however the process
    ends: a run that was killed leaves no lock behind, which a file with the number of
    its process would be.  Where the system has no such lock (Windows, some network
    drives) there is none.  A BlockingIOError says that another run, or another part of
    this one, holds it.
    """

    _descriptor = -1  # also of a lock that was interrupted as it was made

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
                f"another run is writing to {path}: wait for it, or name another place"
            ) from None
        except OSError:  # no such lock on this drive
            self.release()

    @property
    def is_held(self) -> bool:
        """Whether nobody else can hold it: not where the system has no such lock."""
        return self._descriptor >= 0

    def release(self) -> None:
        """Lift the lock; again if it is lifted, to no effect."""
        descriptor, self._descriptor = self._descriptor, -1
        if descriptor >= 0:
            os.close(descriptor)

    __del__ = release


_HELD: WeakSet[Lock] = WeakSet()


def _release_all() -> None:
    for lock in list(_HELD):
        lock.release()


if sys.platform != "win32":  # a forked process leaves the locks to its parent
    os.register_at_fork(after_in_child=_release_all)
