"""Parameter studies: a function of many cases, on any executor.

Results are yielded as soon as they are known, and kept on file if a file is named.  A
case is run again if it fails or its worker dies.
"""

import json
import logging
import os
import pickle
import signal
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import (
    BrokenExecutor,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
)
from contextlib import closing, nullcontext
from dataclasses import dataclass, field
from hashlib import sha256
from multiprocessing import get_context, parent_process
from multiprocessing.connection import Connection
from pathlib import Path
from queue import SimpleQueue
from threading import Thread
from typing import Any, Generic, TypeVar

from .sealed import Lock

Case = TypeVar("Case")
Result = TypeVar("Result")

log = logging.getLogger(__name__)

# Most cases that an executor has at a time.  Chosen: more than a cluster is likely to
# have workers, and few enough to hold in memory.
_MAX_PENDING = 4096

_THREADS = "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"

# How every line begins, and the names of its entries in order.
_LINE_START = b'{"case": '
_ENTRIES = ["case", "found", "digest"]

# Number of lines, or of cases, that a message lists.
_LISTED = 5

_FOREIGN = "{} is not what a sweep wrote: remove it or name another file"

# A fork would share threads and locks of the libraries that the caller has loaded.
_SPAWN = get_context("spawn")


class SweepError(RuntimeError):
    """Cases of a sweep have failed; the results of the others are not lost.

    Attributes
    ----------
    failed
        Cases that failed, each with its last error.
    """

    def __init__(self, message: str, failed: list[tuple[Any, Exception]]) -> None:
        super().__init__(message)
        self.failed = failed


def sweep(
    function: Callable[[Case], Result],
    cases: Iterable[Case],
    executor: Executor,
    *,
    out: str | os.PathLike[str] | None = None,
    key: Callable[[Case], str] = repr,
    retries: int = 1,
) -> Iterator[tuple[Case, Result]]:
    """Yield every case with the function's result, as soon as it is known.

    Linear algebra uses one thread in each call, and in the caller until the end, so
    that they do not compete for the processors.  At most 4096 cases are taken from
    ``cases`` ahead of their results.

    Parameters
    ----------
    function
        Function of a case.  On processes it and the cases must be picklable.
    cases
        The cases; their number has no limit.
    executor
        `WorkerProcesses`, the executor of a dask client, or any other one.
    out
        File to which every result is appended at once, as a line of JSON with a digest.
        Cases in the file are not run again, so that a sweep resumes where it was
        interrupted.  Lines that were changed are not used, and a warning lists them.
        Results are yielded as JSON reads them back: numbers, text, lists and dicts.
    key
        Name of a case in ``out`` and in messages, the same in every run.
    retries
        Number of times that a case that fails is run again.

    Raises
    ------
    SweepError
        At the end, if cases have failed.  If the executor itself breaks, no further
        case begins.
    ValueError
        If ``out`` is no file of a sweep, or two cases have the same name.
    BlockingIOError
        If another sweep writes to ``out``.
    OSError
        If a result cannot be written, as on a full disk.  What ``out`` holds remains.
    TypeError
        If a result cannot be written as JSON.
    """
    from threadpoolctl import threadpool_limits

    file = None if out is None else ResultsFile(Path(out))
    calls = _Calls(function, executor, key, retries, file)
    # Workers load the libraries before their first call.  Variables such as
    # OMP_NUM_THREADS would come too late, threadpoolctl does not.  If the workers are
    # threads of this process, only the caller knows when to lift the limit.
    with threadpool_limits(1), closing(calls), closing(file) if file else nullcontext():
        for case in cases:
            if file and file.check_name(name := key(case)) in file.earlier:
                yield case, file.earlier.pop(name)
            else:
                calls.submit(case)
                yield from calls.results(_MAX_PENDING - 1)
            if calls.is_broken:
                break
        yield from calls.results(0)
    if calls.failed:
        raise calls.error()


