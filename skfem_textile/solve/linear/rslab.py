"""RSLAB: LDLᵀ factors and inertia of definite and indefinite matrices alike.

The pivots of Bunch & Kaufman (1977) are restricted to dense blocks of columns, which
preserves the sparsity; refinement recovers the accuracy if such a pivot is small.
"""

import os
import sys
from functools import cache
from typing import Any

import numpy as np
from numpy import ndarray
from scipy.sparse import csc_matrix

from .solver import (
    LEAST_OF_ENTRY,
    LEAST_OF_LARGEST,
    REFINEMENTS,
    CountedPivots,
    LatestFactors,
    SingularMatrixError,
)
from .unknowns import Unknowns

# Nested dissection with the quickest settings: graphs of meshes in a plane have small
# separators, which a single trial finds.
_ORDERING: dict[str, Any] = {
    "ordering": "metis",
    "nd_init_trials": 1,
    "nd_fm_passes": 2,
}

# Backward error at which the refinements end, a few units of round-off.
_BACKWARD_ERROR = 1e-15


class Rslab(LatestFactors):
    """LDLᵀ factors and inertia of symmetric, possibly indefinite matrices.

    Parameters
    ----------
    lower, unknowns
        See `Solver`.  RSLAB computes the elimination order from the sparsity pattern
        alone.
    """

    def __init__(self, lower: csc_matrix, unknowns: Unknowns) -> None:
        import rslab  # at the first solve

        _replace_after_fork()
        self._process = os.getpid()
        self._diagonal = lower.indptr[:-1]
        threads = os.environ.get("OMP_NUM_THREADS", "")
        self._analysis = rslab.analyze(
            lower,
            path="ldlt",
            **_ORDERING,
            threads=int(threads) if threads.isdigit() else None,
            preconditioner=LEAST_OF_ENTRY,
        )

    def factorise(self, data: ndarray) -> "RslabFactors":
        """Factors of the matrix with the entries ``data``."""
        return RslabFactors(self, data)

    def ldlt(self, data: ndarray) -> Any:
        """Factors computed by RSLAB, with pivots below round-off counted.

        The unknowns are scaled so that the limit of `refuse_round_off` is
        `LEAST_OF_ENTRY` for every pivot.
        """
        if os.getpid() != self._process:
            raise RuntimeError(
                "RSLAB cannot continue in a forked process: start processes by spawn"
            )
        diagonal = np.abs(data[self._diagonal])
        least = LEAST_OF_LARGEST / LEAST_OF_ENTRY * diagonal.max(initial=0.0)
        size = np.maximum(diagonal, least)
        if not np.all(size > 0):
            raise SingularMatrixError
        return self._analysis.factor(data, scaling=size**-0.5)


class RslabFactors(CountedPivots):
    """See `Factors`."""

    def refactorise(self) -> None:
        """Factors and inertia."""
        self._ldlt = self._solver.ldlt(self._data)
        n_negative = self._ldlt.inertia[1]
        self._negative = None if self._ldlt.n_perturbed else n_negative

    def discard(self) -> None:
        """Free the memory of the factors."""
        del self._ldlt

    def solution(self, b: ndarray) -> ndarray:
        """Solution, refined if A is indefinite."""
        refinements = REFINEMENTS if self._negative else 0
        return self._ldlt.solve(b, refine=refinements, target=_BACKWARD_ERROR)


@cache
def _replace_after_fork() -> None:
    """Let forked processes use SuperLU: threads of RSLAB do not survive a fork.

    RSLAB would wait for them forever.
    """
    if hasattr(os, "register_at_fork"):
        os.register_at_fork(after_in_child=_hide)


def _hide() -> None:
    """Make RSLAB fail to import in this process."""
    sys.modules["rslab"] = None  # type: ignore[assignment]
