import numpy as np
import pytest
from scipy.sparse import csr_matrix, diags

from skfem_textile.linear import Factors, SingularMatrixError


def some_matrix(seed, shift):
    rng = np.random.default_rng(seed)
    band = [rng.standard_normal(40 - k) for k in (0, 1, 5)]
    lower = diags(band, [0, -1, -5])
    return csr_matrix(lower + lower.T + shift * diags([np.ones(40)], [0]))


@pytest.mark.parametrize("shift", [-20.0, 0.0, 1.0, 20.0])
def test_negative_pivots_count_negative_eigenvalues(shift):
    A = some_matrix(3, shift)
    negative = np.sum(np.linalg.eigvalsh(A.toarray()) < 0)
    assert Factors(A).negative_pivots == negative


@pytest.mark.parametrize("shift", [0.0, 20.0])
def test_indefinite_systems_are_solved_too(shift):
    A, x = some_matrix(4, shift), np.arange(40.0)
    np.testing.assert_allclose(Factors(A).solve(A @ x), x, atol=1e-9)


def test_small_pivots_do_no_harm_to_the_solution():
    A = csr_matrix([[1e-10, 1.0], [1.0, 1.0]])
    x = np.array([1.0, 2.0])
    np.testing.assert_allclose(Factors(A).solve(A @ x), x, rtol=1e-12)


def test_pivots_off_the_diagonal_do_not_tell():
    assert Factors(csr_matrix([[0.0, 1.0], [1.0, 0.0]])).negative_pivots is None


def test_singular_systems_are_refused():
    with pytest.raises(SingularMatrixError, match="some motion meets no stiffness"):
        Factors(diags([np.r_[np.ones(5), 1e-17]], [0]).tocsr())


def test_a_ply_with_every_unknown_fixed_is_no_special_case():
    factors = Factors(csr_matrix((0, 0)))
    assert factors.negative_pivots == 0
    assert factors.solve(np.empty(0)).size == 0
