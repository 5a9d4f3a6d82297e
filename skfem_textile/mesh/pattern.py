"""Sparsity pattern of a symmetric matrix of d×d blocks.

The matrix of a ply couples the nodes of each element.  Each pair of coupled nodes has
one block, below the diagonal.  Zero entries are kept.
"""

from collections.abc import Iterable, Sequence
from functools import cached_property
from itertools import combinations_with_replacement
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray
from scipy.sparse import coo_matrix, csc_matrix, csr_matrix

# Tolerance for the symmetry of a matrix, relative to its largest entry.
_SYMMETRIC = 1e-8

# Number of matrices whose pairs of nodes are kept, a limit of memory: the
# contact points, and a few pairs of plies.
_KEPT = 8


class Pattern:
    """Positions of the blocks of element matrices in the assembled matrix.

    Parameters
    ----------
    dimension, n_nodes
        Number d of displacement components, and number of nodes; the unknowns of node k
        start at dk.
    elements
        Nodes of the elements of each group, shape (n_nodes_of_element, n_elements).
    others
        Further groups of coupled nodes.

    Attributes
    ----------
    rows, cols
        Nodes of each block, row ≥ column, ascending; shape (n_blocks,).
    """

    def __init__(
        self,
        dimension: int,
        n_nodes: int,
        elements: Sequence[ndarray],
        others: Sequence[ndarray] = (),
    ) -> None:
        self.dimension, self.n_nodes, d = dimension, n_nodes, dimension
        # Groups of the same elements share their slots.
        distinct, self._group = _distinct(elements)
        pairs = [
            nodes[np.array(np.triu_indices(len(nodes)))].astype(np.int32)
            for nodes in [*distinct, *others]
        ]
        rows = np.concatenate([pair.max(axis=0).ravel() for pair in pairs])
        cols = np.concatenate([pair.min(axis=0).ravel() for pair in pairs])
        every = csr_matrix(
            (np.ones(rows.size, dtype=bool), (rows, cols)), (n_nodes,) * 2
        )
        every.sum_duplicates()
        nodes = np.arange(n_nodes, dtype=np.int32)
        self.rows = np.repeat(nodes, np.diff(every.indptr))
        self.cols = every.indices.astype(np.int32)
        self._added: dict[str, _Added] = {}  # the last matrix of each term
        self._congruent: dict[tuple[bytes, bytes], Any] = {}

        # Numbers of the entries of the blocks of pairs, (n_pairs, d, d, n).  Where the
        # first node of a pair has the smaller number, its block is kept transposed.
        keys, size = self._keys(self.rows, self.cols), d * d * len(self.rows)
        i, j = np.indices((d, d), dtype=index_type(size))[..., None]
        self._sums = []
        for first, second in pairs[: len(distinct)]:
            row, col = np.maximum(first, second), np.minimum(first, second)
            number = np.searchsorted(keys, self._keys(row, col)).astype(i.dtype)
            flipped = (first < second)[:, None, None]
            within = np.where(flipped, d * j + i, d * i + j)
            self._sums.append(Sums(d * d * number[:, None, None] + within, size))

    @cached_property
    def diagonal(self) -> ndarray:
        """Number of the diagonal block of each node, shape (n_nodes,)."""
        return np.flatnonzero(self.rows == self.cols)

    def sum(self, matrices: Iterable[ndarray | None]) -> ndarray:
        """Blocks of the sum of element matrices, shape (n_blocks, d, d).

        Parameters
        ----------
        matrices
            Blocks of the pairs of nodes (a, c), a ≤ c, of the elements of each group,
            in the order of `numpy.triu_indices`: shape (n_pairs, d, d, n_elements).
            None for a group whose matrices are zero.
        """
        d = self.dimension
        size = d * d * len(self.rows)
        sums = (
            self._sums[i](matrix)
            for i, matrix in zip(self._group, matrices, strict=True)
            if matrix is not None
        )
        return sum(sums, np.zeros(size)).reshape(-1, d, d)

    def add(self, blocks: ndarray, matrix: Any, name: str) -> None:
        """Add the symmetric matrix of a term, by name, to the blocks of a sum.

        Raises an error if it is not symmetric, or couples nodes outside the pattern.
        """
        K = csr_matrix(matrix)
        if not K.has_canonical_format:
            K = K.copy()
            K.sum_duplicates()
        last = self._added.get(name)
        if last is None or K.data is not last.matrix.data:
            if last is None or not (
                np.array_equal(K.indptr, last.matrix.indptr)
                and np.array_equal(K.indices, last.matrix.indices)
            ):
                last = self._positions(K)
            self._added[name] = last = last._replace(matrix=K)
            refuse_unsymmetric(name, K - K.T, K)
            if K.data[last.outside].any():
                raise ValueError(
                    f"term {name!r}: its tangent couples nodes that `couples` does "
                    "not declare: declare them, or correct the tangent"
                )
        np.add.at(blocks.reshape(-1), last.slots, K.data[last.inside])

    def _positions(self, K: csr_matrix) -> "_Added":
        """Positions of the entries of a matrix in the blocks."""
        entries, d = K.tocoo(), self.dimension
        row, i = np.divmod(entries.row, d)
        col, j = np.divmod(entries.col, d)
        below = np.flatnonzero(row >= col)
        block = self._blocks(row[below], col[below])
        known = block >= 0
        inside = below[known]
        slots = (d * block[known] + i[inside]) * d + j[inside]
        return _Added(K, slots, inside, below[~known])

    def _keys(self, row: ndarray, col: ndarray) -> ndarray:
        """A number for each pair of nodes, ascending for the blocks."""
        return row * np.int64(self.n_nodes) + col

    def _blocks(self, row: ndarray, col: ndarray) -> ndarray:
        """Numbers of the blocks of pairs of nodes, −1 outside the pattern."""
        keys, key = self._keys(self.rows, self.cols), self._keys(row, col)
        block = np.minimum(np.searchsorted(keys, key), len(keys) - 1)
        return np.where(keys[block] == key, block, -1)

    def congruence(self, points: csr_matrix) -> csr_matrix:
        """Matrix C from blocks D at points to the blocks of Σ_k w_kᵀ D_k w_k.

        Parameters
        ----------
        points
            Weights w of the nodes at each point, shape (n_points, n_nodes).

        Returns
        -------
        scipy.sparse.csr_matrix
            Shape (n_blocks, n_points).  Pairs of nodes outside the pattern are omitted.
        """
        slots, one, other, _ = self._pairs_in_rows(points)
        return with_data(slots, (points.data[one] * points.data[other])[slots.data])

    def summed(self, points: csr_matrix, blocks: ndarray) -> ndarray:
        """Blocks of Σ_k w_kᵀ D_k w_k, see `congruence`, for D of shape (d, d, n)."""
        d = self.dimension
        flat = np.ascontiguousarray(blocks.T).reshape(-1, d * d)
        return np.asarray(self.congruence(points) @ flat).reshape(-1, d, d)

    def covers(self, points: csr_matrix) -> bool:
        """True if all pairs of nodes in the rows of a matrix have blocks."""
        return self._pairs_in_rows(points)[-1]

    def _pairs_in_rows(
        self, points: csr_matrix
    ) -> tuple[csr_matrix, ndarray, ndarray, bool]:
        """Slots of pairs of entries in the same row, the pairs, and if none is missing.

        Those of the last matrices with the same nodes are kept.
        """
        known = self._congruent
        key = points.indptr.tobytes(), points.indices.tobytes()
        if key not in known:
            pairs = points.tocoo()
            one, other = pairs_in_rows(points)
            below = pairs.col[one] >= pairs.col[other]
            one, other = one[below], other[below]
            block = self._blocks(pairs.col[one], pairs.col[other])
            one, other, block = (x[block >= 0] for x in (one, other, block))
            shape = len(self.rows), points.shape[0]
            slots = matrix_of_slots(np.arange(len(one)), block, pairs.row[one], shape)
            if len(known) == _KEPT:
                known.pop(next(iter(known)))
            known[key] = slots, one, other, len(one) == np.count_nonzero(below)
        return known[key]

    def matrix(self, blocks: ndarray) -> csr_matrix:
        """Assembled matrix."""
        return with_data(self._whole, blocks.ravel()[self._whole.data])

    @cached_property
    def _whole(self) -> csr_matrix:
        slots, row, col = self.entries()
        below = row > col
        row, col = np.append(row, col[below]), np.append(col, row[below])
        n = self.dimension * self.n_nodes
        return matrix_of_slots(np.append(slots, slots[below]), row, col, (n, n))

    def entries(self) -> tuple[ndarray, ndarray, ndarray]:
        """Entries at and below the diagonal: index into the blocks, row, column."""
        d = self.dimension
        kind: Any = index_type(d * d * len(self.rows))
        i, j = np.indices((d, d), dtype=kind)
        row = (d * self.rows[:, None, None] + i).ravel()
        col = (d * self.cols[:, None, None] + j).ravel()
        slots = np.flatnonzero(row >= col).astype(i.dtype)
        return slots, row[slots], col[slots]


