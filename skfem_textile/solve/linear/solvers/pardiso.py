"""MKL's PARDISO through pypardiso."""

from functools import cached_property
from weakref import finalize

import numpy as np
from numpy import ndarray
from scipy.sparse import csc_matrix, csr_matrix
from scipy.sparse.linalg import SuperLU as Decomposition

from ....registration import SolverRegistration
from ..solver import OneAtATime, SingularMatrixError
from .superlu import SuperLU

# Types of matrices and phases, as its manual numbers them.
_SYMMETRIC_INDEFINITE = -2
_ANALYSE, _FACTORISE, _SOLVE = 11, 22, 33

# Entries of its array of parameters, counted from 1 as in its manual.
_OWN_PARAMETERS, _ORDER_GIVEN, _REFINEMENTS, _LEAST_PIVOT = 1, 5, 8, 10
_PERTURBED, _NEGATIVE = 14, 23

# Number of its error where a pivot vanishes.
_ZERO_PIVOT = -4

# Unknowns from which the time to import it is repaid, see ``docs/speed.md``.
_REPAID_FROM = 20_000


class Pardiso(OneAtATime):
    """LDLᵀ factors, for matrices that may be indefinite: they tell the inertia.

    Parameters
    ----------
    lower
        As of `Solver`.
    """

    def __init__(self, lower: csc_matrix) -> None:
        from pypardiso import PyPardisoSolver  # when the first system is to be solved

        self.lower = lower
        # The lower triangle by columns is the upper one by rows.
        self._A = csr_matrix(
            (np.ones(lower.nnz), lower.indices, lower.indptr), lower.shape
        )
        solver = PyPardisoSolver(mtype=_SYMMETRIC_INDEFINITE)
        solver.perm = np.arange(1, lower.shape[0] + 1, dtype=np.int32)
        for number, value in (
            (_OWN_PARAMETERS, 1),
            (_ORDER_GIVEN, 1),
            (_REFINEMENTS, 1),
            (_LEAST_PIVOT, 13),
        ):
            solver.set_iparm(number, value)
        self._solver = solver
        finalize(self, solver.free_memory, everything=True)
        self.call(_ANALYSE)

    @cached_property
    def pivoting(self) -> SuperLU:
        """What solves where the matrix is indefinite: PARDISO pivots in blocks only."""
        return SuperLU(self.lower)

    def factorise(self, data: ndarray) -> "PardisoFactors":
        """Factors of the matrix with the entries ``data``."""
        return PardisoFactors(self, data)

    def call(
        self, phase: int, data: ndarray | None = None, b: ndarray | None = None
    ) -> ndarray:
        """One phase of the solver."""
        if data is not None:
            self._A.data = data
        if not self._A.nnz:
            return np.empty(0)
        self._solver.set_phase(phase)
        none = np.zeros(self._A.shape[0])
        return self._solver._call_pardiso(self._A, none if b is None else b)

    def told(self, number: int) -> int:
        """One of its parameters."""
        return int(self._solver.get_iparm(number))


class PardisoFactors:
    """See `Factors`."""

    def __init__(self, solver: Pardiso, data: ndarray) -> None:
        self._solver, self._data = solver, data
        self.factorisations = 0
        solver.hold(self)

    @property
    def negative_pivots(self) -> int:
        """The inertia that came with the factors."""
        if self._negative is None:
            raise SingularMatrixError
        return self._negative

    @property
    def definite(self) -> bool:
        """Whether no pivot is negative, and none of them round-off."""
        return self._negative == 0

    def refactorise(self) -> None:
        """Factors and inertia."""
        from pypardiso.pardiso_wrapper import PyPardisoError

        solver = self._solver
        try:
            solver.call(_FACTORISE, self._data)
        except PyPardisoError as error:
            if error.value != _ZERO_PIVOT:
                raise
            self._negative = None
        else:
            singular = solver.told(_PERTURBED) > 0
            self._negative = None if singular else solver.told(_NEGATIVE)

    def solve(self, b: ndarray) -> ndarray:
        """Solve A x = b."""
        if not self.definite:
            return self._pivoted.solve(b)
        self._solver.hold(self)
        return self._solver.call(_SOLVE, self._data, b)

    @cached_property
    def _pivoted(self) -> Decomposition:
        self.factorisations += 1
        return self._solver.pivoting.pivoted(self._data)


REGISTRATION = SolverRegistration(
    name="pardiso",
    description="MKL's PARDISO",
    build=Pardiso,
    module="pypardiso",
    unknowns=_REPAID_FROM,
    rival=True,
    rank=2,
)
