"""A ply under conditions, as its equilibrium iterations see it."""

from collections.abc import Callable, Mapping
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy import ndarray
from scipy.sparse import csr_matrix

from .body import Body, Supports
from .linear.solver import Clock, SingularMatrixError, SolverOfPattern
from .linear.system import System
from .states import NoEquilibriumError

if TYPE_CHECKING:
    from .conditions.surface_nodes import SurfaceNodes

# Share of the largest force that an equilibrium may leave unbalanced; under loads what
# comes back in the reactions is to be seen to ten digits.
_UNBALANCED, _UNBALANCED_LOADED = 1e-8, 1e-12

# Relative round-off of a number, and how much more a stretch has after the operations
# that lead to it: with that of one, macro-elements under a small load never balance
# (`pytest tests/solve/test_stepper.py -k round_off`).
_EPSILON, _ROUNDINGS = 2.0**-53, 4

# Share of the energy by which stiffnesses of the discretisation may be off on the way.
_NEARLY_SETTLED = 0.002

_MORE_STIFFNESS = (
    "holding the ply in more places, or more stabilisation or shear stiffness"
)

_NOT_FINITE = "a smaller load, more steps, or laws that are finite everywhere"


@dataclass(frozen=True, eq=False)
class Start:
    """Where an iteration starts: a displacement, and what the ply has there.

    Attributes
    ----------
    load_factor
        Load factor.
    u, f, load
        Displacement, nodal forces and those of the loads.
    energies
        Energy of each term in N·mm, those of loads aside.
    remembered
        What the ply remembers.
    tangent
        A tangent for the first increment; None where it is singular.
    """

    load_factor: float
    u: ndarray
    f: ndarray
    load: ndarray
    energies: Mapping[str, float]
    remembered: Mapping[str, Any]
    tangent: "Tangent | None" = None

    def again(self, problem: "Problem") -> "Start":
        """The same displacement and loads, with what the ply remembers now."""
        now = problem.ply.remembered
        if all(
            np.array_equal(array, now[term][0][name])
            for term, (parameters, _) in self.remembered.items()
            for name, array in parameters.items()
        ):
            return self
        return problem.at(self.load_factor).start(self.u)


