"""The linear system that constraints leave of a tangent, its places found once."""

from typing import Protocol

import numpy as np
from numpy import ndarray
from scipy.sparse import csc_matrix, csr_matrix

from ...mesh.pattern import Pattern, matrix_of_slots
from .dissection import nested_dissection
from .solver import SolverOfPattern


class Fixing(Protocol):
    """Which unknowns are fixed and which are free."""

    free: ndarray
    fixed: ndarray


class System:
    """Free unknowns in the order of elimination, and where their entries are.

    Parameters
    ----------
    pattern
        Pattern of the tangent.
    positions
        Of the nodes, shape (2, n_nodes).
    constraints
        What fixes the other unknowns.
    solver
        Makes the linear solver of their pattern.

    Attributes
    ----------
    dimension
        Components of the displacement.
    free
        Numbers of the free unknowns, shape (n_free,).
    upper, coupling
        Numbers of the entries among those of the blocks: of free unknowns at and above
        the diagonal, and from the fixed unknowns to the free ones.
    solver
        The linear solver, ready for their pattern.
    """

    def __init__(
        self,
        pattern: Pattern,
        positions: ndarray,
        constraints: Fixing,
        solver: SolverOfPattern,
    ) -> None:
        nodes = nested_dissection(positions, np.array([pattern.rows, pattern.cols]))
        self.dimension = d = pattern.dimension
        unknowns = (d * nodes[:, None] + np.arange(d)).ravel()
        self.free = unknowns[np.isin(unknowns, constraints.free)]
        n, n_fixed = len(self.free), len(constraints.fixed)
        place = np.empty(n + n_fixed, dtype=np.int64)
        place[self.free] = np.arange(n)
        place[constraints.fixed] = n + np.arange(n_fixed)

        slots, row, col = pattern.entries()
        row, col = np.sort([place[row], place[col]], axis=0)
        inside, across = col < n, (row < n) & (col >= n)
        self.upper = matrix_of_slots(slots[inside], row[inside], col[inside], (n, n))
        self.coupling = matrix_of_slots(
            slots[across], row[across], col[across] - n, (n, n_fixed)
        )
        self._pattern = pattern
        self._turn: _Turn | None = None  # the last
        self.solver = solver(_lower(self.upper))

    def turned(self, blocks: ndarray, turn: csr_matrix) -> ndarray:
        """The blocks of a tangent in unknowns that are turned, Rᵀ K R.

        Parameters
        ----------
        blocks
            The blocks.
        turn
            R, as of `Problem.turn`.
        """
        if self._turn is None or self._turn.turn is not turn:
            self._turn = _Turn(self._pattern, turn)
        return self._turn(blocks)


class _Turn:
    """Rᵀ K R, with the places of what it changes."""

    def __init__(self, pattern: Pattern, turn: csr_matrix) -> None:
        self.turn, d = turn, pattern.dimension
        R = turn.tobsr(blocksize=(d, d)).data
        turned = np.any(np.eye(d) != R, axis=(1, 2))
        self._rows = np.flatnonzero(turned[pattern.rows])
        self._cols = np.flatnonzero(turned[pattern.cols])
        self._left = R[pattern.rows[self._rows]].swapaxes(1, 2)
        self._right = R[pattern.cols[self._cols]]

    def __call__(self, blocks: ndarray) -> ndarray:
        blocks = blocks.copy()
        blocks[self._rows] = self._left @ blocks[self._rows]
        blocks[self._cols] = blocks[self._cols] @ self._right
        return blocks


def _lower(upper: csr_matrix) -> csc_matrix:
    """The upper triangle by rows as the lower one by columns: the same arrays."""
    return csc_matrix((upper.data, upper.indices, upper.indptr), upper.shape)
