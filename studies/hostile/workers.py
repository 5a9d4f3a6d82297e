"""Forked workers that run trials one by one, with a time limit each."""

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

#: Memory that a worker may take, in bytes: damaged counts may ask for any size.
MEMORY = 6 * 2**30

# Trials of one process.  Then a new one starts, which frees the memory of the old one.
_TRIALS_PER_PROCESS = 300

_FORK = get_context("fork")

# Option of prctl on Linux: the signal that a process gets when its parent ends.
_PR_SET_PDEATHSIG = 1


class Tried(NamedTuple):
    """A seed of a family, and the finding of its trial."""

    family: str
    seed: int
    finding: Finding


def try_seeds(family: Family, seeds: Sequence[int], workers: int) -> Iterator[Tried]:
    """Run the trials of these seeds of a family; they end in no order."""
    remaining = list(reversed(seeds))
    busy = [_Worker(family) for _ in range(min(workers, len(remaining)))]
    for worker in busy:
        worker.give(remaining.pop())
    try:
        while busy:
            deadline = min(worker.deadline for worker in busy)
            pipes = [worker.pipe for worker in busy]
            wait(pipes, timeout=max(0.0, deadline - monotonic()))
            for worker in list(busy):
                if (finding := worker.answer()) is None:
                    continue
                yield Tried(family.name, worker.seed, finding)
                if remaining:
                    worker.give(remaining.pop())
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
        self.pipe, pipe_of_process = _FORK.Pipe()
        self._trials = 0
        arguments = self._family, pipe_of_process, os.getpid()
        self._process = _FORK.Process(target=_serve, args=arguments, daemon=True)
        self._process.start()
        pipe_of_process.close()

    def give(self, seed: int) -> None:
        """Let the process try a seed; first replace it if it has tried many."""
        if self._trials == _TRIALS_PER_PROCESS:
            self.end()
            self._start()
        self._trials += 1
        self.seed, self.deadline = seed, monotonic() + self._family.seconds
        self.pipe.send(seed)

    def answer(self) -> Finding | None:
        """The finding of the trial; None while it runs."""
        if self.pipe.poll():
            with contextlib.suppress(EOFError, OSError):
                return self.pipe.recv()
            outcome = DIED
        elif monotonic() >= self.deadline:
            outcome = HANG
        else:
            return None
        self.end()
        finding = Finding(outcome, "", f"exit code {self._process.exitcode}")
        self._start()
        return finding

    def end(self) -> None:
        """End the process, and those that it has started."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.kill()
        self._process.join()
        self.pipe.close()


def end_with_parent(parent: int) -> None:
    """Let Linux kill this process when its parent ends."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:  # it has ended already
        os._exit(1)


def _serve(family: Family, pipe: Connection, parent: int) -> None:
    """Try seeds until the suite ends this process or ends itself."""
    end_with_parent(parent)
    os.setpgid(0, 0)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    with contextlib.suppress(EOFError):
        while True:
            pipe.send(_tried(family, pipe.recv()))


def _tried(family: Family, seed: int) -> Finding:
    """The finding of one trial, which runs in a folder of its own."""
    folder = Path(tempfile.mkdtemp(prefix="hostile-"))
    os.chdir(folder)
    try:
        return family.attempt(seed, folder)
    except BaseException as error:  # every error that the library lets out counts
        return surprised("", error)
    finally:
        os.chdir("/")
        shutil.rmtree(folder, ignore_errors=True)
