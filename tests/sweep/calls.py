"""Functions that worker processes call; importing them takes little time."""

import logging
import os
import signal
import time
from pathlib import Path


def wait_until(condition, seconds=60):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it does not come to pass"
        time.sleep(0.01)


def square(x):
    return x * x


def dies_once(case):
    """Case 1 kills its process the first time, while case 0 runs."""
    folder, n = case
    with open(Path(folder, f"runs of {n}"), "a") as file:
        file.write(".")
    died = Path(folder, "died")
    if n == 1 and not died.exists():
        wait_until(Path(folder, "runs of 0").exists)
        died.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    if n == 0:
        wait_until(died.exists)
    return n


def fails_once(file):
    if not Path(file).exists():
        Path(file).touch()
        raise OSError("busy")
    return "done"


def fails_with_result(n):
    """A failing load step whose result holds a function, which cannot be pickled."""
    from numpy import empty

    from skfem_textile import StepError

    if n == 1:
        raise StepError("stopped at load factor 0.5", lambda: 0, empty(0))
    return n


def warns(n):
    """Log a warning of the package and one of other code; return it as formatted."""
    records: list[logging.LogRecord] = []
    handler = logging.Handler()
    handler.emit = records.append
    logging.getLogger().addHandler(handler)
    try:
        logging.getLogger("skfem_textile.solve.stepper").warning("share %d %%", n)
        logging.getLogger("other").warning("share %d", n)
    finally:
        logging.getLogger().removeHandler(handler)
    return [x.getMessage() for x in records]


def threads(_):
    from threadpoolctl import threadpool_info

    return [library["num_threads"] for library in threadpool_info()]


def threads_of_rslab(_):
    """Threads of a linear solver that the call builds."""
    from scipy.sparse import identity

    from skfem_textile.solve.linear import SOLVERS

    lower = identity(2, format="csc")
    return SOLVERS["rslab"].build(lower, None).n_threads


def takes_long(file):
    Path(file).touch()
    time.sleep(20)
    Path(f"{file} ended").touch()


def threads_of_pardiso(_):
    """Threads of a library that the call itself loads."""
    from pypardiso import PyPardisoSolver
    from threadpoolctl import threadpool_info

    PyPardisoSolver()
    return [x["num_threads"] for x in threadpool_info() if x["internal_api"] == "mkl"]
