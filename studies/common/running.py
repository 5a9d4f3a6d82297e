"""Runs of the cases of a study: processes, and the log of the library."""

import logging
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from typing import Any

from skfem_textile.solve.adaptive import AdaptiveStepper
from skfem_textile.solve.result import Result, StepError
from skfem_textile.solve.stepper import LoadStepper
from skfem_textile.solve.sweep import WorkerProcesses

#: Variables that give libraries of linear algebra one thread.
ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"
)

_LOG = logging.getLogger("skfem_textile")


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


def run(stepper: LoadStepper | AdaptiveStepper) -> tuple[Result, str]:
    """The result as far as a run goes, and why it stopped early; empty if not."""
    try:
        return stepper.run(), ""
    except StepError as error:
        return error.result, str(error)


@contextmanager
def errors_only() -> Iterator[None]:
    """Log errors only."""
    level = _LOG.level
    _LOG.setLevel(logging.ERROR)
    try:
        yield
    finally:
        _LOG.setLevel(level)


@contextmanager
def warnings_collected() -> Iterator[list[str]]:
    """Collect the texts of warnings and errors in a list, and log none of them."""
    texts = list[str]()
    collector, propagate = logging.Handler(logging.WARNING), _LOG.propagate
    collector.emit = lambda record: texts.append(record.getMessage())  # type: ignore[method-assign]
    _LOG.addHandler(collector)
    _LOG.propagate = False
    try:
        yield texts
    finally:
        _LOG.propagate = propagate
        _LOG.removeHandler(collector)
