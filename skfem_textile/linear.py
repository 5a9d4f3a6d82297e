"""Sparse direct solution of the linear systems of a Newton iteration."""

import numpy as np
from numpy import ndarray
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import splu


class SingularMatrixError(RuntimeError):
    """The tangent leaves some motion without stiffness."""


def solve_symmetric(A: csr_matrix, b: ndarray) -> ndarray:
    """Solve A x = b for a symmetric matrix, definite or not.

    Raises
    ------
    SingularMatrixError
        If the matrix is singular to working precision.
    """
    try:
        lu = splu(
            A.tocsc(),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.01,
            options={"SymmetricMode": True},
        )
    except RuntimeError:
        raise SingularMatrixError("the tangent is singular") from None
    x = lu.solve(b)
    if not np.isfinite(x).all():
        raise SingularMatrixError("the tangent is singular")
    return x