class Problem:
    """A ply under conditions at one load factor: what an iteration needs to know.

    Parameters
    ----------
    ply, constraints
        The ply, and its conditions as fixed unknowns.
    solver
        Makes the linear solver of a pattern: the class of one, or `ChosenSolver` with
        the name that it is to take.

    Attributes
    ----------
    load_factor
        Load factor.
    corners_resist
        Whether corners resist; not on the way to a state in which all are open.
    held
        Forces in N that act beside the loads: what is not let go yet at rest.
    converged
        Share of the largest force that an equilibrium may leave unbalanced.
    holds_stiffness, remembers_path
        Whether terms remember stiffnesses at a state near the one that is sought, and
        whether they remember something else.

    Raises
    ------
    ValueError
        If a further term says why it is ``unsupported`` by the conditions.
    """

    def __init__(
        self, ply: Body, constraints: Supports, solver: SolverOfPattern
    ) -> None:
        self.ply = ply
        self.load_factor = 0.0
        self.corners_resist = True
        self.held: ndarray | float = 0.0
        self.constraints = constraints
        self._solver = solver
        self.clock = Clock()
        self.element_size = ply.element_size
        depend_on = {memory.depends_on for memory in ply.memories.values()}
        self.holds_stiffness = "state" in depend_on
        self.remembers_path = bool(depend_on - {"state"})
        for term in ply.further_terms:
            if reason := getattr(term, "unsupported", lambda _: "")(constraints):
                raise ValueError(f"load {term.name!r}: {reason}")
        loaded = "load" in ply.roles.values()
        self.converged = _UNBALANCED_LOADED if loaded else _UNBALANCED

    @cached_property
    def system(self) -> System:
        """Where the tangent's entries are among the free unknowns, on the clock."""
        clock, ply, constraints = self.clock, self.ply, self.constraints
        pattern = clock.time("assembly", lambda: ply.pattern)
        arguments = pattern, ply.nodes, constraints, self._solver
        return clock.time("solve", System, *arguments)

    def energy(self, u: ndarray) -> float:
        """Energy, potential of loads included, on the clock."""
        arguments = u, self.load_factor, self.corners_resist
        energy = self.clock.time("assembly", self.ply.energy, *arguments)
        return energy - float(np.sum(self.held * u))

    def residual(self, u: ndarray) -> ndarray:
        """Nodal forces, internal ones less loads, on the clock."""
        arguments = u, self.load_factor, self.corners_resist
        return self.clock.time("assembly", self.ply.residual, *arguments) - self.held

    def energies(self, u: ndarray) -> tuple[dict[str, float], dict[str, float]]:
        """Energies of the terms by name, and potentials of the loads, on the clock."""
        every = self.clock.time("assembly", self.ply.energies, u, self.load_factor)
        loads = [name for name, role in self.ply.roles.items() if role == "load"]
        potentials = {name: every.pop(name) for name in loads}
        return every, potentials

    def load(self, u: ndarray) -> ndarray:
        """Nodal forces of the loads."""
        return self.ply.load(u, self.load_factor) + self.held

    def settle(self, u: ndarray, tension: ndarray | None = None) -> bool:
        """Hold the stiffnesses at ``u`` in place of others, if that changes the energy.

        Parameters
        ----------
        u
            Displacement.
        tension
            Fibre tensions that take the place of those at ``u``, if given.

        Returns
        -------
        bool
            Whether it does, by more than a small share.
        """
        if not self.holds_stiffness:
            return False
        ply = self.ply
        held, (before, _) = ply.remembered, self.energies(u)
        if ply.settle(u, tension):
            after, _ = self.energies(u)
            energy = sum(before.values())
            if abs(sum(after.values()) - energy) > _NEARLY_SETTLED * abs(energy):
                return True
            ply.remembered = held
        return False

    def start(self, u: ndarray, tangent: "Tangent | None" = None) -> Start:
        """What starts an iteration, with what the ply remembers."""
        energies, _ = self.energies(u)
        f, load, remembered = self.residual(u), self.load(u), self.ply.remembered
        return Start(self.load_factor, u, f, load, energies, remembered, tangent)

    def forces_of(self, start: Start) -> ndarray:
        """Nodal forces at the start of an iteration, its load that of this problem."""
        return self.residual(start.u) if self.ply.follows_load_factor else start.f

    def at(self, load_factor: float) -> "Problem":
        """The same problem, on the same clock, at another load factor."""
        _ = self.system  # that both share it
        other = copy(self)
        other.load_factor = load_factor
        return other

    def holding(self, held: ndarray | float) -> "Problem":
        """The same problem, on the same clock, under forces beside the loads."""
        _ = self.system  # that both share it
        other = copy(self)
        other.held = held
        return other

    def without_corners(self) -> "Problem":
        """The same problem, on the same clock, in which no corner resists."""
        _ = self.system  # that both share it
        other = copy(self)
        other.corners_resist = False
        return other

    @property
    def in_space(self) -> bool:
        """Whether the ply may leave its plane."""
        return self.system.dimension == 3

    @property
    def surfaces(self) -> "SurfaceNodes | None":
        """The nodes on surfaces; None where there are none."""
        return self.constraints.surfaces

    def turn(self, u: ndarray) -> csr_matrix | None:
        """The map from the unknowns at a displacement to the plain ones.

        None where they are the same.  Those of nodes on a surface turn with it.
        """
        if self.surfaces is None:
            return self.constraints.turn
        return self.surfaces.turn(u, self.load_factor)

    def moved(self, u: ndarray, du: ndarray) -> ndarray:
        """The displacement after an increment, nodes brought back onto surfaces.

        Raises
        ------
        NoEquilibriumError
            If a node does not get there.
        """
        if self.surfaces is None:
            return u + du
        return self.surfaces.onto(u + du, self.load_factor)

    def free(self, f: ndarray, u: ndarray) -> ndarray:
        """Components of a DOF vector along the unknowns that are free at ``u``."""
        return turned(f, self.turn(u))[self.constraints.free]

    def unfixed(self, f: ndarray, u: ndarray) -> ndarray:
        """A DOF vector without its components along what is fixed at ``u``."""
        turn = self.turn(u)
        q = turned(f, turn).copy()
        q[self.constraints.fixed] = 0.0
        return plain(q, turn)

    def unbalanced(self, f: ndarray, u: ndarray) -> float:
        """Largest nodal force along the unknowns that are free at ``u``.

        Raises
        ------
        NoEquilibriumError
            If a nodal force is not finite, be it along a fixed unknown.
        """
        if not np.isfinite(f).all():
            raise NoEquilibriumError("the forces are not finite", advice=_NOT_FINITE)
        return float(np.abs(self.free(f, u)).max(initial=0.0))

    def reactions(self, f: ndarray) -> dict[str, ndarray]:
        """Sum of the nodal forces over the nodes of each condition, shape (d,)."""
        forces, nodes = self.ply.nodal(f), self.constraints.nodes
        return {name: forces[:, n].sum(axis=1) for name, n in nodes.items()}

    def held_forces(self, u: ndarray, f: ndarray) -> dict[str, ndarray]:
        """Nodal forces along what is fixed at ``u``, by condition, shape (d, n)."""
        held, nodes = self.ply.nodal(f - self.unfixed(f, u)), self.constraints.nodes
        return {name: held[:, n] for name, n in nodes.items()}

    def displacements(self, u: ndarray) -> dict[str, ndarray]:
        """Mean displacement of the nodes of each condition, shape (d,)."""
        moved, nodes = self.ply.nodal(u), self.constraints.nodes
        return {name: moved[:, n].mean(axis=1) for name, n in nodes.items()}

    def is_fixed(self, u: ndarray, fixed_values: ndarray) -> bool:
        """Whether the fixed unknowns have their values, to round-off of positions.

        And whether nodes are on their surfaces.
        """
        constraints, surfaces = self.constraints, self.surfaces
        off = turned(u, constraints.turn)[constraints.prescribed] - fixed_values
        size = np.abs(u).max(initial=0.0) + np.abs(self.ply.nodes).max()
        held = bool((np.abs(off) <= 8 * _EPSILON * size).all())
        return held and (surfaces is None or surfaces.are_on(u, self.load_factor))

    def least_area_ratio(self, u: ndarray) -> ndarray:
        """Smallest det F of each element; negative where it faces its surface wrongly.

        Elements on a surface are to face it as most of them do.
        """
        ply, ratio = self.ply, self.ply.least_area_ratio(u)
        if self.surfaces is None:
            return ratio
        d = len(ply.nodal(u))
        elements = ply.basis.element_dofs[::d] // d
        place = u, self.load_factor, elements, ply.normals(u)
        return ratio * self.surfaces.facing(*place)

    def in_domain(self, u: ndarray) -> bool:
        """Whether every law holds at ``u``, and has a finite energy."""
        if self.ply.fabric.unbounded:
            return True
        return self.ply.in_domain(u) and bool(np.isfinite(self.energy(u)))

    def around(self, u: ndarray) -> ndarray:
        """Elements at the node where a DOF vector is largest."""
        forces = self.ply.nodal(u)
        dof = len(forces) * np.linalg.norm(forces, axis=0).argmax()
        return np.flatnonzero((self.ply.basis.element_dofs == dof).any(axis=0))


