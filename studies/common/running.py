"""Execution of the cases of a study: processes and logging."""

import logging
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from typing import Any

from skfem_textile.solve.result import Result, StepError
from skfem_textile.solve.stepper import LoadStepper
from skfem_textile.solve.tolerance import ToleranceStepper
from skfem_textile.sweep import ThisThread, WorkerProcesses

#: Environment variables that limit linear-algebra libraries to one thread.
ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"
)

_LOG = logging.getLogger("skfem_textile")


def executor_of(workers: int) -> Executor:
    """Executor in this process for one worker, in worker processes for several."""
    return ThisThread() if workers == 1 else WorkerProcesses(workers)


def in_new_process(function: Callable[..., Any], *arguments: Any) -> Any:
    """The result of a function, called in a new process."""
    with WorkerProcesses(1) as workers:
        return workers.submit(function, *arguments).result()


def run(stepper: LoadStepper | ToleranceStepper) -> tuple[Result, str]:
    """The result up to the last state, and the error message; empty on success."""
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
    """Collect the texts of warnings and errors in a list instead of logging them."""
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
