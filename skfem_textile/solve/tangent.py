"""Tangents: assembled, reduced to the free unknowns, factorised, and solved with.

On a surface φ = 0 a tangent is the second derivative of the energy less λ∇²φ, see
`SurfaceNodes`.
"""

from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy import ndarray
from scipy.sparse import csr_matrix

from ..ply.parameters import PlyParameters
from .conditions import plain, turned
from .linear.solver import SingularMatrixError
from .linear.system import System
from .problem import EPSILON, NOT_FINITE, Problem
from .states import NoEquilibriumError

# How many times the round-off of a number a stretch has after the operations that lead
# to it: with once, macro-elements under a small load never balance
# (`pytest tests/solve/test_equilibrium.py -k round_off`).
_ROUNDINGS = 4

_MORE_STIFFNESS = (
    "holding the ply in more places, or more stabilisation or shear stiffness"
)


class Tangent:
    """Tangent of a problem, factorised on the free unknowns.

    ``altered`` is True where an indefinite tangent was projected.

    Parameters
    ----------
    problem
        The problem.
    u, parameters
        Displacement, and parameters of the ply's terms.
    tension
        Fibre tensions for the geometric stiffness in place of the tensions at ``u``.
    positive
        Whether the matrices of the elements are projected onto positive semi-definite
        ones.
    contact
        Multipliers λ of nodes on surfaces in place of the multipliers at ``u``, 0 for a
        tangent without contact forces.

    Raises
    ------
    NoEquilibriumError
        If the tangent is singular.
    """

    def __init__(
        self,
        problem: Problem,
        u: ndarray,
        parameters: PlyParameters,
        tension: ndarray | None = None,
        positive: bool = False,
        contact: ndarray | float | None = None,
    ) -> None:
        self._problem, clock, system = problem, problem.clock, problem.system
        self._u = u
        self.altered = False
        arguments = u, problem.load_factor, parameters, tension, positive
        blocks = clock.time("assembly", problem.ply.stiffness, *arguments)
        self._turn = problem.turn(u)
        if problem.surfaces:
            self._blocks = blocks = _curved(problem, u, parameters, blocks, contact)
        if not np.isfinite(blocks.sum()):
            raise NoEquilibriumError("the tangent is not finite", advice=NOT_FINITE)
        self._matrix = clock.time("assembly", reduced, system, blocks, self._turn)
        factorise = system.solver.factorise
        clock.factorisations += 1
        try:
            self._factors = clock.time("solve", factorise, self._matrix.upper.data)
        except SingularMatrixError as error:
            raise NoEquilibriumError(str(error), advice=_MORE_STIFFNESS) from None

    @property
    def definite(self) -> bool:
        """Whether every small motion of the free unknowns costs energy."""
        return self._factors.definite

    @cached_property
    def negative_pivots(self) -> int | None:
        """Number of negative eigenvalues; None where the factors do not tell."""
        clock, factors = self._problem.clock, self._factors
        before = factors.factorisations
        try:
            return clock.time("solve", getattr, factors, "negative_pivots")
        except SingularMatrixError:
            return None
        finally:
            clock.factorisations += factors.factorisations - before

    def increment(self, f: ndarray, u: ndarray, fixed_values: ndarray) -> ndarray:
        """Solve K·du = −f, with the fixed unknowns brought to their values."""
        problem, turn, dq = self._problem, self._turn, np.zeros_like(u)
        constraints, free = problem.constraints, problem.system.free
        prescribed = constraints.prescribed
        dq[prescribed] = fixed_values - turned(u, constraints.turn)[prescribed]
        if problem.surfaces:
            held = plain(dq, constraints.turn)
            dq = turned(problem.surfaces.motion(u, problem.load_factor, held), turn)
        b = -(turned(f, turn)[free] + self._matrix.coupling @ dq[constraints.fixed])
        dq[free] = self._solve(b)
        return plain(dq, turn)

    def contact(self, f: ndarray, du: ndarray) -> ndarray | None:
        """Multipliers λ of nodes on surfaces after an increment, to first order.

        None where there are none.
        """
        problem = self._problem
        if not problem.surfaces:
            return None
        after = f + problem.ply.pattern.matrix(self._blocks) @ du
        return _multipliers(problem, self._u, after)

    def settled(self, f: ndarray) -> tuple[ndarray, ndarray]:
        """The motion that balances forces, and the forces after it, to first order."""
        problem, turn = self._problem, self._turn
        free, fixed = problem.system.free, problem.constraints.fixed
        motion, after, before = np.zeros_like(f), np.zeros_like(f), turned(f, turn)
        motion[free] = self._solve(-before[free])
        after[fixed] = before[fixed] + self._matrix.coupling.T @ motion[free]
        return plain(motion, turn), plain(after, turn)

    def softest(self) -> ndarray:
        """The motion with the least stiffness, its largest component 1.

        By inverse iteration from a vector without symmetry.
        """
        problem = self._problem
        q, free = np.zeros(problem.ply.basis.N), problem.system.free
        v = np.sin(free + 1.0)
        for _ in range(3):
            v = self._solve(v)
            v = v / np.abs(v).max(initial=1e-300)
        q[free] = v
        return plain(q, self._turn)

    def _solve(self, b: ndarray) -> ndarray:
        clock, factors = self._problem.clock, self._factors
        clock.solves += 1
        before = factors.factorisations
        try:
            return clock.time("solve", factors.solve, b)
        except SingularMatrixError as error:
            raise NoEquilibriumError(str(error), advice=_MORE_STIFFNESS) from None
        finally:
            clock.factorisations += factors.factorisations - before

    def tolerance(self, u: ndarray, f: ndarray) -> float:
        """A share of the largest force, and what round-off leaves in any case.

        Rounding moves nodes by 2⁻⁵³ of their displacement and changes gradients by
        2⁻⁵³, a few times on the way to a stretch; the stiffness, the largest sum of
        magnitudes in a row, turns both into forces.  Nodes on surfaces are brought to
        positions, which are rounded as a whole.
        """
        problem = self._problem
        size = np.abs(u).max() + problem.element_size
        if problem.surfaces:
            size += np.abs(problem.nodes).max()
        rounding = _ROUNDINGS * EPSILON * size
        upper, coupling = map(_magnitudes, self._matrix)
        free, fixed = (np.ones(n) for n in coupling.shape)
        rows = upper @ free + free @ upper - upper.diagonal() + coupling @ fixed
        stiffness = float(rows.max(initial=0.0))
        return float(problem.converged * np.abs(f).max() + rounding * stiffness)


