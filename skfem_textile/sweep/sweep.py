"""Parameter studies: a function of many cases, on any executor.

Results are told as they come, and kept on file if one is named.  A case whose worker
dies, or that fails, is run again; the others are none the worse.
"""

import logging
import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future
from contextlib import closing, nullcontext
from multiprocessing import parent_process
from pathlib import Path
from queue import SimpleQueue
from typing import Any, Generic, TypeVar

from .kept import Kept
from .processes import portable

Case = TypeVar("Case")
Found = TypeVar("Found")

log = logging.getLogger(__name__)

# Cases that an executor has at a time: more than it has workers, few enough to hold.
_AT_ONCE = 4096

_THREADS = "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"

# How many failed cases a message names.
_NAMED = 5


class SweepError(RuntimeError):
    """A sweep that lacks cases; what it found before is not lost.

    Attributes
    ----------
    failed
        Cases that failed, each with its last error.
    """

    def __init__(
        self, message: str, failed: list[tuple[Any, Exception]] | None = None
    ) -> None:
        super().__init__(message)
        self.failed = failed or []


def sweep(
    function: Callable[[Case], Found],
    cases: Iterable[Case],
    executor: Executor,
    *,
    out: str | os.PathLike[str] | None = None,
    key: Callable[[Case], str] = repr,
    retries: int = 1,
) -> Iterator[tuple[Case, Found]]:
    """Every case with what the function finds of it, as they come.

    Every call has one thread of linear algebra, and so has the caller until the end, so
    that they do not fight for the processors.  No more than some thousand cases are
    taken from ``cases`` ahead of their results.

    Parameters
    ----------
    function
        Function of a case.  On processes it and the cases must be picklable.
    cases
        The cases, as many as one likes.
    executor
        `Processes`, the executor of a dask client, or any other one.
    out
        File to which every result is appended as it comes, as a line of JSON with a
        digest.  Cases that it holds are not run again, so that a sweep goes on where it
        was interrupted; lines that were changed are told and not taken for results.
        What is told is then what JSON makes of a result: numbers, text, lists and
        dicts.
    key
        Name of a case in ``out`` and in messages, the same in every run.
    retries
        How often a case that fails is run again.

    Raises
    ------
    SweepError
        At the end, if cases have failed; earlier, if the executor breaks as a whole.
    ValueError
        If ``out`` is no file of a sweep, or two of its cases have one name.
    BlockingIOError
        If another sweep writes to ``out``.
    OutputError
        If a result cannot be written, as on a full disk; what ``out`` holds remains.
    TypeError
        If JSON cannot say what is to be kept.
    """
    from threadpoolctl import threadpool_limits

    kept = None if out is None else Kept(Path(out))
    run = _Run(function, executor, key, retries, kept)
    # Workers load the libraries before they are told what to do, and variables such as
    # OMP_NUM_THREADS would come too late: hence threadpoolctl.  Where the workers are
    # threads of this process, the limit is the caller's to set and to lift.
    on_file = nullcontext() if kept is None else closing(kept)
    with threadpool_limits(1), closing(run), on_file:
        try:
            for case in cases:
                if kept is not None and kept.begin(name := key(case)):
                    yield case, kept.found.pop(name)
                else:
                    run.start(case)
                    yield from run.results(_AT_ONCE - 1)
            yield from run.results(0)
        except BrokenExecutor as error:
            yield from run.rest()
            raise SweepError(
                f"{type(executor).__name__} broke with one of its workers: take "
                "skfem_textile.sweep.Processes, which replaces a worker that dies"
            ) from error
    if failed := run.failed:
        some = "; ".join(f"{key(case)}: {_said(e)}" for case, e in failed[:_NAMED])
        more = f"; and {len(failed) - _NAMED} more" if len(failed) > _NAMED else ""
        raise SweepError(f"{len(failed)} case(s) failed: {some}{more}", failed)


class _Run(Generic[Case, Found]):
    """The cases that an executor has, and those that have failed for good."""

    def __init__(
        self,
        function: Callable[[Case], Found],
        executor: Executor,
        key: Callable[[Case], str],
        retries: int,
        kept: Kept | None,
    ) -> None:
        self._function, self._executor, self._key = function, executor, key
        self._retries, self._kept = retries, kept
        self._running: dict[Future[Found], tuple[Case, int]] = {}
        self._ended: SimpleQueue[Future[Found]] = SimpleQueue()
        self.failed: list[tuple[Case, Exception]] = []

    def start(self, case: Case, attempt: int = 0) -> None:
        """Give a case to the executor."""
        future = self._executor.submit(_alone, self._function, case, attempt)
        self._running[future] = case, attempt
        future.add_done_callback(self._ended.put)

    def results(self, still: int) -> Iterator[tuple[Case, Found]]:
        """What has come, and what comes until no more than so many cases run."""
        while len(self._running) > still or not self._ended.empty():
            future = self._ended.get()
            case, attempt = self._running.pop(future)
            try:
                found = future.result()
            except Exception as error:
                if attempt == self._retries:
                    self.failed.append((case, error))
                else:
                    log.warning("%s: %s; run again", self._key(case), _said(error))
                    self.start(case, attempt + 1)
            else:
                yield self._told(case, found)

    def rest(self) -> Iterator[tuple[Case, Found]]:
        """What came before the executor broke."""
        for future, (case, _) in self._running.items():
            if future.done() and not (future.cancelled() or future.exception()):
                yield self._told(case, future.result())

    def close(self) -> None:
        """Take back the cases that have not begun."""
        for future in self._running:
            future.cancel()

    def _told(self, case: Case, found: Found) -> tuple[Case, Found]:
        if self._kept is not None:
            found = self._kept.add(self._key(case), found)
        return case, found


def _said(error: Exception) -> str:
    """An error on one line."""
    return f"{type(error).__name__} {error}".strip().partition("\n")[0]


def _alone(function: Callable[[Case], Found], case: Case, attempt: int) -> Found:
    """Call the function; of equal attempts dask would take the first's error for all.

    A worker keeps to one thread: with several at work, none can tell when to lift that.
    An error that cannot be pickled, such as `StepError`, would break some executors.
    """
    from threadpoolctl import threadpool_limits

    threadpool_limits(1)
    if parent_process() is not None:  # for libraries that the call loads
        os.environ.update(dict.fromkeys(_THREADS, "1"))
    try:
        return function(case)
    except Exception as error:
        if (told := portable(error)) is not error:
            raise told from error
        raise
