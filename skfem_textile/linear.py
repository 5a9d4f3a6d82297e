"""Sparse direct factorisation of the symmetric systems of a Newton iteration."""

from functools import cached_property

import numpy as np
from numpy import ndarray
from scipy.sparse import csc_matrix, csr_matrix
from scipy.sparse.linalg import SuperLU, splu

# A pivot is round-off when it is this small beside the diagonal entry that it comes
# from, or beside the largest pivot.
_NO_PIVOT, _NOTHING = 1e-12, 1e-16

_MECHANISM = "some motion meets no stiffness"


class SingularMatrixError(RuntimeError):
    """The matrix leaves some motion without stiffness."""


class Factors:
    """Factors of a symmetric matrix, definite or not.

    Parameters
    ----------
    A
        The matrix.

    Attributes
    ----------
    negative_pivots
        Number of negative eigenvalues of the matrix, by Sylvester's law of inertia;
        None where a pivot had to be taken off the diagonal and does not tell.
    factorisations
        How many were needed: an indefinite matrix is factorised again to solve with.

    Raises
    ------
    SingularMatrixError
        If a pivot vanishes to working precision.

    Examples
    --------
    >>> from scipy.sparse import csr_matrix
    >>> factors = Factors(csr_matrix([[2.0, 0.0], [0.0, -1.0]]))
    >>> factors.negative_pivots, factors.solve(np.array([2.0, 3.0]))
    (1, array([ 1., -3.]))
    """

    negative_pivots: int | None

    def __init__(self, A: csr_matrix) -> None:
        self._A = A.tocsc()
        self.factorisations = 1
        self._diagonal = _factorised(self._A, pivoting=0.0)
        pivots = self._diagonal.U.diagonal()
        size, order = np.abs(pivots), self._diagonal.perm_c
        round_off = np.maximum(
            _NO_PIVOT * np.abs(self._A.diagonal()), _NOTHING * size.max(initial=0.0)
        )
        if not np.all(size[order] > round_off):
            raise SingularMatrixError(_MECHANISM)
        kept = np.array_equal(self._diagonal.perm_r, order)
        self.negative_pivots = int(np.sum(pivots < 0)) if kept else None

    def solve(self, b: ndarray) -> ndarray:
        """Solve A x = b."""
        return self._stable.solve(b)

    @cached_property
    def _stable(self) -> SuperLU:
        """Factors fit to solve with: an indefinite matrix needs pivoting."""
        if self.negative_pivots == 0:
            return self._diagonal
        self.factorisations += 1
        return _factorised(self._A, pivoting=0.01)


def _factorised(A: csc_matrix, pivoting: float) -> SuperLU:
    """Factors in an order that keeps symmetric matrices sparse.

    Without pivoting the pivots stay on the diagonal, and their signs are those of
    the eigenvalues.
    """
    try:
        return splu(
            A,
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=pivoting,
            options={"SymmetricMode": True},
        )
    except RuntimeError:
        raise SingularMatrixError(_MECHANISM) from None