def _magnitudes(matrix: csr_matrix) -> csr_matrix:
    """The magnitudes of the entries."""
    data = np.abs(matrix.data), matrix.indices, matrix.indptr
    return csr_matrix(data, matrix.shape)


def _multipliers(problem: Problem, u: ndarray, f: ndarray) -> ndarray:
    """λ of nodes on surfaces, shape (n,): forces f across them over the slope of φ."""
    assert problem.surfaces
    contact = problem.surfaces.contact(u, problem.load_factor)
    across = (problem.nodal(f)[:, contact.nodes] * contact.across).sum(axis=0)
    return across / contact.slope


def _curved(
    problem: Problem,
    u: ndarray,
    parameters: PlyParameters,
    blocks: ndarray,
    contact: ndarray | float | None,
) -> ndarray:
    """The blocks of a tangent less λ∇²φ of nodes on surfaces."""
    surfaces, pattern = problem.surfaces, problem.ply.pattern
    assert surfaces
    if contact is None:
        contact = _multipliers(problem, u, problem.residual(u, parameters))
    own = np.flatnonzero(pattern.rows == pattern.cols)[surfaces.nodes]
    blocks = blocks.copy()
    hessian = surfaces.hessian(u, problem.load_factor)
    blocks[own] -= np.reshape(contact, (-1, 1, 1)) * hessian
    return blocks


def tangent_at(
    problem: Problem, u: ndarray, parameters: PlyParameters
) -> Tangent | None:
    """The consistent tangent; None where it is singular."""
    try:
        return Tangent(problem, u, parameters)
    except NoEquilibriumError:
        return None


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


def reduced(system: System, blocks: ndarray, turn: csr_matrix | None = None) -> Reduced:
    """The blocks of a tangent as the free unknowns see it.

    Parameters
    ----------
    system
        Where their entries are.
    blocks
        The blocks.
    turn
        The map from the unknowns to the plain ones; None where they are the same.
    """
    if turn is not None:
        blocks = system.turned(blocks, turn)
    entries = blocks.ravel()
    upper, coupling = (
        csr_matrix((entries[slots.data], slots.indices, slots.indptr), slots.shape)
        for slots in (system.upper, system.coupling)
    )
    return Reduced(upper, coupling)
