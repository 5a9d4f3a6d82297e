"""Functions for tests of several processes, importable by worker processes."""

import hashlib
import json
import logging
import multiprocessing
import os
import signal
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
from scipy.sparse import identity
from threadpoolctl import threadpool_info

from skfem_textile import StepError
from skfem_textile.solve.linear import SOLVERS

# Functions for tests of several processes


def is_alive(pid):
    try:
        return "zombie" not in Path(f"/proc/{pid}/status").read_text()
    except (FileNotFoundError, ProcessLookupError):
        return False


def wait_until(condition, seconds=60):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it does not come to pass"
        time.sleep(0.01)


# Functions for tests of sweeps, importable by worker processes


def process_pool(n):
    return ProcessPoolExecutor(n, multiprocessing.get_context("spawn"))


def lines(out):
    """Cases and results on file; every line ends with the digest of its content."""
    entries = []
    for line in out.read_bytes().splitlines():
        entry = json.loads(line)
        digest = hashlib.sha256(line[:-18]).hexdigest()[:16]
        assert entry.pop("digest") == digest
        assert line[-18:] == f'{digest}"}}'.encode()
        entries.append(entry)
    return entries


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
    if n == 1:
        raise StepError("stopped at load factor 0.5", lambda: 0, np.empty(0))
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
    return [library["num_threads"] for library in threadpool_info()]


def threads_of_rslab(_):
    """Threads of a linear solver that the call builds."""
    lower = identity(2, format="csc")
    return SOLVERS["rslab"].build(lower, None).n_threads


def takes_long(file):
    Path(file).touch()
    time.sleep(20)
    Path(f"{file} ended").touch()


def threads_of_pardiso(_):
    """Threads of a library that the call itself loads."""
    from pypardiso import PyPardisoSolver

    PyPardisoSolver()
    return [x["num_threads"] for x in threadpool_info() if x["internal_api"] == "mkl"]
