"""Linear system on the free unknowns."""

import numpy as np
from numpy import ndarray
from scipy.sparse import csc_matrix, csr_matrix

from ...mesh.pattern import Pattern, matrix_of_slots
from ..conditions import Constraints
from .solver import SolverOfPattern
from .unknowns import Unknowns


class System:
    """Positions of the free unknowns in the tangent, and their linear solver.

    Parameters
    ----------
    pattern
        Pattern of the tangent.
    positions
        Positions of the nodes, shape (2, n_nodes).
    constraints
        Constraints of the other unknowns.
    solver
        Factory of the linear solver for their pattern.

    Attributes
    ----------
    dimension
        Number of displacement components.
    upper, coupling
        Indices into the entries of the blocks: of free unknowns at and above the
        diagonal, and from fixed to free unknowns.
    solver
        Linear solver for their pattern.
    """

    def __init__(
        self,
        pattern: Pattern,
        positions: ndarray,
        constraints: Constraints,
        solver: SolverOfPattern,
    ) -> None:
        self.dimension = d = pattern.dimension
        free, fixed = constraints.free, constraints.fixed
        n, n_fixed = len(free), len(fixed)
        number = np.empty(n + n_fixed, dtype=np.int64)  # free unknowns first
        number[free] = np.arange(n)
        number[fixed] = n + np.arange(n_fixed)

        slots, row, col = pattern.entries()
        row, col = np.sort([number[row], number[col]], axis=0)
        inside, across = col < n, (row < n) & (col >= n)
        self.upper = matrix_of_slots(slots[inside], row[inside], col[inside], (n, n))
        self.coupling = matrix_of_slots(
            slots[across], row[across], col[across] - n, (n, n_fixed)
        )
        self._pattern = pattern
        self._turn: csr_matrix | None = (
            None  # last rotation, whose rotated rows are cached
        )
        # The upper triangle in CSR is the lower one in CSC.
        upper = np.ones(self.upper.nnz), self.upper.indices, self.upper.indptr
        pairs = np.array([pattern.rows, pattern.cols])
        unknowns = Unknowns(positions, pairs, d, free)
        self.solver = solver(csc_matrix(upper, (n, n)), unknowns)

    def turned(self, blocks: ndarray, turn: csr_matrix) -> ndarray:
        """Blocks of a tangent in rotated unknowns, Rᵀ K R with R of `Problem.turn`."""
        d, pattern = self.dimension, self._pattern
        if self._turn is not turn:
            self._turn, R = turn, turn.tobsr(blocksize=(d, d)).data
            turned = np.any(np.eye(d) != R, axis=(1, 2))
            self._rows = np.flatnonzero(turned[pattern.rows])
            self._cols = np.flatnonzero(turned[pattern.cols])
            self._left = R[pattern.rows[self._rows]].swapaxes(1, 2)
            self._right = R[pattern.cols[self._cols]]
        blocks = blocks.copy()
        blocks[self._rows] = self._left @ blocks[self._rows]
        blocks[self._cols] = blocks[self._cols] @ self._right
        return blocks
