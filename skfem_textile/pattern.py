"""A symmetric sparse matrix of 2×2 blocks whose pattern is found once.

The matrix of a ply couples the nodes of each element.  Of every pair of nodes that are
coupled one block is kept, that below the diagonal; entries that happen to be zero stay.
"""

from collections.abc import Iterable, Sequence
from functools import cached_property

import numpy as np
from numpy import ndarray
from scipy.sparse import coo_matrix, csr_matrix


class Pattern:
    """Where the blocks of element matrices go.

    Parameters
    ----------
    n_nodes
        Number of nodes; node k has the unknowns 2k and 2k + 1.
    elements
        Nodes of the elements of each kind, shape (n_nodes_of_element, n_elements).

    Attributes
    ----------
    rows, cols
        Nodes that the blocks couple, row ≥ column, ascending; shape (n_blocks,).
    """

    def __init__(self, n_nodes: int, elements: Sequence[ndarray]) -> None:
        self.n_nodes = n_nodes
        pairs = [nodes[np.array(np.triu_indices(len(nodes)))] for nodes in elements]
        keys = [
            (p.max(axis=0).astype(np.int64) * n_nodes + p.min(axis=0)) for p in pairs
        ]
        found, number = np.unique(
            np.concatenate([key.ravel() for key in keys]), return_inverse=True
        )
        self.rows, self.cols = np.divmod(found, n_nodes)
        self._keys = found
        ends = np.cumsum([key.size for key in keys])[:-1]
        self._slots = [
            _slots(own.reshape(key.shape), p[0] < p[1])
            for own, key, p in zip(np.split(number, ends), keys, pairs, strict=True)
        ]

    def sum(self, matrices: Iterable[ndarray]) -> ndarray:
        """Blocks of the sum of element matrices, shape (n_blocks, 2, 2).

        Parameters
        ----------
        matrices
            For the elements of each kind the blocks of their pairs of nodes (a, c), a ≤
            c, in the order of `numpy.triu_indices`: shape (n_pairs, 2, 2, n_elements).
        """
        size = 4 * len(self.rows)
        first, *others = (
            np.bincount(slots.ravel(), matrix.ravel(), size)
            for slots, matrix in zip(self._slots, matrices, strict=True)
        )
        return sum(others, first).reshape(-1, 2, 2)

    def add(self, blocks: ndarray, nodes: ndarray, matrices: ndarray) -> None:
        """Add the matrices of a few elements to the blocks of a sum.

        Parameters
        ----------
        blocks
            As `sum` returns them.
        nodes
            Nodes of the elements, which the pattern couples; shape (n_nodes_of_element,
            n_elements).
        matrices
            As for `sum`.
        """
        first, second = nodes[np.array(np.triu_indices(len(nodes)))]
        high, low = np.maximum(first, second), np.minimum(first, second)
        block = np.searchsorted(self._keys, high.astype(np.int64) * self.n_nodes + low)
        slots = _slots(block, first < second)
        np.add.at(blocks.reshape(-1), slots.ravel(), matrices.ravel())

    def matrix(self, blocks: ndarray) -> csr_matrix:
        """The whole matrix."""
        K = self._whole
        return csr_matrix((blocks.ravel()[K.data], K.indices, K.indptr), K.shape)

    @cached_property
    def _whole(self) -> csr_matrix:
        slots, row, col = self.entries()
        below = row > col
        row, col = np.append(row, col[below]), np.append(col, row[below])
        return where(np.append(slots, slots[below]), row, col, 2 * (2 * self.n_nodes,))

    def entries(self) -> tuple[ndarray, ndarray, ndarray]:
        """The entries at and below the diagonal: number in the blocks, row, column."""
        i, j = np.indices((2, 2))
        row = (2 * self.rows[:, None, None] + i).ravel()
        col = (2 * self.cols[:, None, None] + j).ravel()
        slots = np.flatnonzero(row >= col)
        return slots, row[slots], col[slots]


def where(
    slots: ndarray, row: ndarray, col: ndarray, shape: tuple[int, int]
) -> csr_matrix:
    """A matrix whose data are the numbers at which its entries are to be found."""
    found = coo_matrix((slots, (row, col)), shape).tocsr()
    found.sort_indices()
    return found


def _slots(block: ndarray, flipped: ndarray) -> ndarray:
    """Numbers of the entries of the blocks of pairs, shape (n_pairs, 2, 2, n).

    Where the first node of a pair has the smaller number, its block is kept transposed.
    """
    i, j = np.indices((2, 2))[..., None]
    within = np.where(flipped[:, None, None], 2 * j + i, 2 * i + j)
    dtype = np.int32 if 4 * block.max(initial=0) < 2**31 - 4 else np.int64
    return (4 * block[:, None, None] + within).astype(dtype)