class Tangent:
    """Tangent of a problem, factorised on the free unknowns.

    ``altered`` tells that it is not what the iteration wanted: that was indefinite.

    Parameters
    ----------
    problem
        The problem.
    u
        Displacement.
    tension
        Fibre tensions for the geometric stiffness in place of those of ``u``.
    convex
        Whether what resists shear is made positive semi-definite.
    contact
        Multipliers λ of nodes on surfaces in place of those of ``u``.

    Raises
    ------
    NoEquilibriumError
        If the tangent is singular.
    """

    def __init__(
        self,
        problem: Problem,
        u: ndarray,
        tension: ndarray | None = None,
        convex: bool = False,
        contact: ndarray | None = None,
    ) -> None:
        self._problem, clock, system = problem, problem.clock, problem.system
        self._u = u
        self.altered = False
        arguments = u, problem.load_factor, tension, problem.corners_resist, convex
        blocks = clock.time("assembly", problem.ply.stiffness, *arguments)
        self._turn = problem.turn(u)
        if problem.surfaces:
            self._blocks = blocks = _curved(problem, u, blocks, contact)
        if not np.isfinite(blocks.sum()):
            raise NoEquilibriumError("the tangent is not finite", advice=_NOT_FINITE)
        turn = self._turn if problem.surfaces else None
        self._matrix = clock.time("assembly", system.reduced, blocks, turn)
        factorise = system.solver.factorise
        clock.factorisations += 1
        try:
            self._factors = clock.time("solve", factorise, self._matrix.upper.data)
        except SingularMatrixError as error:
            raise NoEquilibriumError(str(error), advice=_MORE_STIFFNESS) from None

    @property
    def definite(self) -> bool:
        """Whether every small motion costs energy, but for those of fixed unknowns."""
        return self._factors.definite

    @cached_property
    def negative_pivots(self) -> int | None:
        """Number of negative eigenvalues; None where the factors do not tell."""
        try:
            return self._counted(lambda: self._factors.negative_pivots)
        except SingularMatrixError:
            return None

    @cached_property
    def stiffness(self) -> float:
        """Largest sum of magnitudes in a row."""
        return self._matrix.stiffness()

    def increment(self, f: ndarray, u: ndarray, fixed_values: ndarray) -> ndarray:
        """Solve K·du = −f, with the fixed unknowns brought to their values."""
        problem, turn, constraints = (
            self._problem,
            self._turn,
            self._problem.constraints,
        )
        fixed, free = constraints.fixed, problem.system.free
        prescribed, dq = constraints.prescribed, np.zeros_like(u)
        dq[prescribed] = fixed_values - turned(u, constraints.turn)[prescribed]
        if problem.surfaces:
            held = plain(dq, constraints.turn)
            dq = turned(problem.surfaces.motion(u, problem.load_factor, held), turn)
        b = -(turned(f, turn)[free] + self._matrix.coupling @ dq[fixed])
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
        self._problem.clock.solves += 1
        try:
            return self._counted(self._factors.solve, b)
        except SingularMatrixError as error:
            raise NoEquilibriumError(str(error), advice=_MORE_STIFFNESS) from None

    def _counted(self, function: Callable, *args: Any) -> Any:
        """Call on the clock what may have to factorise again."""
        clock, factors = self._problem.clock, self._factors
        before = factors.factorisations
        try:
            return clock.time("solve", function, *args)
        finally:
            clock.factorisations += factors.factorisations - before

    def tolerance(self, u: ndarray, f: ndarray) -> float:
        """A share of the largest force, and what round-off leaves in any case.

        Rounding moves nodes by 2⁻⁵³ of their displacement and changes gradients by
        2⁻⁵³, a few times on the way to a stretch; the stiffness turns both into forces.
        Nodes on surfaces are brought to positions, which are rounded as a whole.
        """
        problem = self._problem
        size = np.abs(u).max() + problem.element_size
        if problem.surfaces:
            size += np.abs(problem.ply.nodes).max()
        rounding = _ROUNDINGS * _EPSILON * size
        largest = np.abs(f).max()
        return float(problem.converged * largest + rounding * self.stiffness)


