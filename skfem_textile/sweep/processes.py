"""Worker processes that die alone."""

import os
import signal
import traceback
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from multiprocessing import get_context, parent_process
from multiprocessing.connection import Connection
from pickle import dumps, loads
from queue import SimpleQueue
from threading import Lock, Thread
from typing import Any

# A fork would share the threads and locks of whatever the caller has loaded.
_CONTEXT = get_context("spawn")


class Processes(Executor):
    """Worker processes of which one that dies takes only its own call with it.

    That call raises `BrokenExecutor`, and a new process takes the place of the old
    one: of a `ProcessPoolExecutor` all calls would be lost.  A ``with`` block that ends
    with an error, Ctrl-C among them, ends the processes at once.  A script must have
    its ``if __name__ == "__main__"``.

    Parameters
    ----------
    n
        How many.
    """

    def __init__(self, n: int) -> None:
        self._threads = ThreadPoolExecutor(n)  # each waits for a process
        self._workers = [_Worker() for _ in range(n)]
        self._idle: SimpleQueue[_Worker] = SimpleQueue()
        for worker in self._workers:
            self._idle.put(worker)

    def submit(
        self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any
    ) -> Future[Any]:
        """Call a function in a process that is free."""
        return self._threads.submit(self._run, partial(fn, *args, **kwargs))

    def _run(self, call: Callable[[], Any]) -> Any:
        worker = self._idle.get()
        try:
            return worker.run(call)
        finally:
            self._idle.put(worker)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Take no more calls; wait for those there are, or cancel them."""
        self._threads.shutdown(wait, cancel_futures=cancel_futures)
        if wait:
            for worker in self._workers:
                worker.end()

    def __exit__(self, error: type[BaseException] | None, *_: object) -> None:
        if error is not None:
            self._threads.shutdown(wait=False, cancel_futures=True)
            for worker in self._workers:
                worker.kill()
        self.shutdown()


class _Worker:
    """A process that runs one call at a time, started when there is one."""

    def __init__(self) -> None:
        self._lock, self._killed = Lock(), False
        self._process: Any = None

    def run(self, call: Callable[[], Any]) -> Any:
        """Run a call in the process."""
        message = dumps(call)
        if self._process is None:
            self._start()
        try:
            self._pipe.send_bytes(message)
            error, found = loads(self._pipe.recv_bytes())
        except (EOFError, OSError):
            code = self.end()
            raise BrokenExecutor(f"its process ended with exit code {code}") from None
        if error is not None:
            raise error
        return found

    def _start(self) -> None:
        with self._lock:
            if self._killed:
                raise BrokenExecutor("the processes were ended")
            self._pipe, theirs = _CONTEXT.Pipe()
            process = _CONTEXT.Process(target=_serve, args=(theirs,), daemon=True)
            with _deaf():
                process.start()
            self._process = process
            theirs.close()

    def end(self) -> int | None:
        """Let the process end; returns its exit code."""
        with self._lock:
            if self._process is None:
                return None
            self._pipe.close()
            self._process.join()
            code, self._process = self._process.exitcode, None
            return code

    def kill(self) -> None:
        """End the process at once, and start no other."""
        with self._lock:
            self._killed = True
            if self._process is not None:
                self._process.kill()


@contextmanager
def _deaf() -> Iterator[None]:
    """Let a process that is started here not hear Ctrl-C: it is the caller's."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    from multiprocessing.resource_tracker import ensure_running

    ensure_running()  # the first start would, and undo the block
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _serve(pipe: Connection) -> None:
    """Run calls until there are no more, or the caller is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the caller's to answer
    Thread(target=_end_with_caller, daemon=True).start()
    while True:
        try:
            message = pipe.recv_bytes()
        except EOFError:
            return
        pipe.send_bytes(_answer(message))


def _answer(message: bytes) -> bytes:
    """The error and the result of a call, pickled."""
    try:
        return dumps((None, loads(message)()))
    except Exception as error:
        error.add_note(traceback.format_exc())
        return dumps((portable(error), None))


def portable(error: Exception) -> Exception:
    """The error, or its text where it cannot be pickled."""
    try:
        loads(dumps(error))
    except Exception:
        return RuntimeError(f"{type(error).__name__} {error}")
    return error


def _end_with_caller() -> None:
    caller = parent_process()
    if caller is not None:
        caller.join()
        os._exit(1)