def pairs_in_rows(matrix: csr_matrix) -> tuple[ndarray, ndarray]:
    """Pairs of entries of a matrix in the same row, by their numbers."""
    size = np.diff(matrix.indptr)
    own = np.repeat(size, size)  # entries in the row of each entry
    one = np.repeat(np.arange(matrix.nnz), own)
    first = np.repeat(np.repeat(matrix.indptr[:-1], size), own)
    return one, first + np.arange(len(one)) - np.repeat(np.cumsum(own) - own, own)


def padded(points: csr_matrix) -> tuple[ndarray, ndarray]:
    """Nodes in the rows of a matrix and their weights, each (n, n_rows).

    Shorter rows are padded with their first node and zero weights.
    """
    size = np.diff(points.indptr)
    within = np.arange(size.max())[:, None]
    at = points.indptr[:-1] + np.where(within < size, within, 0)
    return points.indices[at], np.where(within < size, points.data[at], 0.0)


class Sums:
    """Sums of values by their numbers.

    As `numpy.bincount`, which converts 32-bit numbers at each call, but in a third of
    the time.

    Parameters
    ----------
    numbers
        Number of each value.
    size
        Number of sums.
    """

    def __init__(self, numbers: ndarray, size: int) -> None:
        # A column with several entries in a row, whose product with 1 adds them.
        rows = numbers.ravel()
        entries = np.broadcast_to(1.0, rows.size), rows, np.array([0, rows.size])
        self._column = csc_matrix(entries, (size, 1))

    def __call__(self, values: ndarray) -> ndarray:
        """The sums, shape (size,)."""
        return with_data(self._column, values.ravel()) @ _ONE


