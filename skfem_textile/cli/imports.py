"""Imports of the command line without garbage collection.

Modules stay until the process ends, so that searching them for garbage, during imports
and later, is in vain: it takes a tenth of the time of a short run.
"""

import gc
from collections.abc import Iterator
from contextlib import contextmanager

from .interruption import is_command


@contextmanager
def uncollected() -> Iterator[None]:
    """Import modules in a block, and exempt them from later collections.

    Does nothing in a process other than the command line.
    """
    if not is_command():
        yield
        return
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.enable()
