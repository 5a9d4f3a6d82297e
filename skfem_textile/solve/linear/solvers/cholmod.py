"""CHOLMOD through cvxopt, which is under the GPL and never required."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache, cached_property
from threading import Lock
from typing import Any

import numpy as np
from numpy import ndarray
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import SuperLU as Decomposition

from ....registration import SolverRegistration
from ..solver import OneAtATime, SingularMatrixError, refuse_round_off
from .superlu import SuperLU

# Kinds of factors, as its option ``supernodal`` numbers them: LLᵀ and LDLᵀ.
_SUPERNODAL, _SIMPLICIAL = 2, 0

# Unknowns from which the time to import it is repaid, see ``docs/speed.md``.
_REPAID_FROM = 500

# The options of cvxopt are those of the whole process.
_LOCK = Lock()


class Cholmod(OneAtATime):
    """Cholesky factors, whose success proves stability; LDLᵀ counts where it fails.

    Parameters
    ----------
    lower
        As of `Solver`.
    """

    def __init__(self, lower: csc_matrix) -> None:
        self.lower, n = lower, lower.shape[0]
        col = np.repeat(np.arange(n), np.diff(lower.indptr))
        self.A = _cvxopt().spmatrix(
            0.0, _integers(lower.indices), _integers(col), (n, n)
        )
        self._order = _integers(np.arange(n))
        self.factors = self._analysed(_SUPERNODAL)

    def factorise(self, data: ndarray) -> "CholmodFactors":
        """Factors of the matrix with the entries ``data``."""
        return CholmodFactors(self, data)

    @cached_property
    def simplicial(self) -> object:
        """Room for LDLᵀ."""
        return self._analysed(_SIMPLICIAL)

    @cached_property
    def pivoting(self) -> SuperLU:
        """What solves where there is no Cholesky factor: LDLᵀ does not pivot."""
        return SuperLU(self.lower)

    def _analysed(self, kind: int) -> object:
        with _option(kind):
            return _cvxopt().cholmod.symbolic(self.A, p=self._order)


class CholmodFactors:
    """See `Factors`."""

    def __init__(self, solver: Cholmod, data: ndarray) -> None:
        self._solver, self._data = solver, data
        self.factorisations = 0
        self.definite = True
        solver.hold(self)

    def refactorise(self) -> None:
        """Cholesky's factors, if there are any."""
        factors = self._solver.factors
        try:
            self._numeric(factors, _SUPERNODAL)
            self._refuse_round_off(
                factors, _array(_cvxopt().cholmod.diag(factors)) ** 2
            )
        except (ArithmeticError, SingularMatrixError):
            self.definite = False

    @cached_property
    def negative_pivots(self) -> int:
        """By the signs of D."""
        if self.definite:
            return 0
        self.factorisations += 1
        factors = self._solver.simplicial
        try:
            self._numeric(factors, _SIMPLICIAL)
        except ArithmeticError:
            raise SingularMatrixError from None
        reciprocal = _cvxopt().matrix(1.0, (len(self._diagonal), 1))
        _cvxopt().cholmod.solve(factors, reciprocal, sys=6)
        pivots = 1.0 / _array(reciprocal)
        self._refuse_round_off(factors, np.abs(pivots))
        return int(np.sum(pivots < 0))

    def solve(self, b: ndarray) -> ndarray:
        """Solve A x = b."""
        if not self.definite:
            return self._pivoted.solve(b)
        self._solver.hold(self)
        x = _cvxopt().matrix(b)
        _cvxopt().cholmod.solve(self._solver.factors, x)
        return _array(x)

    @cached_property
    def _pivoted(self) -> Decomposition:
        self.factorisations += 1
        return self._solver.pivoting.pivoted(self._data)

    def _numeric(self, factors: object, kind: int) -> None:
        self._solver.A.V = _cvxopt().matrix(self._data)
        with _option(kind):
            _cvxopt().cholmod.numeric(self._solver.A, factors)

    @property
    def _diagonal(self) -> ndarray:
        return self._data[self._solver.lower.indptr[:-1]]

    def _refuse_round_off(self, factors: object, pivots: ndarray) -> None:
        diagonal = _cvxopt().matrix(self._diagonal)
        _cvxopt().cholmod.solve(factors, diagonal, sys=7)  # in the order of the pivots
        refuse_round_off(pivots, _array(diagonal))


@cache
def _cvxopt() -> Any:
    """The package, imported when the first system is to be solved."""
    import cvxopt.cholmod

    return cvxopt


@contextmanager
def _option(kind: int) -> Iterator[None]:
    """Have cvxopt make factors of a kind."""
    with _LOCK:
        before = dict(_cvxopt().cholmod.options)
        _cvxopt().cholmod.options["supernodal"] = kind
        try:
            yield
        finally:
            _cvxopt().cholmod.options.clear()
            _cvxopt().cholmod.options.update(before)


def _integers(x: ndarray) -> Any:
    return _cvxopt().matrix(x.astype(np.int64), tc="i")


def _array(x: Any) -> ndarray:
    return np.array(x).ravel()


REGISTRATION = SolverRegistration(
    name="cholmod",
    description="CHOLMOD of SuiteSparse",
    build=Cholmod,
    module="cvxopt.cholmod",
    unknowns=_REPAID_FROM,
    rival=True,
    rank=1,
)
