import numpy as np
import pytest
from scipy.sparse import csr_matrix, diags

from skfem_textile.linear import (
    SingularMatrixError,
    negative_pivots,
    solve_symmetric,
)


def some_matrix(seed, shift):
    rng = np.random.default_rng(seed)
    band = [rng.standard_normal(40 - k) for k in (0, 1, 5)]
    lower = diags(band, [0, -1, -5])
    return csr_matrix(lower + lower.T + shift * diags([np.ones(40)], [0]))


@pytest.mark.parametrize("shift", [-20.0, 0.0, 1.0, 20.0])
def test_negative_pivots_count_negative_eigenvalues(shift):
    A = some_matrix(3, shift)
    assert negative_pivots(A) == np.sum(np.linalg.eigvalsh(A.toarray()) < 0)


@pytest.mark.parametrize("shift", [0.0, 20.0])
def test_indefinite_systems_are_solved_too(shift):
    A, x = some_matrix(4, shift), np.arange(40.0)
    np.testing.assert_allclose(solve_symmetric(A, A @ x), x, atol=1e-9)


def test_singular_systems_are_refused():
    A = diags([np.r_[np.ones(5), 1e-17]], [0]).tocsr()
    with pytest.raises(SingularMatrixError, match="some motion meets no stiffness"):
        solve_symmetric(A, np.ones(6))
