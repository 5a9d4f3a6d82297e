"""Worker processes; one that dies fails only its own call."""

import os
import signal
from collections.abc import Callable
from concurrent.futures import (
    BrokenExecutor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
)
from multiprocessing import get_context
from multiprocessing.connection import Connection
from queue import SimpleQueue
from threading import Thread
from typing import Any

# A fork would share threads and locks of the libraries that the caller has loaded.
_SPAWN = get_context("spawn")


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
