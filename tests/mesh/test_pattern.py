"""Sparsity patterns: sums, added terms and congruences equal dense matrices."""

import numpy as np
import pytest
from scipy.sparse import csr_matrix, random_array

from skfem_textile.mesh.pattern import Pattern, full_matrices

NODES = np.array([[0, 3, 1], [2, 1, 4], [3, 0, 2]])  # three triangles
OTHERS = np.array([[5, 4], [0, 5]])
N, D = 6, 2


def pattern(others=(OTHERS,)):
    return Pattern(D, N, [NODES], others)


def dofs(nodes):
    return (D * np.asarray(nodes)[:, None] + np.arange(D)).ravel()


def symmetric(rng, n):
    K = rng.normal(size=(n, n))
    return K + K.T


def test_a_sum_of_element_matrices_is_the_assembled_matrix():
    rng, dense = np.random.default_rng(1), np.zeros((D * N, D * N))
    matrices = [symmetric(rng, 6) for _ in NODES.T]
    for nodes, K in zip(NODES.T, matrices, strict=True):
        dense[np.ix_(dofs(nodes), dofs(nodes))] += K
    pairs = np.transpose(np.triu_indices(3))
    blocks = np.array(
        [[K[D * a : D * a + D, D * c : D * c + D] for K in matrices] for a, c in pairs]
    )
    blocks = blocks.transpose(0, 2, 3, 1)
    of = pattern()
    total = of.sum([blocks])
    assert of.matrix(total).toarray() == pytest.approx(dense)
    assert full_matrices(blocks)[..., 1] == pytest.approx(matrices[1])
    assert total[of.diagonal][2] == pytest.approx(dense[4:6, 4:6])


@pytest.mark.parametrize("nodes", [NODES[:, 1], NODES[::-1, 2], OTHERS[:, 0]])
def test_the_matrix_of_a_term_is_added_to_its_blocks(nodes):
    of, dense = pattern(), np.zeros((D * N, D * N))
    total = of.sum([None])
    for seed in (1, 2):  # of the same pattern, and other values
        K = np.zeros_like(dense)
        at = np.ix_(dofs(nodes), dofs(nodes))
        K[at] = symmetric(np.random.default_rng(seed), len(at[0]))
        of.add(total, csr_matrix(K), "glue")
        dense += K
    assert of.matrix(total).toarray() == pytest.approx(dense)


def test_a_term_that_couples_further_nodes_is_refused():
    K = np.zeros((D * N, D * N))
    K[0, 8] = K[8, 0] = 1.0  # nodes 0 and 4
    with pytest.raises(ValueError, match="couples nodes that `couples` does not"):
        pattern(()).add(pattern(()).sum([None]), csr_matrix(K), "glue")
    K[8, 0] = 1 + 3e-9
    with pytest.raises(ValueError, match="couples nodes"):
        pattern(()).add(pattern(()).sum([None]), csr_matrix(K), "glue")
    K[8, 0] = 1 + 3e-8
    with pytest.raises(ValueError, match="not symmetric"):
        pattern(()).add(pattern(()).sum([None]), csr_matrix(K), "glue")


def test_points_between_nodes_spread_their_blocks_to_coupled_nodes():
    rng, of = np.random.default_rng(3), pattern()
    w = random_array((4, N), density=0.6, rng=rng).tocsr()
    D_k = np.array([symmetric(rng, D) for _ in range(4)])
    blocks = (of.congruence(csr_matrix(w)) @ D_k.reshape(4, -1)).reshape(-1, D, D)
    dense = np.einsum("ka,kc,kij->aicj", w.toarray(), w.toarray(), D_k)
    dense = dense.reshape(D * N, D * N)
    coupled = of.matrix(np.ones((len(of.rows), D, D))).toarray() != 0
    assert of.matrix(blocks).toarray() == pytest.approx(np.where(coupled, dense, 0.0))
