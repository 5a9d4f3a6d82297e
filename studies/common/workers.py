"""Executors of the cases of a study."""

from collections.abc import Callable
from concurrent.futures import Executor, Future
from typing import Any

from skfem_textile.solve.sweep import WorkerProcesses


class InProcess(Executor):
    """Calls every function at once, in this process."""

    def submit(
        self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any
    ) -> Future[Any]:
        """Call the function; the future keeps errors, but interruptions are raised."""
        future: Future[Any] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


def executor_of(workers: int) -> Executor:
    """The present process for one worker, and worker processes for more."""
    return InProcess() if workers == 1 else WorkerProcesses(workers)


def in_new_process(function: Callable[..., Any], *arguments: Any) -> Any:
    """The result of a function, called in a new process."""
    with WorkerProcesses(1) as workers:
        return workers.submit(function, *arguments).result()
