"""Functions that worker processes of the tests of sweeps can import."""

import os
import signal
import time
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_info

from skfem_textile import StepError


def square(x):
    return x * x


def wait_for(file):
    while not Path(file).exists():
        time.sleep(0.01)


def dies_once(case):
    """Case 1 kills its process the first time; case 0 runs as it does so."""
    folder, n = case
    with open(Path(folder, f"runs of {n}"), "a") as file:
        file.write(".")
    died = Path(folder, "died")
    if n == 1 and not died.exists():
        wait_for(Path(folder, "runs of 0"))
        died.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    if n == 0:
        wait_for(died)
    return n


def fails_once(file):
    if not Path(file).exists():
        Path(file).touch()
        raise OSError("busy")
    return "done"


def dies(n):
    if n == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    return n


def refuses(n):
    """A load step that fails holds a result, which nothing can pickle."""
    if n == 1:
        raise StepError("stopped at load factor 0.5", lambda: 0, np.empty(0))
    return n


def threads(_):
    return [library["num_threads"] for library in threadpool_info()]


def takes_long(file):
    Path(file).touch()
    time.sleep(20)
    Path(f"{file} ended").touch()


def threads_of_pardiso(_):
    """Threads of a library that the call itself loads."""
    from pypardiso import PyPardisoSolver

    PyPardisoSolver()
    return [x["num_threads"] for x in threadpool_info() if x["internal_api"] == "mkl"]
