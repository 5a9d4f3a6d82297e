"""Forked workers that try seeds one by one, with a time limit each."""

import contextlib
import ctypes
import os
import resource
import shutil
import signal
import sys
import tempfile
from collections.abc import Iterator, Sequence
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from pathlib import Path
from time import monotonic
from typing import NamedTuple

from .trial import DIED, HANG, Family, Finding, surprised

#: Memory that a worker may take, in bytes: bad input must not take the machine's.
MEMORY = 6 * 2**30

# Trials of one process: what they leave in memory goes with it.
_TRIES = 300

_FORK = get_context("fork")

# Of Linux' prctl: the signal that a process gets when its parent is no more.
_PR_SET_PDEATHSIG = 1


class Tried(NamedTuple):
    """A seed of a family, and what came of it."""

    family: str
    seed: int
    finding: Finding


def findings(family: Family, seeds: Sequence[int], workers: int) -> Iterator[Tried]:
    """Try the seeds of a family; in no order."""
    todo = list(reversed(seeds))
    busy = [_Worker(family) for _ in range(min(workers, len(todo)))]
    for worker in busy:
        worker.give(todo.pop())
    try:
        while busy:
            due = min(worker.due for worker in busy)
            wait([w.pipe for w in busy], timeout=max(0.0, due - monotonic()))
            for worker in list(busy):
                if (finding := worker.answer()) is None:
                    continue
                yield Tried(family.name, worker.seed, finding)
                if todo:
                    worker.give(todo.pop())
                else:
                    worker.end()
                    busy.remove(worker)
    finally:
        for worker in busy:
            worker.end()


class _Worker:
    """A forked process; a new one takes its place when it hangs or dies."""

    def __init__(self, family: Family) -> None:
        self._family = family
        self._start()

    def _start(self) -> None:
        self.pipe, theirs = _FORK.Pipe()
        self._tried = 0
        self._process = _FORK.Process(
            target=_serve, args=(self._family, theirs, os.getpid()), daemon=True
        )
        self._process.start()
        theirs.close()

    def give(self, seed: int) -> None:
        """Let the process try a seed; a fresh one, if it has tried many."""
        if self._tried == _TRIES:
            self.end()
            self._start()
        self._tried += 1
        self.seed, self.due = seed, monotonic() + self._family.seconds
        self.pipe.send(seed)

    def answer(self) -> Finding | None:
        """What came of the seed; None while the process is at it."""
        if self.pipe.poll():
            with contextlib.suppress(EOFError, OSError):
                return self.pipe.recv()
            outcome = DIED
        elif monotonic() >= self.due:
            outcome = HANG
        else:
            return None
        self.end()
        finding = Finding(outcome, "", f"exit code {self._process.exitcode}")
        self._start()
        return finding

    def end(self) -> None:
        """End the process, and what it has started."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.kill()
        self._process.join()
        self.pipe.close()


def end_with_parent(parent: int) -> None:
    """Let this process be killed when its parent is, as far as the system can."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:  # it is no more
        os._exit(1)


def _serve(family: Family, pipe: Connection, parent: int) -> None:
    """Try seeds until the process is ended, or the suite is."""
    end_with_parent(parent)
    os.setpgid(0, 0)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    with contextlib.suppress(EOFError):
        while True:
            pipe.send(_tried(family, pipe.recv()))


def _tried(family: Family, seed: int) -> Finding:
    """What came of one seed, tried in a folder of its own that is then removed."""
    folder = Path(tempfile.mkdtemp(prefix="hostile-"))
    os.chdir(folder)
    try:
        return family.attempt(seed, folder)
    except BaseException as error:  # whatever comes out of the library is a finding
        return surprised("", error)
    finally:
        os.chdir("/")
        shutil.rmtree(folder, ignore_errors=True)
