"""CHOLMOD through cvxopt, which is licensed under the GPL and always optional."""

from collections.abc import Callable
from threading import Lock
from typing import Any

import numpy as np
from numpy import ndarray
from scipy.sparse import csc_matrix

from .scaling import SingularMatrixError, refuse_round_off
from .solver import CountedPivots, LatestFactors
from .unknowns import Unknowns

# Value of the option ``supernodal`` for factors LLᵀ.
_SUPERNODAL = 2

# The options of cvxopt apply to the whole process.
_LOCK = Lock()


class Cholmod(LatestFactors):
    """Cholesky factors, which prove stability; there are none of other matrices.

    Parameters
    ----------
    lower, unknowns
        See `Solver`.
    """

    def __init__(self, lower: csc_matrix, unknowns: Unknowns) -> None:
        import cvxopt.cholmod  # at the first solve

        self._cvxopt, n = cvxopt, lower.shape[0]
        col = np.repeat(np.arange(n), np.diff(lower.indptr))
        rows, cols, order = (
            cvxopt.matrix(x.astype(np.int64), tc="i")
            for x in (lower.indices, col, unknowns.order)
        )
        self._A = cvxopt.spmatrix(0.0, rows, cols, (n, n))
        self._factors = self._call(cvxopt.cholmod.symbolic, self._A, order)

    def factorised(self, data: ndarray) -> tuple[int | None, None]:
        """Cholesky factors, if they exist; they remain in the library."""
        cholmod = self._cvxopt.cholmod
        self._A.V = self._cvxopt.matrix(data)
        try:
            self._call(cholmod.numeric, self._A, self._factors)
            refuse_round_off(np.array(cholmod.diag(self._factors)) ** 2)
        except (ArithmeticError, SingularMatrixError):
            return None, None
        return 0, None

    def solution(self, of: CountedPivots, b: ndarray) -> ndarray:
        """Solution of A x = b."""
        x = self._cvxopt.matrix(b)
        self._cvxopt.cholmod.solve(self._factors, x)
        return np.array(x).ravel()

    def _call(self, function: Callable, *args: Any) -> Any:
        """Call a factorisation function of cvxopt for factors LLᵀ."""
        options = self._cvxopt.cholmod.options
        with _LOCK:
            before = dict(options)
            options["supernodal"] = _SUPERNODAL
            try:
                return function(*args)
            finally:
                options.clear()
                options.update(before)