def turned(u: ndarray, turn: csr_matrix | None) -> ndarray:
    """A DOF vector in unknowns that are turned."""
    return u if turn is None else turn.T @ u


def plain(q: ndarray, turn: csr_matrix | None) -> ndarray:
    """A vector of unknowns that are turned as a DOF vector."""
    return q if turn is None else turn @ q


def _multipliers(problem: Problem, u: ndarray, f: ndarray) -> ndarray:
    """λ of nodes on surfaces, shape (n,): forces f across them over the slope of φ."""
    assert problem.surfaces
    contact = problem.surfaces.contact(u, problem.load_factor)
    across = (problem.ply.nodal(f)[:, contact.nodes] * contact.across).sum(axis=0)
    return across / contact.slope


def _curved(
    problem: Problem, u: ndarray, blocks: ndarray, contact: ndarray | None
) -> ndarray:
    """The blocks of a tangent less λ∇²φ of nodes on surfaces."""
    surfaces, pattern = problem.surfaces, problem.ply.pattern
    assert surfaces
    if contact is None:
        contact = _multipliers(problem, u, problem.residual(u))
    own = np.flatnonzero(pattern.rows == pattern.cols)[surfaces.nodes]
    blocks = blocks.copy()
    hessian = surfaces.hessian(u, problem.load_factor)
    blocks[own] -= contact[:, None, None] * hessian
    return blocks


def tangent_at(problem: Problem, u: ndarray) -> Tangent | None:
    """The consistent tangent; None where it is singular."""
    try:
        return Tangent(problem, u)
    except NoEquilibriumError:
        return None
