"""SciPy's SuperLU: needs nothing else."""

from functools import cached_property

import numpy as np
from numpy import ndarray
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import SuperLU as Decomposition
from scipy.sparse.linalg import splu

from ....mesh.pattern import matrix_of_slots
from ....registration import SolverRegistration
from ..solver import SingularMatrixError, refuse_round_off


class SuperLU:
    """LU factors; pivots stay on the diagonal and tell the inertia.

    Parameters
    ----------
    lower
        As of `Solver`.
    """

    def __init__(self, lower: csc_matrix) -> None:
        slots = np.arange(lower.nnz)
        row, col = (
            lower.indices,
            np.repeat(slots[: lower.shape[0]], np.diff(lower.indptr)),
        )
        below = row > col
        self._whole = matrix_of_slots(
            np.append(slots, slots[below]),
            np.append(col, row[below]),
            np.append(row, col[below]),
            lower.shape,
        )

    def factorise(self, data: ndarray) -> "SuperLUFactors":
        """Factors of the matrix with the entries ``data``."""
        return SuperLUFactors(self._matrix(data))

    def pivoted(self, data: ndarray) -> Decomposition:
        """Factors fit to solve with where the matrix is indefinite."""
        return _pivoted(self._matrix(data))

    def _matrix(self, data: ndarray) -> csc_matrix:
        whole = self._whole
        return csc_matrix((data[whole.data], whole.indices, whole.indptr), whole.shape)


class SuperLUFactors:
    """See `Factors`."""

    def __init__(self, A: csc_matrix) -> None:
        self._A = A
        self.factorisations = 1
        self._diagonal = _decomposed(A, pivoting=0.0)

    @cached_property
    def negative_pivots(self) -> int | None:
        """By the signs of the pivots, where they stay on the diagonal."""
        lu = self._diagonal
        pivots = lu.U.diagonal()
        refuse_round_off(np.abs(pivots)[lu.perm_c], self._A.diagonal())
        kept = np.array_equal(lu.perm_r, lu.perm_c)
        return int(np.sum(pivots < 0)) if kept else None

    @property
    def definite(self) -> bool:
        """Whether every pivot is positive, and none of them round-off."""
        try:
            return self.negative_pivots == 0
        except SingularMatrixError:
            return False

    def solve(self, b: ndarray) -> ndarray:
        """Solve A x = b."""
        return self._stable.solve(b)

    @cached_property
    def _stable(self) -> Decomposition:
        """Factors fit to solve with: an indefinite matrix needs pivoting."""
        if self.definite:
            return self._diagonal
        self.factorisations += 1
        return _pivoted(self._A)


def _pivoted(A: csc_matrix) -> Decomposition:
    lu = _decomposed(A, pivoting=0.01)
    columns = abs(A).max(axis=0).toarray().ravel()
    refuse_round_off(np.abs(lu.U.diagonal())[lu.perm_c], columns)
    return lu


def _decomposed(A: csc_matrix, pivoting: float) -> Decomposition:
    """Factors in the order of the matrix, but for what pivoting asks."""
    try:
        return splu(
            A,
            permc_spec="NATURAL",
            diag_pivot_thresh=pivoting,
            options={"SymmetricMode": True},
        )
    except RuntimeError:
        raise SingularMatrixError from None


REGISTRATION = SolverRegistration(
    name="superlu",
    description="SciPy's SuperLU",
    build=SuperLU,
    module="scipy",
    unknowns=0,
    rival=False,
    rank=3,
)
