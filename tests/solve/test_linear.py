import gc
from weakref import ref

import numpy as np
import pytest
from scipy.sparse import csr_matrix, diags, tril

from skfem_textile.scenes import strip
from skfem_textile.solve.linear import (
    SOLVERS,
    SingularMatrixError,
    nested_dissection,
    solver_named,
)


@pytest.fixture(params=SOLVERS)
def factorised(request):
    """Factors of a matrix by each of the solvers that are installed."""
    pytest.importorskip(SOLVERS[request.param].package)

    def factorised(A, solver=None):
        lower = tril(A, format="csc")
        lower.sort_indices()
        return solver_named(request.param)(lower).factorise(lower.data)

    return factorised


def some_matrix(seed, shift):
    rng = np.random.default_rng(seed)
    band = [rng.standard_normal(40 - k) for k in (0, 1, 5)]
    lower = diags(band, [0, -1, -5])
    return csr_matrix(lower + lower.T + shift * diags([np.ones(40)], [0]))


@pytest.mark.parametrize("shift", [-20.0, 0.0, 1.0, 20.0])
def test_negative_pivots_count_negative_eigenvalues(factorised, shift):
    A = some_matrix(3, shift)
    negative = np.sum(np.linalg.eigvalsh(A.toarray()) < 0)
    factors = factorised(A)
    assert factors.negative_pivots == negative
    assert factors.definite == (negative == 0)


@pytest.mark.parametrize("shift", [0.0, 20.0])
def test_indefinite_systems_are_solved_too(factorised, shift):
    A, x = some_matrix(4, shift), np.arange(40.0)
    np.testing.assert_allclose(factorised(A).solve(A @ x), x, atol=1e-9)


def test_small_diagonal_entries_do_no_harm_to_the_solution(factorised):
    A = csr_matrix([[1.0, 1.0], [1.0, 1e-10]])
    x = np.array([1.0, 2.0])
    np.testing.assert_allclose(factorised(A).solve(A @ x), x, rtol=1e-12)


@pytest.mark.parametrize("weak", [1e-7, 1e-10])
def test_indefinite_systems_with_hardly_a_diagonal_are_solved_too(factorised, weak):
    rng, n = np.random.default_rng(6), 40
    B = rng.standard_normal((n, n)) + 8 * np.eye(n)
    A = csr_matrix(np.block([[weak * np.eye(n), B], [B.T, weak * np.eye(n)]]))
    x = rng.standard_normal(2 * n)
    np.testing.assert_allclose(factorised(A).solve(A @ x), x, atol=1e-9)


def test_pivots_are_compared_with_their_own_entries(factorised):
    """Stiffnesses of very different size are no mechanism, in any order."""
    rng, n = np.random.default_rng(6), 12
    S = np.tril(rng.standard_normal((n, n)) * (rng.random((n, n)) < 0.1), -1)
    D = np.diag(10.0 ** rng.permutation(np.linspace(-3.5, 3.5, n)))
    A = csr_matrix(D @ (S + S.T + 6 * np.eye(n)) @ D)
    x = rng.standard_normal(n)
    factors = factorised(A)
    assert factors.definite
    np.testing.assert_allclose(factors.solve(A @ x), x, rtol=1e-9)


def test_the_options_of_cvxopt_are_left_as_they_were():
    cholmod = pytest.importorskip("cvxopt.cholmod")
    before, A = dict(cholmod.options), some_matrix(3, 0.0)
    lower = tril(A, format="csc")
    assert solver_named("cholmod")(lower).factorise(lower.data).negative_pivots
    assert cholmod.options == before


def test_singular_systems_are_refused(factorised):
    A = diags([np.r_[np.ones(5), 1e-17]], [0]).tocsr()
    with pytest.raises(SingularMatrixError, match="some motion meets no stiffness"):
        _ = factorised(A).negative_pivots
    with pytest.raises(SingularMatrixError, match="some motion meets no stiffness"):
        factorised(A).solve(np.ones(6))


def test_a_mechanism_is_refused_whatever_its_pivots_are_beside_round_off(factorised):
    A = csr_matrix(np.full((2, 2), 3.0) + np.diag([0.0, 1e-14]))
    with pytest.raises(SingularMatrixError):
        factorised(A).solve(np.ones(2))


@pytest.mark.parametrize("name", SOLVERS)
def test_a_solver_goes_with_its_factors_and_waits_for_no_search_of_cycles(name):
    pytest.importorskip(SOLVERS[name].package)
    lower = tril(some_matrix(5, 20.0), format="csc")
    solver = solver_named(name)(lower)
    there, factors = ref(solver), solver.factorise(lower.data)
    gc.disable()
    try:
        del solver, factors
        assert there() is None
    finally:
        gc.enable()


@pytest.mark.parametrize("shift", [0.0, 20.0])
@pytest.mark.parametrize("name", SOLVERS)
def test_factors_outlive_those_of_another_matrix_of_the_same_pattern(name, shift):
    pytest.importorskip(SOLVERS[name].package)
    A, x = some_matrix(5, shift), np.arange(40.0)
    lower = tril(A, format="csc")
    solver = solver_named(name)(lower)
    first, second = solver.factorise(lower.data), solver.factorise(2 * lower.data)
    np.testing.assert_allclose(second.solve(A @ x), x / 2, atol=1e-9)
    np.testing.assert_allclose(first.solve(A @ x), x, atol=1e-9)


def test_a_ply_with_every_unknown_fixed_is_no_special_case(factorised):
    factors = factorised(csr_matrix((0, 0)))
    assert factors.negative_pivots == 0
    assert factors.solve(np.empty(0)).size == 0


def test_a_solver_that_is_not_installed_is_refused_with_what_it_needs(monkeypatch):
    monkeypatch.setattr(
        "skfem_textile.solve.linear.solver.find_spec", lambda name: None
    )
    with pytest.raises(ValueError, match="'cholmod' needs cvxopt: pip install cvxopt"):
        solver_named("cholmod")


def test_an_unknown_solver_is_refused_with_what_there_is():
    with pytest.raises(ValueError, match="choose of auto, cholmod, pardiso, superlu"):
        solver_named("umfpack")


def test_dissection_orders_every_node_and_ends_with_one_that_keeps_halves_apart():
    mesh = strip(size=(16, 24)).mesh
    pairs = np.concatenate(
        [mesh.t[[i, j]] for i, j in ((0, 1), (1, 2), (0, 2), (1, 3))], 1
    )
    order = nested_dissection(mesh.p, pairs)
    np.testing.assert_array_equal(np.sort(order), np.arange(mesh.p.shape[1]))
    # The last 17 nodes cross the strip once; without them it falls apart.
    last = mesh.p[1, order[-17:]]
    assert np.ptp(last) < 60 / 24 * 2
    kept = np.isin(pairs, order[-17:], invert=True).all(axis=0)
    below = mesh.p[1] < last.mean()
    assert not np.any(below[pairs[0, kept]] != below[pairs[1, kept]])