_ONE = np.ones(1)


def index_type(size: int) -> type[np.int32] | type[np.int64]:
    """Type of indices into arrays up to a size."""
    return np.int32 if size <= np.iinfo(np.int32).max else np.int64


def _distinct(groups: Sequence[ndarray]) -> tuple[list[ndarray], list[int]]:
    """Distinct arrays, and the number of each array among them."""
    distinct: list[ndarray] = []
    numbers = []
    for one in groups:
        known = (i for i, x in enumerate(distinct) if np.array_equal(one, x))
        if (number := next(known, None)) is None:
            number = len(distinct)
            distinct.append(one)
        numbers.append(number)
    return distinct, numbers


def full_matrices(K: ndarray) -> ndarray:
    """Matrices over the unknowns of an element, shape (d n_nodes, d n_nodes, n).

    From the blocks of the pairs of nodes (a, c), a ≤ c, in the order of
    `numpy.triu_indices`: shape (n_pairs, d, d, n).
    """
    n_nodes, d = int(np.sqrt(2 * len(K))), K.shape[1]  # of n (n + 1) / 2 pairs
    full = np.empty((n_nodes, d, n_nodes, d, K.shape[-1]), K.dtype)
    pairs = combinations_with_replacement(range(n_nodes), 2)
    for (a, c), block in zip(pairs, K, strict=True):
        full[a, :, c], full[c, :, a] = block, block.transpose(1, 0, 2)
    return full.reshape(d * n_nodes, d * n_nodes, -1)


class _Added(NamedTuple):
    """Sparse matrix added to blocks.

    ``slots`` are indices into the entries of the blocks, ``inside`` the indices of the
    corresponding entries of the matrix, ``outside`` the indices of entries without a
    block.
    """

    matrix: csr_matrix
    slots: ndarray
    inside: ndarray
    outside: ndarray


def matrix_of_slots(
    slots: ndarray, row: ndarray, col: ndarray, shape: tuple[int, int]
) -> csr_matrix:
    """Sorted matrix whose data are indices (slots) of its entries in an array."""
    matrix = coo_matrix((slots, (row, col)), shape).tocsr()
    matrix.sort_indices()
    return matrix


def with_data(pattern: Any, data: ndarray) -> Any:
    """A sparse matrix with the sparsity pattern of another one, which they share.

    The constructors of SciPy check the indices, which takes longer than a product.
    """
    matrix = object.__new__(type(pattern))
    vars(matrix).update(vars(pattern), data=data)
    return matrix


def refuse_unsymmetric(name: str, difference: Any, matrix: Any) -> None:
    """Refuse the tangent of a term that is not a second derivative.

    ``difference`` is the tangent less its transpose.
    """
    if abs(difference).max() > _SYMMETRIC * abs(matrix).max():
        raise ValueError(
            f"term {name!r}: its tangent is not symmetric, so it is not the second "
            "derivative of an energy: correct its forms, or omit parts without an "
            "energy"
        )
