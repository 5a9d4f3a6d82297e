"""SuperLU of SciPy: always available, and solves systems that need pivoting."""

from functools import cached_property

import numpy as np
from numpy import ndarray
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import SuperLU as Decomposition
from scipy.sparse.linalg import splu

from ...mesh.pattern import matrix_of_slots
from .scaling import SingularMatrixError, refuse_round_off
from .unknowns import Unknowns


class SuperLU:
    """LU factors; pivots stay on the diagonal and determine the inertia.

    Parameters
    ----------
    lower, unknowns
        See `Solver`.
    """

    def __init__(self, lower: csc_matrix, unknowns: Unknowns) -> None:
        self.order = unknowns.order
        number = np.argsort(self.order)
        slots, row = np.arange(lower.nnz), number[lower.indices]
        col = number[np.repeat(np.arange(lower.shape[0]), np.diff(lower.indptr))]
        below = row != col
        self._whole = matrix_of_slots(
            np.append(slots, slots[below]),
            np.append(col, row[below]),
            np.append(row, col[below]),
            lower.shape,
        )

    def factorise(self, data: ndarray) -> "SuperLUFactors":
        """Factors of the matrix with the entries ``data``."""
        return SuperLUFactors(self, data)

    def matrix(self, data: ndarray) -> csc_matrix:
        """Matrix with the entries ``data`` of the lower triangle, in the order."""
        whole = self._whole
        return csc_matrix((data[whole.data], whole.indices, whole.indptr), whole.shape)


class SuperLUFactors:
    """See `Factors`."""

    def __init__(self, solver: SuperLU, data: ndarray) -> None:
        self._solver, self._data = solver, data
        self.factorisations = 1
        self._lu = _decomposed(solver.matrix(data), pivoting=0.0)

    @cached_property
    def negative_pivots(self) -> int | None:
        """Number of negative pivots, if all pivots stay on the diagonal."""
        lu = self._lu
        pivots = lu.U.diagonal()
        refuse_round_off(np.abs(pivots))
        kept = np.array_equal(lu.perm_r, lu.perm_c)
        return int(np.sum(pivots < 0)) if kept else None

    @property
    def definite(self) -> bool:
        """True if every pivot is positive and none is round-off."""
        try:
            return self.negative_pivots == 0
        except SingularMatrixError:
            return False

    def solve(self, b: ndarray) -> ndarray:
        """Solve A x = b."""
        order, x = self._solver.order, np.empty_like(b)
        x[order] = (self._lu if self.definite else self._pivoted).solve(b[order])
        return x

    @cached_property
    def _pivoted(self) -> Decomposition:
        """LU factors with pivoting for an indefinite system."""
        self.factorisations += 1
        lu = _decomposed(self._solver.matrix(self._data), pivoting=0.01)
        refuse_round_off(np.abs(lu.U.diagonal()))
        return lu


def _decomposed(A: csc_matrix, pivoting: float) -> Decomposition:
    """Factors in the order of the matrix, except for row exchanges by pivoting."""
    try:
        return splu(
            A,
            permc_spec="NATURAL",
            diag_pivot_thresh=pivoting,
            options={"SymmetricMode": True},
        )
    except RuntimeError:
        raise SingularMatrixError from None
