"""Sparsity pattern of a symmetric matrix of d×d blocks, found once.

The matrix of a ply couples the nodes of each element.  Each pair of coupled nodes has
one block, below the diagonal.  Entries that happen to be zero are kept.
"""

from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy import ndarray
from scipy.sparse import coo_matrix, csr_matrix


class Pattern:
    """Places of the blocks of element matrices in the whole matrix.

    Parameters
    ----------
    dimension, n_nodes
        Components of the displacement, d, and number of nodes; node k has the unknowns
        from dk on.
    elements
        Nodes of the elements of each group, shape (n_nodes_of_element, n_elements).
    others
        Further groups of nodes that couple.

    Attributes
    ----------
    rows, cols
        Nodes that each block couples, row ≥ column, ascending; shape (n_blocks,).
    """

    def __init__(
        self,
        dimension: int,
        n_nodes: int,
        elements: Sequence[ndarray],
        others: Sequence[ndarray] = (),
    ) -> None:
        self.dimension, self.n_nodes = dimension, n_nodes
        pairs = [
            nodes[np.array(np.triu_indices(len(nodes)))]
            for nodes in (*elements, *others)
        ]
        keys = [
            (pair.max(axis=0).astype(np.int64) * n_nodes + pair.min(axis=0))
            for pair in pairs
        ]
        distinct, number = np.unique(
            np.concatenate([key.ravel() for key in keys]), return_inverse=True
        )
        self.rows, self.cols = np.divmod(distinct, n_nodes)
        self._keys = distinct
        ends = np.cumsum([key.size for key in keys])[:-1]
        self._slots = [
            self._entry_numbers(own.reshape(key.shape), pair[0] < pair[1])
            for own, key, pair, _ in zip(
                np.split(number, ends), keys, pairs, elements, strict=False
            )
        ]

    def sum(self, matrices: Iterable[ndarray]) -> ndarray:
        """Blocks of the sum of element matrices, shape (n_blocks, d, d).

        Parameters
        ----------
        matrices
            Blocks of the pairs of nodes (a, c), a ≤ c, of the elements of each group,
            in the order of `numpy.triu_indices`: shape (n_pairs, d, d, n_elements).
        """
        d = self.dimension
        size = d * d * len(self.rows)
        sums = (
            np.bincount(slots.ravel(), matrix.ravel(), size)
            for slots, matrix in zip(self._slots, matrices, strict=True)
        )
        return sum(sums, np.zeros(size)).reshape(-1, d, d)

    def add(self, blocks: ndarray, matrix: Any, name: str) -> None:
        """Add a symmetric sparse matrix to the blocks of a sum.

        Parameters
        ----------
        blocks
            As `sum` returns them.
        matrix
            Shape (n_unknowns, n_unknowns).
        name
            Name of the term that has the matrix.

        Raises
        ------
        ValueError
            If it couples nodes that the pattern does not.
        """
        entries, d = coo_matrix(matrix), self.dimension
        row, i = np.divmod(entries.row.astype(np.int64), d)
        col, j = np.divmod(entries.col.astype(np.int64), d)
        below = (row >= col) & (entries.data != 0)
        key = (row * self.n_nodes + col)[below]
        block = np.searchsorted(self._keys, key)
        known = block < len(self._keys)
        if not known.all() or not np.array_equal(self._keys[block], key):
            raise ValueError(
                f"term {name!r}: its tangent couples nodes of which `couples` says "
                "nothing; let it name them"
            )
        np.add.at(blocks, (block, i[below], j[below]), entries.data[below])

    def matrix(self, blocks: ndarray) -> csr_matrix:
        """The whole matrix."""
        K = self._whole
        return csr_matrix((blocks.ravel()[K.data], K.indices, K.indptr), K.shape)

    @cached_property
    def _whole(self) -> csr_matrix:
        slots, row, col = self.entries()
        below = row > col
        row, col = np.append(row, col[below]), np.append(col, row[below])
        n = self.dimension * self.n_nodes
        return matrix_of_slots(np.append(slots, slots[below]), row, col, (n, n))

    def entries(self) -> tuple[ndarray, ndarray, ndarray]:
        """The entries at and below the diagonal: number in the blocks, row, column."""
        d = self.dimension
        i, j = np.indices((d, d))
        row = (d * self.rows[:, None, None] + i).ravel()
        col = (d * self.cols[:, None, None] + j).ravel()
        slots = np.flatnonzero(row >= col)
        return slots, row[slots], col[slots]

    def _entry_numbers(self, block: ndarray, flipped: ndarray) -> ndarray:
        """Numbers of the entries of the blocks of pairs, shape (n_pairs, d, d, n).

        Where the first node of a pair has the smaller number, its block is kept
        transposed.
        """
        d = self.dimension
        i, j = np.indices((d, d))[..., None]
        within = np.where(flipped[:, None, None], d * j + i, d * i + j)
        n_entries = d * d * (block.max(initial=0) + 1)
        dtype = np.int32 if n_entries <= np.iinfo(np.int32).max else np.int64
        return (d * d * block[:, None, None] + within).astype(dtype)


def matrix_of_slots(
    slots: ndarray, row: ndarray, col: ndarray, shape: tuple[int, int]
) -> csr_matrix:
    """A sorted matrix whose data are the numbers (slots) of its entries elsewhere."""
    matrix = coo_matrix((slots, (row, col)), shape).tocsr()
    matrix.sort_indices()
    return matrix
