"""CHOLMOD through cvxopt, which is licensed under the GPL and always optional."""

from collections.abc import Callable
from functools import cached_property
from threading import Lock
from typing import Any

import numpy as np
from numpy import ndarray
from scipy.sparse import csc_matrix

from .scaling import SingularMatrixError, refuse_round_off
from .solver import Factors, LatestFactors, Solver, pivoting_solver
from .unknowns import Unknowns

# Value of the option ``supernodal`` for factors LLᵀ.
_SUPERNODAL = 2

# The options of cvxopt apply to the whole process.
_LOCK = Lock()


class Cholmod(LatestFactors):
    """Cholesky factors, which prove stability; other matrices need pivots.

    Parameters
    ----------
    lower, unknowns
        See `Solver`.
    """

    def __init__(self, lower: csc_matrix, unknowns: Unknowns) -> None:
        import cvxopt.cholmod  # at the first solve

        self._lower, self._unknowns, self.cvxopt = lower, unknowns, cvxopt
        n = lower.shape[0]
        col = np.repeat(np.arange(n), np.diff(lower.indptr))
        rows, cols, order = (
            cvxopt.matrix(x.astype(np.int64), tc="i")
            for x in (lower.indices, col, unknowns.order)
        )
        self.A = cvxopt.spmatrix(0.0, rows, cols, (n, n))
        self.factors = self.call(cvxopt.cholmod.symbolic, self.A, order)

    def factorise(self, data: ndarray) -> "CholmodFactors":
        """Factors of the matrix with the entries ``data``."""
        return CholmodFactors(self, data)

    @cached_property
    def pivoting(self) -> Solver:
        """Solver for matrices without Cholesky factors; analysed at first use."""
        return pivoting_solver()(self._lower, self._unknowns)

    def call(self, function: Callable, *args: Any) -> Any:
        """Call a factorisation function of cvxopt for factors LLᵀ."""
        options = self.cvxopt.cholmod.options
        with _LOCK:
            before = dict(options)
            options["supernodal"] = _SUPERNODAL
            try:
                return function(*args)
            finally:
                options.clear()
                options.update(before)


class CholmodFactors:
    """See `Factors`."""

    def __init__(self, solver: Cholmod, data: ndarray) -> None:
        self._solver, self._data = solver, data
        self._cvxopt = solver.cvxopt
        self.factorisations = 0
        self.definite = True
        solver.hold(self)

    def refactorise(self) -> None:
        """Cholesky factors, if they exist."""
        solver, cholmod = self._solver, self._cvxopt.cholmod
        solver.A.V = self._cvxopt.matrix(self._data)
        try:
            solver.call(cholmod.numeric, solver.A, solver.factors)
            refuse_round_off(np.array(cholmod.diag(solver.factors)) ** 2)
        except (ArithmeticError, SingularMatrixError):
            self.definite = False

    def discard(self) -> None:
        """Do nothing: the next factors take the place of these."""

    @property
    def negative_pivots(self) -> int | None:
        """Zero for a definite matrix, else by pivots."""
        return 0 if self.definite else self._pivoting.negative_pivots

    def solve(self, b: ndarray) -> ndarray:
        """Solve A x = b."""
        if not self.definite:
            return self._pivoting.solve(b)
        self._solver.hold(self)
        x = self._cvxopt.matrix(b)
        self._cvxopt.cholmod.solve(self._solver.factors, x)
        return np.array(x).ravel()

    @cached_property
    def _pivoting(self) -> Factors:
        self.factorisations += 1
        return self._solver.pivoting.factorise(self._data)
