"""SciPy's SuperLU: needs nothing else."""

from functools import cached_property

import numpy as np
from numpy import ndarray
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import SuperLU as Decomposition
from scipy.sparse.linalg import splu

from ..pattern import where
from .solver import NO_PIVOT, NOTHING, SingularMatrixError


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
        self._whole = where(
            np.append(slots, slots[below]),
            np.append(col, row[below]),
            np.append(row, col[below]),
            lower.shape,
        )

    def factorise(self, data: ndarray) -> "SuperLUFactors":
        """Factors of the matrix with the entries ``data``."""
        whole = self._whole
        A = csc_matrix((data[whole.data], whole.indices, whole.indptr), whole.shape)
        return SuperLUFactors(A)


class SuperLUFactors:
    """See `Factors`."""

    def __init__(self, A: csc_matrix) -> None:
        self._A = A
        self.factorisations = 1
        self._diagonal = _decomposed(self._A, pivoting=0.0)
        pivots = self._diagonal.U.diagonal()
        size, order = np.abs(pivots), self._diagonal.perm_c
        round_off = np.maximum(
            NO_PIVOT * np.abs(self._A.diagonal()), NOTHING * size.max(initial=0.0)
        )
        if not np.all(size[order] > round_off):
            raise SingularMatrixError
        kept = np.array_equal(self._diagonal.perm_r, order)
        self.negative_pivots = int(np.sum(pivots < 0)) if kept else None

    @property
    def definite(self) -> bool:
        """Whether every pivot is positive."""
        return self.negative_pivots == 0

    def solve(self, b: ndarray) -> ndarray:
        """Solve A x = b."""
        return self._stable.solve(b)

    @cached_property
    def _stable(self) -> Decomposition:
        """Factors fit to solve with: an indefinite matrix needs pivoting."""
        if self.definite:
            return self._diagonal
        self.factorisations += 1
        return _decomposed(self._A, pivoting=0.01)


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
