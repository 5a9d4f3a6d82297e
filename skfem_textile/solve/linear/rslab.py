"""RSLAB: LDLᵀ factors and inertia of definite and indefinite matrices alike.

The pivots of Bunch & Kaufman (1977) are restricted to dense blocks of columns, which
preserves the sparsity; refinement recovers the accuracy if such a pivot is small.
"""

import os
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from threading import current_thread, main_thread
from typing import Any

import numpy as np
from numpy import ndarray
from scipy.sparse import csc_matrix

from ...mesh.pattern import with_data
from ...solve import solver_threads
from .scaling import ROUND_OFF
from .solver import FORKED, HIDDEN, REFINEMENTS, CountedPivots, LatestFactors
from .unknowns import Unknowns

# Approximate minimum fill leaves up to a quarter fewer entries in the factors of meshes
# than minimum degree; nested dissection takes four times as long.
_ORDERING = "amf"

# Backward error at which the refinements end, a few units of round-off.
_BACKWARD_ERROR = 1e-15


class Rslab(LatestFactors):
    """LDLᵀ factors and inertia of symmetric, possibly indefinite matrices.

    Parameters
    ----------
    lower, unknowns
        See `Solver`.  RSLAB computes the elimination order from the sparsity pattern
        alone.

    Attributes
    ----------
    n_threads
        Number of threads, from the environment at most the number of cores; None for
        the number that RSLAB selects, at most four.
    """

    def __init__(self, lower: csc_matrix, unknowns: Unknowns) -> None:
        import rslab  # at the first solve

        _replace_after_fork()
        self._process = os.getpid()
        self.n_threads = _threads()
        self._analysis = _on_lasting_thread(
            rslab.analyze,
            with_data(lower, np.ones(lower.nnz)),
            path="ldlt",
            ordering=_ORDERING,
            scaling="identity",
            threads=self.n_threads,
            preconditioner=ROUND_OFF,
        )

    def factorised(self, data: ndarray) -> tuple[int | None, Any]:
        """Inertia and factors; pivots below round-off are counted."""
        self._refuse_fork()
        ldlt = _on_lasting_thread(self._analysis.factor, data)
        return None if ldlt.n_perturbed else ldlt.inertia[1], ldlt

    def solution(self, of: CountedPivots, b: ndarray) -> ndarray:
        """Solution, refined if A is indefinite."""
        self._refuse_fork()
        refinements = REFINEMENTS if of.negative else 0
        options = {"refine": refinements, "target": _BACKWARD_ERROR}
        return _on_lasting_thread(of.factors.solve, b, **options)

    def _refuse_fork(self) -> None:
        """Raise an error in a forked process: RSLAB would wait for its threads."""
        if os.getpid() != self._process:
            raise RuntimeError(FORKED)


def _threads() -> int | None:
    """Number of threads; None if it is not given as a positive whole number."""
    if number := solver_threads.get():
        return number
    # The first number of a list applies to the outermost level of OpenMP.
    text = os.environ.get("OMP_NUM_THREADS", "").partition(",")[0].strip()
    number = int(text) if text.isdecimal() else 0
    if number > 1:  # the number of cores is read from files
        number = min(number, os.cpu_count() or 1)
    return number or None


def _on_lasting_thread(call: Callable, *args: Any, **options: Any) -> Any:
    """Result of a call of RSLAB on a thread that lasts as long as the process.

    A process crashes if RSLAB is called after a thread that called it has ended: other
    threads than the main one share a thread that does not end.
    """
    if current_thread() is main_thread():
        return call(*args, **options)
    return _lasting_thread().submit(call, *args, **options).result()


@cache
def _lasting_thread() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(1, thread_name_prefix="rslab")


@cache
def _replace_after_fork() -> None:
    """Let forked processes use SuperLU: threads of RSLAB do not survive a fork.

    RSLAB would wait for them forever.
    """
    if hasattr(os, "register_at_fork"):
        os.register_at_fork(after_in_child=_hide)


def _hide() -> None:
    """Make RSLAB fail to import in this process."""
    HIDDEN.add("rslab")
    sys.modules["rslab"] = None  # type: ignore[assignment]
