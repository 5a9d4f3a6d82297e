"""One writer at a time for a file or a folder."""

import os
import sys
from pathlib import Path
from weakref import WeakSet

if sys.platform != "win32":
    import fcntl


class Lock:
    """A lock on a file or folder that is there, until it is released.

    The system keeps it with the open file (``flock``), and lifts it however the process
    ends: a run that was killed leaves no lock behind, which a file with the number of
    its process would be.  Where the system has no such lock (Windows, some network
    drives) there is none.

    Parameters
    ----------
    path
        The file or folder.

    Raises
    ------
    BlockingIOError
        If another run, or another part of this one, holds it.
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


def _leave_to_parent() -> None:
    """Close the locks that a forked process shares: they are its parent's."""
    for lock in list(_HELD):
        lock.release()


if sys.platform != "win32":
    os.register_at_fork(after_in_child=_leave_to_parent)
