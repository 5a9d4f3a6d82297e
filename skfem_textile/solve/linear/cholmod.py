"""CHOLMOD through cvxopt, which is licensed under the GPL and always optional."""

from collections.abc import Callable
from functools import cached_property
from threading import Lock
from typing import Any

import numpy as np
from numpy import ndarray
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import SuperLU as Decomposition

from .solver import OneAtATime, SingularMatrixError, refuse_round_off

# Values of the option ``supernodal`` for the kinds of factors LLᵀ and LDLᵀ.
_SUPERNODAL, _SIMPLICIAL = 2, 0

# Arguments of ``solve`` for systems with a part of the factors: D x = b, and x = P b
# with the pivot order P.
_DIAGONAL, _PERMUTED = 6, 7

# The options of cvxopt apply to the whole process.
_LOCK = Lock()


class Cholmod(OneAtATime):
    """Cholesky factors, which prove stability, or LDLᵀ for the inertia.

    Parameters
    ----------
    lower
        See `Solver`.
    """

    def __init__(self, lower: csc_matrix) -> None:
        import cvxopt.cholmod  # at the first solve

        self.lower, self.cvxopt, n = lower, cvxopt, lower.shape[0]
        col = np.repeat(np.arange(n), np.diff(lower.indptr))
        rows, cols, self._order = (
            cvxopt.matrix(x.astype(np.int64), tc="i")
            for x in (lower.indices, col, np.arange(n))
        )
        self.A = cvxopt.spmatrix(0.0, rows, cols, (n, n))
        self.factors = self.of_kind(
            _SUPERNODAL, cvxopt.cholmod.symbolic, self.A, self._order
        )

    def factorise(self, data: ndarray) -> "CholmodFactors":
        """Factors of the matrix with the entries ``data``."""
        return CholmodFactors(self, data)

    @cached_property
    def simplicial(self) -> Any:
        """Symbolic factorisation for LDLᵀ."""
        symbolic = self.cvxopt.cholmod.symbolic
        return self.of_kind(_SIMPLICIAL, symbolic, self.A, self._order)

    def of_kind(self, kind: int, function: Callable, *args: Any) -> Any:
        """Call a factorisation function of cvxopt for a kind of factors."""
        options = self.cvxopt.cholmod.options
        with _LOCK:
            before = dict(options)
            options["supernodal"] = kind
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
            solver.of_kind(_SUPERNODAL, cholmod.numeric, solver.A, solver.factors)
            root = np.array(cholmod.diag(solver.factors)).ravel()
            self._refuse_round_off(solver.factors, root**2)
        except (ArithmeticError, SingularMatrixError):
            self.definite = False

    @cached_property
    def negative_pivots(self) -> int:
        """Number of negative entries of D."""
        if self.definite:
            return 0
        self.factorisations += 1
        solver, cholmod = self._solver, self._cvxopt.cholmod
        solver.A.V = self._cvxopt.matrix(self._data)
        try:
            solver.of_kind(_SIMPLICIAL, cholmod.numeric, solver.A, solver.simplicial)
        except ArithmeticError:
            raise SingularMatrixError from None
        reciprocal = self._cvxopt.matrix(1.0, (solver.lower.shape[0], 1))
        cholmod.solve(solver.simplicial, reciprocal, sys=_DIAGONAL)
        pivots = 1.0 / np.array(reciprocal).ravel()
        self._refuse_round_off(solver.simplicial, np.abs(pivots))
        return int(np.sum(pivots < 0))

    def solve(self, b: ndarray) -> ndarray:
        """Solve A x = b."""
        if not self.definite:
            return self._pivoted.solve(b)
        self._solver.hold(self)
        x = self._cvxopt.matrix(b)
        self._cvxopt.cholmod.solve(self._solver.factors, x)
        return np.array(x).ravel()

    @cached_property
    def _pivoted(self) -> Decomposition:
        """Fallback without Cholesky factors: LDLᵀ here does not pivot."""
        self.factorisations += 1
        return self._solver.superlu.pivoted(self._data)

    def _refuse_round_off(self, factors: Any, pivots: ndarray) -> None:
        diagonal = self._cvxopt.matrix(self._data[self._solver.lower.indptr[:-1]])
        self._cvxopt.cholmod.solve(factors, diagonal, sys=_PERMUTED)
        refuse_round_off(pivots, np.array(diagonal).ravel())
