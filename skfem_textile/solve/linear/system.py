"""Linear system on the free unknowns."""

from typing import Any, NamedTuple
from weakref import WeakKeyDictionary, WeakValueDictionary

import numpy as np
from numpy import ndarray
from scipy.sparse import csc_matrix, csr_matrix

from ...mesh.pattern import Pattern, index_type, matrix_of_slots, with_data
from ..conditions import Constraints
from .solver import SolverOfPattern
from .unknowns import Unknowns

# Systems in use, by pattern, and by name of the solver and free unknowns.
_KNOWN: WeakKeyDictionary[Pattern, WeakValueDictionary[Any, "System"]] = (
    WeakKeyDictionary()
)


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
        diagonal, and from fixed to free unknowns.  Into ``sums @ entries`` instead, if
        there are sums.
    sums
        Matrix from the entries of the blocks to the entries of RᵀKR, with R of
        `Problem.turn`, if nodes move together; otherwise None, and `turned` has the
        entries.
    lower
        Pattern of the lower triangle.
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
        kind = index_type(n + n_fixed)
        number = np.empty(n + n_fixed, dtype=kind)  # free unknowns first
        number[free] = np.arange(n)
        number[fixed] = n + np.arange(n_fixed)

        slots, row, col = pattern.entries()
        self.sums: csr_matrix | None = None
        if constraints.shared.size:
            self.sums, row, col = _sums(pattern, constraints, number)
            slots = np.arange(len(row))
        else:
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
        ones = np.broadcast_to(1.0, self.upper.nnz)
        self.lower = csc_matrix((ones, self.upper.indices, self.upper.indptr), (n, n))
        pairs = pattern.rows, pattern.cols
        unknowns = Unknowns(positions, pairs, d, free, constraints.shared)
        self.solver = solver(self.lower, unknowns)

    @classmethod
    def of(
        cls,
        pattern: Pattern,
        positions: ndarray,
        constraints: Constraints,
        solver: SolverOfPattern,
    ) -> "System":
        """The system of another run with the same free unknowns, or a new one.

        The other run must still be in use.  Systems whose unknowns are rotated are not
        shared.
        """
        arguments = pattern, positions, constraints, solver
        if constraints.turn is not None or constraints.surfaces:
            return cls(*arguments)
        known = _KNOWN.setdefault(pattern, WeakValueDictionary())
        key = getattr(solver, "args", solver), constraints.free.tobytes()
        if (system := known.get(key)) is None:
            known[key] = system = cls(*arguments)
        return system

    def turned(self, blocks: ndarray, turn: csr_matrix) -> ndarray:
        """Blocks of a tangent in rotated unknowns, Rᵀ K R with R of `Problem.turn`."""
        d, pattern = self.dimension, self._pattern
        if self._turn is not turn:
            self._turn, R = turn, turn.tobsr(blocksize=(d, d)).data
            turned = np.any(np.eye(d) != R, axis=(1, 2))
            self._rows, self._cols = (
                slice(None) if turned.all() else np.flatnonzero(turned[nodes])
                for nodes in (pattern.rows, pattern.cols)
            )
            self._left = R[pattern.rows[self._rows]].swapaxes(1, 2)
            self._right = R[pattern.cols[self._cols]]
        blocks = blocks.copy()
        blocks[self._rows] = self._left @ blocks[self._rows]
        blocks[self._cols] = blocks[self._cols] @ self._right
        return blocks


def _sums(
    pattern: Pattern, constraints: Constraints, number: ndarray
) -> tuple[csr_matrix, ndarray, ndarray]:
    """Matrix from the entries of the blocks to RᵀKR, and rows and columns there.

    Its entries are in free rows, at and above the diagonal, with unknowns in the order
    ``number``, of which the first are free.
    """
    turn: Any = constraints.turn
    slots, row, col = pattern.entries()
    below = row > col
    slots = np.append(slots, slots[below])
    row, col = np.append(row, col[below]), np.append(col, row[below])
    entry, row, left = _expanded(turn[:, constraints.free], row)
    second, col, right = _expanded(turn, col[entry])
    row, col, weights = row[second], number[col], left[second] * right
    kept = row <= col
    key = row[kept].astype(np.int64) * len(number) + col[kept]
    distinct, target = np.unique(key, return_inverse=True)
    shape = len(distinct), pattern.dimension**2 * len(pattern.rows)
    positions = target, slots[entry[second][kept]]
    sums = csr_matrix((weights[kept], positions), shape)
    return sums, *np.divmod(distinct, len(number))


def _expanded(matrix: csr_matrix, rows: ndarray) -> tuple[ndarray, ndarray, ndarray]:
    """Entries of some rows of a matrix: index into ``rows``, column and value."""
    count = np.diff(matrix.indptr)[rows]
    index = np.repeat(np.arange(len(rows)), count)
    before = np.cumsum(count) - count
    entry = np.arange(len(index)) + np.repeat(matrix.indptr[rows] - before, count)
    return index, matrix.indices[entry], matrix.data[entry]


class Reduced(NamedTuple):
    """Tangent on the free unknowns, in elimination order.

    Attributes
    ----------
    upper
        Entries at and above the diagonal.
    coupling
        Matrix from the fixed to the free unknowns.
    """

    upper: csr_matrix
    coupling: csr_matrix


def reduced(system: System, blocks: ndarray, turn: csr_matrix | None = None) -> Reduced:
    """Blocks of a tangent reduced to the free unknowns, see `System`."""
    if turn is not None and system.sums is None:
        blocks = system.turned(blocks, turn)
    entries = blocks.ravel()
    if system.sums is not None:
        entries = system.sums @ entries
    both = system.upper, system.coupling
    return Reduced(*(with_data(slots, entries[slots.data]) for slots in both))


def largest_row(system: System, matrix: Reduced) -> float:
    """Largest absolute row sum in N/mm."""
    upper, coupling = matrix
    entries, diagonal, n = np.abs(upper.data), upper.indptr[:-1], upper.shape[0]
    rows = np.add.reduceat(entries, diagonal) - entries[diagonal]
    rows += with_data(system.lower, entries) @ np.ones(n)
    row = np.repeat(np.arange(n), np.diff(coupling.indptr))
    rows += np.bincount(row, np.abs(coupling.data), n)
    return float(rows.max(initial=0.0))
