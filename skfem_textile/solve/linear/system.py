"""The linear system that constraints leave of a tangent, its places found once."""

from typing import NamedTuple, Protocol

import numpy as np
from numpy import ndarray
from scipy.sparse import csc_matrix, csr_matrix

from ...mesh.pattern import Pattern, matrix_of_slots
from .dissection import nested_dissection
from .solver import SolverOfPattern


class Fixing(Protocol):
    """Which unknowns are fixed and which are free, and how inclined ones are turned."""

    free: ndarray
    fixed: ndarray
    turn: csr_matrix | None


class Reduced(NamedTuple):
    """A tangent on the free unknowns, in the order of elimination.

    Attributes
    ----------
    upper
        Its entries at and above the diagonal.
    coupling
        The matrix from the fixed unknowns to the free ones.
    """

    upper: csr_matrix
    coupling: csr_matrix

    def stiffness(self) -> float:
        """Largest sum of magnitudes in a row, coupling and all."""
        upper, coupling = abs(self.upper), abs(self.coupling)
        rows = upper.sum(axis=1).A1 + upper.sum(axis=0).A1 - upper.diagonal()
        return float((rows + coupling.sum(axis=1).A1).max(initial=0.0))


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
        self._upper = matrix_of_slots(slots[inside], row[inside], col[inside], (n, n))
        self._coupling = matrix_of_slots(
            slots[across], row[across], col[across] - n, (n, n_fixed)
        )
        self._pattern, turn = pattern, constraints.turn
        self._turn = None if turn is None else _Turn(pattern, turn)
        self.solver = solver(_lower(self._upper))

    def reduced(self, blocks: ndarray, turn: csr_matrix | None = None) -> Reduced:
        """The blocks of a tangent as the free unknowns see it.

        Parameters
        ----------
        blocks
            The blocks.
        turn
            What takes the place of the turn of the constraints.
        """
        turned = self._turn if turn is None else _Turn(self._pattern, turn)
        if turned:
            blocks = turned(blocks)
        return Reduced(*(_at(blocks, slots) for slots in (self._upper, self._coupling)))


class _Turn:
    """Blocks in the unknowns of inclined conditions, Rᵀ K R."""

    def __init__(self, pattern: Pattern, turn: csr_matrix) -> None:
        d = pattern.dimension
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


def _at(blocks: ndarray, slots: csr_matrix) -> csr_matrix:
    data = blocks.ravel()[slots.data]
    return csr_matrix((data, slots.indices, slots.indptr), slots.shape)


def _lower(upper: csr_matrix) -> csc_matrix:
    """The upper triangle by rows as the lower one by columns: the same arrays."""
    return csc_matrix((upper.data, upper.indices, upper.indptr), upper.shape)
