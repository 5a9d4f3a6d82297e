"""PETSc through petsc4py: MUMPS or an iterative method, on one or more MPI processes.

Every process assembles the whole system, passes its own rows to PETSc and receives the
whole solution.
"""

from functools import cached_property
from typing import Any
from weakref import finalize

import numpy as np
from numpy import ndarray
from scipy.sparse import csc_matrix

from ...mesh.pattern import matrix_of_slots
from .scaling import ROUND_OFF
from .solver import CountedPivots, LatestFactors
from .unknowns import Unknowns

#: Prefix of the options in PETSc's database.
PREFIX = "skfem_textile_"

# Parameters of MUMPS as numbered in its manual: no scaling; the root is factorised
# without ScaLAPACK, which does not count negative pivots; twice the estimated
# workspace; detection of null pivots by an absolute limit, which is a negative number.
_INTEGERS, _REALS = {8: 0, 13: 1, 14: 100, 24: 1}, {3: -ROUND_OFF}

# The entry of its results with the error number, and the numbers for singular matrices.
_ERROR, _SINGULAR = 1, (-6, -10)

# Relative tolerance and largest number of iterations of iterative methods.
_TOLERANCE, _MOST_ITERATIONS = 1e-12, 2000


class PETSc(LatestFactors):
    """LDLᵀ factors of MUMPS with the inertia, or an iterative method.

    The options of PETSc apply with the prefix `PREFIX`; an iterative method is selected
    by ``-skfem_textile_pc_type gamg``, for example, with conjugate gradients unless
    ``ksp_type`` is given.  MUMPS solves the systems that are then found indefinite or
    for which the iteration does not converge.  A matrix counts as definite if the
    iteration converges for a random right-hand side b, with b·x > 0, which does not
    prove it.  All calls are collective.

    Parameters
    ----------
    lower, unknowns
        See `Solver`.

    Attributes
    ----------
    iterative
        True if the options select a preconditioner of an iterative method.
    """

    def __init__(self, lower: csc_matrix, unknowns: Unknowns) -> None:
        from petsc4py import PETSc  # at the first solve

        self.lower, self._petsc, n = lower, PETSc, lower.shape[0]
        self._x = PETSc.Vec().createMPI(n)
        first, end = self._x.getOwnershipRange()
        self._own = slice(first, end)
        slots, row = np.arange(lower.nnz), lower.indices
        col = np.repeat(np.arange(n), np.diff(lower.indptr))
        here = (row >= first) & (row < end)
        mirrored = (col >= first) & (col < end) & (row > col)
        rows = matrix_of_slots(
            np.append(slots[here], slots[mirrored]),
            np.append(row[here], col[mirrored]) - first,
            np.append(col[here], row[mirrored]),
            (end - first, n),
        )
        self._slots = rows.data
        self._csr = [x.astype(PETSc.IntType) for x in (rows.indptr, rows.indices)]
        self._b = self._x.duplicate()
        self._A = PETSc.Mat().createAIJ((self._x.sizes, self._x.sizes), csr=self._csr)
        self._A.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        self._gather, self._whole = PETSc.Scatter.toAll(self._x)
        self._objects = [self._x, self._b, self._A, self._gather, self._whole]
        # Destruction is collective and must not depend on garbage collection.
        finalize(self, _destroy, self._objects)
        self.ksp = self._mumps()
        self.ksp.setTolerances(rtol=_TOLERANCE, max_it=_MOST_ITERATIONS)
        self.ksp.setFromOptions()
        self.iterative = self.ksp.getPC().getType() != "cholesky"
        if self.iterative:
            if self.ksp.getType() == "preonly":
                self.ksp.setType("cg")
            self._set_near_null_space(unknowns.motions)

    @cached_property
    def _direct(self) -> Any:
        return self._mumps() if self.iterative else self.ksp

    def _set_near_null_space(self, motions: ndarray) -> None:
        """Pass rigid-body motions, shape (n_motions, n), to multigrid methods."""
        vectors = []
        for motion in np.linalg.qr(motions.T)[0].T:
            vectors.append(self._x.duplicate())
            vectors[-1].setArray(motion[self._own])
        space = self._petsc.NullSpace().create(vectors=vectors)
        self._A.setNearNullSpace(space)
        _destroy([*vectors, space])

    def _mumps(self) -> Any:
        ksp = self._petsc.KSP().create()
        self._objects.append(ksp)
        ksp.setOptionsPrefix(PREFIX)
        ksp.setOperators(self._A)
        ksp.setType("preonly")
        pc = ksp.getPC()
        pc.setType("cholesky")
        pc.setFactorSolverType("mumps")
        pc.setFactorSetUpSolverType()
        factors = pc.getFactorMatrix()
        factors.setOptionsPrefix(PREFIX)
        for i, integer in _INTEGERS.items():
            factors.setMumpsIcntl(i, integer)
        for i, real in _REALS.items():
            factors.setMumpsCntl(i, real)
        return ksp

    def factorised(self, data: ndarray) -> tuple[int | None, Any]:
        """Inertia, and PETSc's solver of the matrix."""
        if not len(data):
            return 0, self.ksp
        self._A.setValuesCSR(*self._csr, data[self._slots])
        self._A.assemble()
        if self.iterative:
            b = np.random.default_rng(0).standard_normal(self.lower.shape[0])
            x = self._solve(self.ksp, b)
            if x is not None and b @ x > 0:
                return 0, self.ksp
        return self._inertia(), self._direct

    def solution(self, of: CountedPivots, b: ndarray) -> ndarray:
        """Solution of A x = b by MUMPS or the iterative method."""
        x = self._solve(of.factors, b)
        if x is None:
            raise RuntimeError("PETSc: the iterative method did not converge")
        return x

    def _inertia(self) -> int | None:
        """Number of negative pivots; None if the matrix is singular."""
        pc = self._direct.getPC()
        pc.setUp()  # unlike setUp of KSP, factorises after each change of the matrix
        factors = pc.getFactorMatrix()
        if (error := factors.getMumpsInfog(_ERROR)) < 0:
            if error in _SINGULAR:
                return None
            raise RuntimeError(f"MUMPS failed: INFOG(1) = {error}")
        negative, null, _ = factors.getInertia()
        return None if null else negative

    def _solve(self, ksp: Any, b: ndarray) -> ndarray | None:
        """The whole solution; None if the iteration did not converge."""
        if not len(b):
            return b
        self._b.setArray(b[self._own])
        ksp.solve(self._b, self._x)
        if ksp.getConvergedReason() < 0:
            return None
        self._gather.scatter(self._x, self._whole)
        return self._whole.getArray().copy()


def _destroy(objects: list[Any]) -> None:
    for one in reversed(objects):
        one.destroy()
