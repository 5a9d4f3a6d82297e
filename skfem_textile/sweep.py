"""Parameter studies: evaluate a function for many cases, on any executor.

Results are yielded as they complete, and appended to a file if one is named.  A case is
repeated if it fails or its worker dies.
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
from contextvars import ContextVar
from dataclasses import dataclass, field
from multiprocessing import get_context, parent_process
from multiprocessing.connection import Connection
from pathlib import Path
from queue import SimpleQueue
from threading import Thread
from typing import Any, Generic, TypeVar
from zlib import crc32

from .mesh.requirements import require
from .mesh.user_input import error_text
from .solve import solver_threads
from .solve.checksummed import Lock

Case = TypeVar("Case")
Result = TypeVar("Result")

log = logging.getLogger(__name__)

# Maximum number of cases submitted at a time.  Chosen: more than the likely number of
# workers of a cluster, and few enough to hold in memory.
_MAX_PENDING = 4096

_THREADS = "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"

# Name of the case of the current call; empty outside of calls.
_case: ContextVar[str] = ContextVar("case", default="")

# Exit code of a script that Ctrl-C ends, as of shells.
_INTERRUPTED = 130

# Beginning of every line, and the names of its entries in order.
_LINE_START = b'{"case": '
_ENTRIES = ["case", "found", "checksum"]

# Maximum number of lines, or of cases, listed in a message.
_LISTED = 5

_FOREIGN = "{} was not written by a sweep: remove it, or specify another file"

# A fork would share threads and locks of libraries loaded by the caller.
_SPAWN = get_context("spawn")


class SweepError(RuntimeError):
    """Some cases of a sweep failed; the results of the others are kept.

    Attributes
    ----------
    failed
        Failed cases, each with its last error.
    """

    def __init__(self, message: str, failed: list[tuple[Any, Exception]]) -> None:
        super().__init__(message)
        self.failed = failed


class SweepInterrupted(KeyboardInterrupt, SystemExit):
    """Ctrl-C during a sweep.

    A script that does not catch it ends with exit code 130 and without a traceback.
    """

    def __init__(self) -> None:
        super().__init__(_INTERRUPTED)
        self.code = _INTERRUPTED


def sweep(
    function: Callable[[Case], Result],
    cases: Iterable[Case],
    executor: Executor,
    *,
    out: str | os.PathLike[str] | None = None,
    key: Callable[[Case], str] = repr,
    retries: int = 1,
) -> Iterator[tuple[Case, Result]]:
    """Yield every case with the result of the function, as soon as it completes.

    Messages of the package during a call begin with the name of the case.  Linear
    algebra uses one thread in each call, and in the caller until the end, so
    that calls do not compete for processors.  At most 4096 cases are taken from
    ``cases`` ahead of their results.

    Parameters
    ----------
    function
        Function of a case.  With processes, it and the cases must be picklable.
    cases
        The cases; their number is unlimited.
    executor
        `WorkerProcesses`, `ThisThread`, the executor of a dask client, or any other
        executor.
    out
        File to which every result is appended at once, as a line of JSON with its
        checksum.  Cases in the file are skipped, so that an interrupted sweep resumes.
        Damaged lines are ignored, and a warning lists them.  Results are yielded as
        decoded from JSON: numbers, text, lists and dicts.
    key
        Function that names a case in ``out`` and in messages, the same in every run.
    retries
        Number of repetitions of a failed case.

    Raises
    ------
    SweepError
        At the end, if cases failed.  If the executor itself breaks, no further case is
        started.
    ValueError
        If ``out`` was not written by a sweep, or two cases have the same name.
    BlockingIOError
        If another sweep writes to ``out``.
    OSError
        If a result cannot be written, as on a full disk.  The content of ``out`` is
        kept.
    TypeError
        If a result cannot be written as JSON.
    SweepInterrupted
        On Ctrl-C.  Results that were computed are in ``out``.
    """
    require("a sweep", "sweep", "threadpoolctl")
    from threadpoolctl import threadpool_limits

    file = None if out is None else ResultsFile(Path(out))
    calls = _Calls(function, executor, key, retries, file)
    # Workers load the libraries before their first call: too late for variables such as
    # OMP_NUM_THREADS, but not for threadpoolctl.  If the workers are threads of this
    # process, only the caller can lift the limit.
    results_file = closing(file) if file else nullcontext()
    with threadpool_limits(1), results_file, closing(calls):
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
    """File with one line of JSON per completed case, each with a checksum.

    The file is locked.  It is modified only if it is new or contains a line written by
    a sweep.  ``path`` is its path, ``earlier`` are the results of an earlier sweep, by
    case name.
    """

    def __init__(self, path: Path) -> None:
        self.path, self._names = path, set[str]()
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
        """Read the results; a warning lists the ignored lines."""
        content = self.path.read_bytes()
        *lines, unfinished = content.split(b"\n")
        entries = [_entry(line) for line in lines]
        if content and not any(entries):
            raise ValueError(_FOREIGN.format(self.path))
        if _LINE_START.startswith(unfinished[: len(_LINE_START)]):
            # A sweep was killed while writing; a complete last line is kept.
            os.truncate(self.path, len(content) - len(unfinished))
        else:
            with open(self.path, "ab") as file:
                file.write(b"\n")
        if unfinished:
            entries.append(None)
        # Differing results of one case are ignored.
        count = Counter(case for case, _ in set(filter(None, entries)))
        used = {i: e for i, e in enumerate(entries, 1) if e and count[e[0]] == 1}
        unused = [str(i) for i in range(1, len(entries) + 1) if i not in used]
        if unused:
            log.warning(
                "%s: line(s) %s are damaged or contradict each other: their cases are "
                "run again",
                self.path,
                _shortened(unused, ", "),
            )
        return {case: json.loads(result) for case, result in used.values()}

    def check_name(self, name: str) -> str:
        """Name of a case; refused if another case has it or it differs between runs."""
        if name in self._names:
            raise ValueError(
                f"two cases have the name {name}: pass a key that distinguishes them"
            )
        if " at 0x" in name:
            raise ValueError(
                f"the name of a case, {name}, contains a memory address: pass a key "
                "that returns the same name in every run"
            )
        self._names.add(name)
        return name

    def add(self, name: str, result: Any) -> Any:
        """Write a result; returns the value that a later sweep reads.

        Raises an OSError if it cannot be written and a TypeError if it is not
        serialisable.
        """
        result_text = json.dumps(result, ensure_ascii=False, default=_as_json)
        name_text = json.dumps(name, ensure_ascii=False)
        start = f'{{"case": {name_text}, "found": {result_text}, "checksum": "'.encode()
        try:
            with open(self.path, "ab") as file:
                file.write(start + _checksum(start) + b'"}\n')
        except OSError as error:
            raise OSError(
                f"cannot write results to {self.path}: {error.strerror or error}; "
                "its content is kept; repeat the sweep with this file to resume it"
            ) from None
        return json.loads(result_text)


def _entry(line: bytes) -> tuple[str, str] | None:
    """Name and result, as JSON, of a line; None if it was not written by a sweep."""
    start, checksum, end = line[:-10], line[-10:-2], line[-2:]
    if end != b'"}' or checksum != _checksum(start):
        return None
    try:
        entry = json.loads(line)
    except (ValueError, RecursionError):
        return None
    if not isinstance(entry, dict) or list(entry) != _ENTRIES:
        return None
    name = entry["case"]
    return (name, json.dumps(entry["found"])) if isinstance(name, str) else None


def _checksum(start: bytes) -> bytes:
    return f"{crc32(start):08x}".encode()


def _as_json(array: Any) -> Any:
    """Convert NumPy arrays and numbers to Python lists and numbers."""
    try:
        return array.tolist()
    except AttributeError:
        raise TypeError(
            f"a sweep cannot write a {type(array).__name__} to a file: return numbers, "
            "text, lists or dicts"
        ) from None


def _shortened(items: list[str], separator: str) -> str:
    """First items on one line, and the number of the others."""
    more = [f"and {len(items) - _LISTED} more"] if items[_LISTED:] else []
    return separator.join(items[:_LISTED] + more)


@dataclass
class _Calls(Generic[Case, Result]):
    """Pending calls of an executor, and the cases that failed in every attempt."""

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
        """Submit a case to the executor."""
        try:
            call, name = self.function, self.key(case)
            future = self.executor.submit(_call, call, case, name, attempt)
        except BrokenExecutor as error:
            self.is_broken = True
            self.failed.append((case, error))
        else:
            self.pending[future] = case, attempt
            future.add_done_callback(self.done.put)

    def results(self, max_pending: int) -> Iterator[tuple[Case, Result]]:
        """Yield results until at most ``max_pending`` calls are pending."""
        while len(self.pending) > max_pending or not self.done.empty():
            future = self._next()
            case, attempt = self.pending[future]
            try:
                result = future.result()
            except Exception as error:
                del self.pending[future]
                if attempt == self.retries or self.is_broken:
                    self.failed.append((case, error))
                else:
                    text = error_text(error)
                    log.warning("%s: %s; the case is run again", self.key(case), text)
                    self.submit(case, attempt + 1)
            else:
                if self.file:
                    result = self.file.add(self.key(case), result)
                del self.pending[future]
                yield case, result

    def _next(self) -> Future[Result]:
        """Wait for the next completed call."""
        try:
            return self.done.get()
        except KeyboardInterrupt:
            kept = f"kept in {self.file.path}" if self.file else "lost unless yielded"
            log.warning("interrupted: results of completed cases are %s", kept)
            raise SweepInterrupted from None

    def error(self) -> SweepError:
        """Error that lists the failed cases on one line."""
        listed = [f"{self.key(case)}: {error_text(e)}" for case, e in self.failed]
        message = f"{len(listed)} case(s) failed: {_shortened(listed, '; ')}"
        if self.is_broken:
            message += (
                f"; {type(self.executor).__name__} is broken because a worker process "
                "died: use skfem_textile.sweep.WorkerProcesses, which replaces "
                "dead workers, and repeat the sweep with the same file to resume it"
            )
        return SweepError(message, self.failed)

    def close(self) -> None:
        """Cancel the calls that have not started, and write remaining results."""
        for future, (case, _) in self.pending.items():
            completed = not future.cancel() and future.done()
            if self.file and completed and future.exception() is None:
                self.file.add(self.key(case), future.result())


def _call(
    function: Callable[[Case], Result], case: Case, name: str, attempt: int
) -> Result:
    """Call the function with a case.

    The number of the attempt makes each call unique: for an equal call dask would
    return the error of the first.  A worker keeps the limit of one thread, because no
    call can determine when the last one ends.  An exception that cannot be pickled,
    because it holds a function of the user, would break some executors and is replaced.
    """
    from threadpoolctl import threadpool_limits

    threadpool_limits(1)
    _name_messages()
    before, threads_before = _case.set(name), solver_threads.set(1)
    if parent_process() is not None:  # for libraries loaded later
        os.environ.update(dict.fromkeys(_THREADS, "1"))
    try:
        return function(case)
    except Exception as error:
        try:
            pickle.loads(pickle.dumps(error))
        except Exception:
            raise RuntimeError(error_text(error)) from error
        raise
    finally:
        _case.reset(before)
        solver_threads.reset(threads_before)


def _name_messages() -> None:
    """Let messages of the package during calls begin with the name of their case."""
    make = logging.getLogRecordFactory()
    if getattr(make, "names_cases", False):
        return

    def named(*args: Any, **kwargs: Any) -> logging.LogRecord:
        record, case = make(*args, **kwargs), _case.get()
        if case and record.name.startswith("skfem_textile"):
            record.msg, record.args = f"{case}: {record.getMessage()}", ()
        return record

    named.names_cases = True  # type: ignore[attr-defined]
    logging.setLogRecordFactory(named)


class ThisThread(Executor):
    """Executor that calls functions at once, in the thread of the caller."""

    def submit(
        self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any
    ) -> Future[Any]:
        """Call a function; returns a completed future."""
        future: Future[Any] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


class WorkerProcesses(ThreadPoolExecutor):
    """Executor with threads that delegate their calls to pools of one process each.

    If a process dies, its call fails with `BrokenExecutor`, and a new process replaces
    it.  A ``with`` block that ends with an error ends the processes at once.  The
    processes ignore Ctrl-C, which the caller handles, and end when the caller dies.
    Scripts need ``if __name__ == "__main__"``.

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
            pool.shutdown()  # waits for the end of the process
            pool = self._new_pool()
            raise
        finally:
            self._idle_pools.put(pool)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Accept no more calls; wait for the pending ones, or cancel them."""
        super().shutdown(wait, cancel_futures=cancel_futures)
        while wait and not self._idle_pools.empty():
            self._idle_pools.get().shutdown()

    def __exit__(self, error: type[BaseException] | None, *_: object) -> None:
        if error is not None:
            self.shutdown(wait=False, cancel_futures=True)
            self._caller_end.close()
        self.shutdown()


def _block_interrupts() -> None:
    """Block Ctrl-C in processes started by this thread, from their first import on."""
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])


def _prepare_worker(worker_end: Connection) -> None:
    """Ignore Ctrl-C, and end when the caller closes its end of the pipe or dies."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    Thread(target=_end_with_caller, args=(worker_end,), daemon=True).start()


def _end_with_caller(worker_end: Connection) -> None:
    worker_end.poll(None)
    os._exit(1)
