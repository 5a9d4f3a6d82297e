"""Linear solvers for the codes that run in this process: functions of A and b."""

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
from numpy import ndarray
from scipy.sparse import csc_matrix, csr_matrix
from scipy.sparse.linalg import spsolve

from skfem_textile.solve.linear import (
    ChosenSolver,
    SingularMatrixError,
    Unknowns,
)

from .newton import NotConvergedError
from .rival import Task

#: Solution of A x = b.
Solve: TypeAlias = Callable[[Any, ndarray], ndarray]


def solver_of(task: Task, name: str) -> Solve:
    """Linear solver by name for the free unknowns of a task.

    ``required``: SuperLU in the default ordering of SciPy; ``fastest``: the solver and
    ordering of this library; ``pypardiso``: PARDISO.
    """
    if name == "required":
        return spsolve
    return SolverOfThisLibrary(task) if name == "fastest" else _pardiso()


class SolverOfThisLibrary:
    """The solver that this library selects for ``auto``, with its ordering.

    Each sparsity pattern is ordered and analysed once.

    Parameters
    ----------
    task
        The task.  Matrices contain its free unknowns in ascending order.
    """

    def __init__(self, task: Task) -> None:
        self._nodes, n = task.nodes, task.nodes.size
        self._free = np.setdiff1d(np.arange(n), task.fixed)
        self._patterns: list[_Pattern] = []

    def __call__(self, A: Any, b: ndarray) -> ndarray:
        """Solve A x = b for a symmetric A; by SciPy's SuperLU if A is singular."""
        A = csr_matrix(A)
        A.sort_indices()
        try:
            return self._pattern_of(A).solve(A, b)
        except SingularMatrixError:
            return np.asarray(spsolve(A, b))

    def _pattern_of(self, A: csr_matrix) -> "_Pattern":
        for pattern in self._patterns:
            if pattern.fits(A):
                return pattern
        self._patterns.append(_Pattern(A, self._free, self._nodes))
        return self._patterns[-1]


class _Pattern:
    """The ordering and the symbolic analysis of one sparsity pattern."""

    def __init__(self, A: csr_matrix, free: ndarray, positions: ndarray) -> None:
        self._indptr, self._indices = A.indptr, A.indices
        row = np.repeat(np.arange(A.shape[0]), np.diff(A.indptr))
        node = free // 2
        pairs = np.array([node[row], node[A.indices]])
        # The CSC lower triangle is the CSR upper triangle.
        self._upper = np.flatnonzero(row <= A.indices)
        upper = (
            A.indices[self._upper],
            np.searchsorted(row[self._upper], np.arange(A.shape[0] + 1)),
        )
        ones = np.ones(len(self._upper))
        unknowns = Unknowns(positions, pairs, 2, free)
        self._solver = ChosenSolver(
            "auto", csc_matrix((ones, *upper), A.shape), unknowns
        )

    def fits(self, A: csr_matrix) -> bool:
        """Return True if a matrix has this pattern."""
        return np.array_equal(A.indptr, self._indptr) and np.array_equal(
            A.indices, self._indices
        )

    def solve(self, A: csr_matrix, b: ndarray) -> ndarray:
        """Solve A x = b."""
        return self._solver.factorise(A.data[self._upper]).solve(b)


def _pardiso() -> Solve:
    import pypardiso

    solver = pypardiso.PyPardisoSolver()  # one per task: caches the last factors

    def solve(A: Any, b: ndarray) -> ndarray:
        try:
            return np.asarray(pypardiso.spsolve(A, b, solver=solver))
        except pypardiso.pardiso_wrapper.PyPardisoError as error:
            raise NotConvergedError(str(error)) from None

    return solve
