"""MKL PARDISO through pypardiso."""

import os
from weakref import finalize

import numpy as np
from numpy import ndarray
from scipy.sparse import csc_matrix, csr_matrix

from .scaling import ROUND_OFF
from .solver import REFINEMENTS, CountedPivots, LatestFactors
from .unknowns import Unknowns

# Matrix types and phases as numbered in its manual.
_SYMMETRIC_INDEFINITE = -2
_ANALYSE, _FACTORISE, _SOLVE = 11, 22, 33

# Entries of its parameter array, counted from 1 as in its manual.  Second line: decimal
# exponent of the smallest pivot, numbers of smaller pivots and of negative ones, and a
# switch for pivots of Bunch & Kaufman.
_OWN_PARAMETERS, _ORDER_GIVEN, _REFINEMENTS = 1, 5, 8
_SMALLEST_PIVOT, _SMALLER, _NEGATIVE, _BUNCH_KAUFMAN = 10, 14, 23, 21

# Error number for a zero pivot.
_ZERO_PIVOT = -4


class Pardiso(LatestFactors):
    """LDLᵀ factors for possibly indefinite matrices, with the inertia.

    Parameters
    ----------
    lower, unknowns
        See `Solver`.
    """

    def __init__(self, lower: csc_matrix, unknowns: Unknowns) -> None:
        from pypardiso import PyPardisoSolver  # at the first solve

        # The lower triangle in CSC is the upper one in CSR.
        upper = np.ones(lower.nnz), lower.indices, lower.indptr
        self._A = csr_matrix(upper, lower.shape)
        self._pardiso = solver = PyPardisoSolver(mtype=_SYMMETRIC_INDEFINITE)
        solver.perm = (1 + unknowns.order).astype(np.int32)
        solver.set_iparm(_OWN_PARAMETERS, 1)
        solver.set_iparm(_ORDER_GIVEN, 1)
        solver.set_iparm(_SMALLEST_PIVOT, round(-np.log10(ROUND_OFF)))
        solver.set_iparm(_BUNCH_KAUFMAN, 1)
        # The next solvers need not search the environment for the library again.
        os.environ.setdefault("PYPARDISO_MKL_RT", solver.libmkl._name)
        finalize(self, solver.free_memory, everything=True)
        self._call(_ANALYSE)

    def factorised(self, data: ndarray) -> tuple[int | None, None]:
        """Inertia; the factors remain in the library."""
        from pypardiso.pardiso_wrapper import PyPardisoError

        try:
            self._call(_FACTORISE, data)
        except PyPardisoError as error:
            if error.value != _ZERO_PIVOT:
                raise
            return None, None
        parameter = self._pardiso.get_iparm
        return None if parameter(_SMALLER) else int(parameter(_NEGATIVE)), None

    def solution(self, of: CountedPivots, b: ndarray) -> ndarray:
        """Solution, refined if A is indefinite."""
        self._pardiso.set_iparm(_REFINEMENTS, REFINEMENTS if of.negative else 0)
        return self._call(_SOLVE, of.data, b)

    def _call(
        self, phase: int, data: ndarray | None = None, b: ndarray | None = None
    ) -> ndarray:
        """One phase of the solver."""
        if data is not None:
            self._A.data = data
        if not self._A.nnz:
            return np.empty(0)
        self._pardiso.set_phase(phase)
        none = np.zeros(self._A.shape[0])
        return self._pardiso._call_pardiso(self._A, none if b is None else b)