class ResultsFile:
    """A file with a line of JSON for every case that has a result, each with a digest.

    The file is locked.  It is changed only if it is new or holds a line that a sweep
    wrote.  ``earlier`` are the results that an earlier sweep left there, by the names
    of their cases.
    """

    def __init__(self, path: Path) -> None:
        self._path, self._names = path, set[str]()
        if path.exists() and not path.is_file():
            raise ValueError(_FOREIGN.format(path))
        with open(path, "ab"):
            self._lock = Lock(path)
        try:
            self.earlier = self._read()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Release the lock of the file."""
        self._lock.release()

    def _read(self) -> dict[str, Any]:
        """Read the results; a warning lists the lines that are not used."""
        content = self._path.read_bytes()
        *lines, unfinished = content.split(b"\n")
        entries = [_entry(line) for line in lines]
        if content and not any(entries):
            raise ValueError(_FOREIGN.format(self._path))
        if _LINE_START.startswith(unfinished[: len(_LINE_START)]):
            # A sweep died while it wrote; if the last line is whole this cuts nothing.
            os.truncate(self._path, len(content) - len(unfinished))
        else:
            with open(self._path, "ab") as file:
                file.write(b"\n")
        if unfinished:
            entries.append(None)
        # Several results of a case count as none, unless they are equal.
        count = Counter(case for case, _ in set(filter(None, entries)))
        used = {i: e for i, e in enumerate(entries, 1) if e and count[e[0]] == 1}
        unused = [str(i) for i in range(1, len(entries) + 1) if i not in used]
        if unused:
            log.warning(
                "%s: damaged, or at odds with each other, and their cases run again: "
                "line(s) %s",
                self._path,
                _shortened(unused, ", "),
            )
        return {case: json.loads(result) for case, result in used.values()}

    def check_name(self, name: str) -> str:
        """The name; refuses one that another case has, or that changes between runs."""
        if name in self._names:
            raise ValueError(f"two cases are named {name}: give a key that tells them")
        if " at 0x" in name:
            raise ValueError(f"a case is named {name}: give a key that lasts")
        self._names.add(name)
        return name

    def add(self, name: str, result: Any) -> Any:
        """Write a result; return what a later sweep will read.

        An OSError if it cannot be written, a TypeError if JSON cannot hold it.
        """
        result_text = json.dumps(result, ensure_ascii=False, default=_as_json)
        name_text = json.dumps(name, ensure_ascii=False)
        start = f'{{"case": {name_text}, "found": {result_text}, "digest": "'.encode()
        try:
            with open(self._path, "ab") as file:
                file.write(start + _digest(start) + b'"}\n')
        except OSError as error:
            raise OSError(
                f"cannot write results to {self._path}: {error.strerror or error}; "
                "what it holds remains, and a sweep goes on from there"
            ) from None
        return json.loads(result_text)


def _entry(line: bytes) -> tuple[str, str] | None:
    """Name and result, as JSON, of a line; None if no sweep wrote the line."""
    start, digest, end = line[:-18], line[-18:-2], line[-2:]
    if end != b'"}' or digest != _digest(start):
        return None
    try:
        entry = json.loads(line)
    except (ValueError, RecursionError):
        return None
    if not isinstance(entry, dict) or list(entry) != _ENTRIES:
        return None
    name = entry["case"]
    return (name, json.dumps(entry["found"])) if isinstance(name, str) else None


def _digest(start: bytes) -> bytes:
    return sha256(start).hexdigest()[:16].encode()


def _as_json(array: Any) -> Any:
    """Arrays and numbers of numpy as lists and numbers."""
    try:
        return array.tolist()
    except AttributeError:
        raise TypeError(
            f"a sweep cannot write a {type(array).__name__} to a file: return numbers, "
            "text, lists or dicts"
        ) from None


def _shortened(items: list[str], separator: str) -> str:
    """The first items on one line, and the number of the others."""
    more = [f"and {len(items) - _LISTED} more"] if items[_LISTED:] else []
    return separator.join(items[:_LISTED] + more)


@dataclass
class _Calls(Generic[Case, Result]):
    """The pending calls of an executor, and the cases that failed in every attempt."""

    function: Callable[[Case], Result]
    executor: Executor
    key: Callable[[Case], str]
    retries: int
    file: ResultsFile | None
    pending: dict[Future[Result], tuple[Case, int]] = field(default_factory=dict)
    done: SimpleQueue[Future[Result]] = field(default_factory=SimpleQueue)
    failed: list[tuple[Case, Exception]] = field(default_factory=list)
    is_broken: bool = False

    def submit(self, case: Case, attempt: int = 0) -> None:
        """Give a case to the executor."""
        try:
            future = self.executor.submit(_call, self.function, case, attempt)
        except BrokenExecutor as error:
            self.is_broken = True
            self.failed.append((case, error))
        else:
            self.pending[future] = case, attempt
            future.add_done_callback(self.done.put)

    def results(self, max_pending: int) -> Iterator[tuple[Case, Result]]:
        """Yield results until at most ``max_pending`` calls are pending."""
        while len(self.pending) > max_pending or not self.done.empty():
            future = self.done.get()
            case, attempt = self.pending.pop(future)
            try:
                result = future.result()
            except Exception as error:
                if attempt == self.retries or self.is_broken:
                    self.failed.append((case, error))
                else:
                    log.warning("%s: %s; run again", self.key(case), _one_line(error))
                    self.submit(case, attempt + 1)
            else:
                if self.file:
                    result = self.file.add(self.key(case), result)
                yield case, result

    def error(self) -> SweepError:
        """An error that lists the failed cases in one line."""
        listed = [f"{self.key(case)}: {_one_line(e)}" for case, e in self.failed]
        message = f"{len(listed)} case(s) failed: {_shortened(listed, '; ')}"
        if self.is_broken:
            message += (
                f"; {type(self.executor).__name__} broke as a worker died: "
                "skfem_textile.solve.sweep.WorkerProcesses replaces it, and a sweep "
                "into the same file resumes"
            )
        return SweepError(message, self.failed)

    def close(self) -> None:
        """Cancel the calls that have not begun."""
        for future in self.pending:
            future.cancel()


def _one_line(error: Exception) -> str:
    return f"{type(error).__name__} {error}".strip().partition("\n")[0]


def _call(function: Callable[[Case], Result], case: Case, attempt: int) -> Result:
    """Call the function with a case.

    The number of the attempt makes each call different: dask would answer an equal call
    with the error of the first.  A worker keeps the limit of one thread, because no
    call knows when the last one ends.  An error that cannot be pickled, such as
    `StepError`, would break some executors and is replaced.
    """
    from threadpoolctl import threadpool_limits

    threadpool_limits(1)
    if parent_process() is not None:  # for libraries loaded later
        os.environ.update(dict.fromkeys(_THREADS, "1"))
    try:
        return function(case)
    except Exception as error:
        try:
            pickle.loads(pickle.dumps(error))
        except Exception:
            raise RuntimeError(_one_line(error)) from error
        raise


class WorkerProcesses(ThreadPoolExecutor):
    """Threads that pass their calls on to pools of one process each.

    A process that dies fails its own call with `BrokenExecutor`, and another process
    takes its place.  A ``with`` block that ends with an error ends the processes at
    once.  The processes ignore Ctrl-C, which the caller handles, and end when the
    caller dies.  A script that uses them needs ``if __name__ == "__main__"``.

    Parameters
    ----------
    n
        Number of processes.
    """

    def __init__(self, n: int) -> None:
        super().__init__(n, initializer=_block_interrupts)
        self._worker_end, self._caller_end = _SPAWN.Pipe(duplex=False)
        self._idle_pools: SimpleQueue[ProcessPoolExecutor] = SimpleQueue()
        for _ in range(n):
            self._idle_pools.put(self._new_pool())

    def _new_pool(self) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(1, _SPAWN, _prepare_worker, (self._worker_end,))

    def submit(
        self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any
    ) -> Future[Any]:
        """Call a function in an idle process."""
        return super().submit(self._call, fn, *args, **kwargs)

    def _call(self, function: Callable[..., Any], *args: Any, **kwargs: Any) -> Any:
        pool = self._idle_pools.get()
        try:
            return pool.submit(function, *args, **kwargs).result()
        except BrokenExecutor:
            pool.shutdown()  # waits until the process has ended
            pool = self._new_pool()
            raise
        finally:
            self._idle_pools.put(pool)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Take no more calls; wait for the pending ones, or cancel them."""
        super().shutdown(wait, cancel_futures=cancel_futures)
        while wait and not self._idle_pools.empty():
            self._idle_pools.get().shutdown()

    def __exit__(self, error: type[BaseException] | None, *_: object) -> None:
        if error is not None:
            self.shutdown(wait=False, cancel_futures=True)
            self._caller_end.close()
        self.shutdown()


def _block_interrupts() -> None:
    """Block Ctrl-C in processes that this thread starts, from their first import on."""
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])


def _prepare_worker(worker_end: Connection) -> None:
    """Ignore Ctrl-C, and end when the caller closes its end of the pipe or dies."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    Thread(target=_end_with_caller, args=(worker_end,), daemon=True).start()


def _end_with_caller(worker_end: Connection) -> None:
    worker_end.poll(None)
    os._exit(1)
