"""Sparse direct solution of the linear systems of a Newton iteration."""

import numpy as np
from numpy import ndarray
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import splu

# A pivot this much smaller than the largest is round-off.
_NO_PIVOT = 1e-15

_MECHANISM = (
    "some motion meets no stiffness: hold the ply in more places, or give it "
    "stabilisation or shear stiffness"
)


class SingularMatrixError(RuntimeError):
    """The tangent leaves some motion without stiffness."""


def negative_pivots(A: csr_matrix) -> int:
    """Number of negative eigenvalues of a symmetric matrix, by Sylvester's inertia.

    Raises
    ------
    SingularMatrixError
        If the factorisation does not keep to the diagonal, so that its pivots do not
        tell.
    """
    lu = splu(
        A.tocsc(),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )
    if not np.array_equal(lu.perm_r, lu.perm_c):
        raise SingularMatrixError("the pivots left the diagonal")
    return int(np.sum(lu.U.diagonal() < 0))


def solve_symmetric(A: csr_matrix, b: ndarray) -> ndarray:
    """Solve A x = b for a symmetric matrix, definite or not.

    Raises
    ------
    SingularMatrixError
        If a pivot vanishes to working precision.
    """
    try:
        lu = splu(
            A.tocsc(),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.01,
            options={"SymmetricMode": True},
        )
    except RuntimeError:
        raise SingularMatrixError(_MECHANISM) from None
    pivots = np.abs(lu.U.diagonal())
    if not pivots.min() > _NO_PIVOT * pivots.max():
        raise SingularMatrixError(_MECHANISM)
    return lu.solve(b)
