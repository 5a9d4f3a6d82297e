"""Ply under conditions at one load factor: residual, energies and tangent.

A tangent is assembled, reduced to the free unknowns and factorised.  On a surface φ = 0
it is the second derivative of the energy less λ∇²φ, see `SurfaceNodes`.
"""

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy import ndarray
from scipy.sparse import csr_matrix

from ..mesh.bases import components, node_positions
from ..ply import Ply
from ..ply.parameters import PlyParameters
from ..ply.terms import ContactTerm
from .conditions import Constraints, plain, reactions, turned
from .contact_points import between_tools, couple, curved
from .linear.scaling import ROUND_OFF, SingularMatrixError
from .linear.solver import Clock, SolverOfPattern
from .linear.system import System, largest_row, reduced
from .states import NoEquilibriumError

#: Relative round-off of a number.
EPSILON = 2.0**-53

#: Advice for forces or a tangent that are not finite.
NOT_FINITE = "a smaller load, more steps, or laws that are finite everywhere"

# Relative tolerance of the residual; under loads it is smaller, so that the reactions
# balance them to ten digits.
_UNBALANCED, _UNBALANCED_LOADED = 1e-8, 1e-12

# Largest round-off in the tolerance of the residual, as a share of the largest nodal
# force.  Forces then balance loads to a thousandth.
_ROUND_OFF_OF_FORCES = 1e-3

# Displacement, relative to the sizes and motions of ply and tools, beyond which nothing
# stops a ply.  The first increments of soft plies are several times their size.
_FAR = 100.0

# Ratio of stiffnesses, times the limit for pivots, from which a pivot may be round-off
# without a mechanism: pivots are smaller than the stiffness of an element.
_OVER_ROUND_OFF = 0.1

#: Round-off of a stretch, in units of the round-off of a number: with one unit,
#: macro-elements under a small load take more than four times as many solves (`pytest
#: -m slow tests/solve/test_equilibrium.py -k round_off`).
ROUNDINGS = 4

#: Advice for a ply that nothing stops.
HOLD = "supports, or a tool on the side to which the loads push the ply"

_MORE_STIFFNESS = "more supports, or a larger stabilisation or shear stiffness"

_CLOSER_STIFFNESSES = "softer fibres, or a larger shear or bending stiffness"


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Forces and energies at a displacement: an initial guess or an accepted state.

    Attributes
    ----------
    load_factor
        Load factor.
    u, f, load
        Displacement, nodal forces, and nodal forces of the loads.
    energies
        Energy of each term in N·mm, without loads.
    parameters
        Parameters of the ply's terms.
    tangent
        A `Tangent` for the first increment; None where it is singular.
    keeps_parameters
        True if an iteration between tools does not update the parameters.
    tension
        Fibre tensions for the first tangent between tools, by default those at ``u``.
    """

    load_factor: float
    u: ndarray
    f: ndarray
    load: ndarray
    energies: dict[str, float]
    parameters: PlyParameters
    tangent: Any = None
    keeps_parameters: bool = False
    tension: ndarray | None = None


class Problem:
    """Ply under conditions at one load factor.

    Parameters
    ----------
    ply, constraints
        The ply, and its conditions as fixed unknowns.
    solver
        Factory of the linear solver for a sparsity pattern: a solver class, or
        `ChosenSolver` with a name.

    Attributes
    ----------
    load_factor
        Load factor.
    propping
        Nodal forces in N that balance the undeformed ply; the search for the
        equilibrium at rest removes them gradually.
    converged
        Relative tolerance of the residual.
    element_size
        Size of the largest element in mm.
    nodes
        Reference positions of the nodes, shape (2, n_nodes).
    in_space
        True if the displacement has three components.
    surfaces
        Nodes on surfaces; None if there are none.
    loaded, line_search
        True if there are loads, or a term with a ``line_search``, respectively.
    moves
        True if supports, surfaces or tools move after the load factor 0.
    contacts, tools, rubbing, balancing, clamps
        Terms of contact with tools and between plies, those with tools, those and
        holders with friction, self-balancing loads, and clamps.
    endings
        Constraints after each load factor at which conditions will end.

    Raises
    ------
    ValueError
        If a term is ``unsupported`` under the conditions, or a tool or clamp has the
        name of a condition.
    """

    def __init__(
        self,
        ply: Ply,
        constraints: Constraints,
        solver: SolverOfPattern,
        endings: dict[float, Constraints] | None = None,
    ) -> None:
        self.ply, self.endings = ply, endings or {}
        self.load_factor = 0.0
        self.propping: ndarray | float = 0.0
        self.constraints = constraints
        self._solver, self.clock = solver, Clock()
        self._known: dict[str, Any] = {}  # the system, and the pattern it belongs to
        self.element_size = ply.basis.mesh.param()
        self.nodes, self._dimension = node_positions(ply.basis), components(ply.basis)
        self.in_space = self._dimension == 3
        self.surfaces = constraints.surfaces
        self.line_search = any(term.line_search for term in ply.terms)
        for term in ply.terms:
            if reason := getattr(term, "unsupported", lambda _: "")(constraints):
                what = getattr(term, "what", f"load {term.name!r}")
                raise ValueError(f"{what}: {reason}")
        self.balancing = [term for term in ply.terms if term.balances]
        self._loads = [term.name for term in ply.terms if term.role == "load"]
        self.contacts = [x for x in ply.terms if isinstance(x, ContactTerm)]
        self.tools = [x for x in self.contacts if not x.of_plies]
        self.rubbing: list[Any] = [x for x in ply.terms if getattr(x, "friction", None)]
        self.has_friction = ply.fabric.has_friction or bool(self.rubbing)
        self.clamps: list[Any] = [x for x in ply.terms if x.release is not None]
        for kind, terms in ("tool", self.tools), ("clamp", self.clamps):
            for term in terms:
                if term.name in constraints.nodes:
                    raise ValueError(
                        f"a {kind} and a condition have the name {term.name!r}, under "
                        "which both report a reaction: rename one of them"
                    )
        self.loaded = len(self._loads) > len(self.contacts)
        self.converged = _UNBALANCED_LOADED if self.loaded else _UNBALANCED
        self.moves = True

    @property
    def system(self) -> System:
        """`System` of the free unknowns, see `System.of`; its construction is timed."""
        clock, ply, known = self.clock, self.ply, self._known
        pattern = clock.time("assembly", lambda: ply.pattern)
        if known.get("pattern") is not pattern:
            arguments = pattern, self.nodes, self.constraints, self._solver
            system = clock.time("solve", System.of, *arguments)
            known |= {"pattern": pattern, "system": system}
        return known["system"]

    def energy(self, u: ndarray, parameters: PlyParameters) -> float:
        """Energy in N·mm, potentials of loads included."""
        arguments = u, self.load_factor, parameters
        energies = self.clock.time("assembly", self.ply.energies, *arguments)
        return sum(energies.values()) - float(np.sum(self.propping * u))

    def residual(self, u: ndarray, parameters: PlyParameters) -> ndarray:
        """Nodal forces in N: internal forces less loads."""
        state = u, self.load_factor, parameters
        return self.clock.time("assembly", self.ply.residual, *state) - self.propping

    def energies(
        self, u: ndarray, parameters: PlyParameters
    ) -> tuple[dict[str, float], dict[str, float]]:
        """Energies of the terms by name, and potentials of the loads.

        Without the incremental potential of friction with tools, which belongs to a
        step.
        """
        arguments = u, self.load_factor, parameters
        every = self.clock.time("assembly", self.ply.energies, *arguments)
        every |= {
            x.name: x.potential(u, self.load_factor, parameters[x.name])
            for x in self.rubbing
        }
        potentials = {name: every.pop(name) for name in self._loads}
        return every, potentials

    def load(self, u: ndarray, parameters: PlyParameters) -> ndarray:
        """Nodal forces of the loads and tools."""
        return self.ply.load(u, self.load_factor, parameters) + self.propping

    def acting_force(self, f: ndarray, u: ndarray, parameters: PlyParameters) -> float:
        """Largest nodal force in N, ``f`` included, where loads act; otherwise 0.

        Contact with tools is not a load.
        """
        every = [term for term in self.ply.terms if term.role == "load"]
        loads = [term for term in every if term not in self.contacts]
        arguments = u, self.load_factor, parameters
        load = self.propping - self.ply.residual(*arguments, loads)
        if not load.any():
            return 0.0
        of_tools = self.load(u, parameters) - load
        return max(float(np.abs(x).max()) for x in (f, load, of_tools))

    def flies(self, u: ndarray, fixed_values: ndarray) -> bool:
        """True if a displacement far exceeds the sizes and motions in the problem."""
        far, t = np.abs(u).max(initial=0.0), self.load_factor
        size = self._size + np.abs(fixed_values).max(initial=0.0)
        size += sum(np.linalg.norm(x.travel(t)) for x in self.contacts)
        if self.surfaces and far > _FAR * size:
            size += self.surfaces.farthest(t)
        return bool(not far <= _FAR * size)

    def singular(
        self, where: str = "", advice: str = _MORE_STIFFNESS
    ) -> NoEquilibriumError:
        """Error for a singular tangent, with its cause and advice.

        The cause is a mechanism, or round-off of stiffnesses that are too different.
        """
        fabric, cause = self.ply.fabric, "a mechanism is present"
        rest = np.zeros(self.ply.basis.dx.shape)
        sizes = [float(np.mean(law.tangent(rest))) for law in fabric.at().laws]
        bending = (*fabric.bending_at_rest, fabric.twist)
        sizes += [float(np.mean(D)) / self.element_size**2 for D in bending]
        ratio = max(sizes) / min((x for x in sizes if x > 0), default=np.inf)
        if ratio >= _OVER_ROUND_OFF / ROUND_OFF:
            cause = (
                "round-off, because the largest stiffness of the fabric is "
                f"{ratio:.1g} times the smallest"
            )
            advice = _CLOSER_STIFFNESSES
        return NoEquilibriumError(f"singular tangent{where}: {cause}", advice=advice)

    def beyond(self, u: ndarray, message: str, advice: str) -> NoEquilibriumError:
        """Error for a displacement beyond the domain of a law, which it names."""
        end = self.ply.closest_end(u, self.load_factor)
        if end is None:
            return NoEquilibriumError(message, advice=advice)
        return NoEquilibriumError(
            f"{message}: {end}", end.elements, advice, end.quantity
        )

    @cached_property
    def _size(self) -> float:
        """Extent of the ply and the tools at rest in mm."""
        size, rest = float(np.ptp(self.nodes, axis=1).max()), self.ply.basis.zeros()
        gaps = [gap for tool in self.contacts for gap in tool.gaps(rest, 0.0)]
        return size + float(np.abs(gaps).max(initial=0.0, where=np.isfinite(gaps)))

    def evaluation(
        self, u: ndarray, parameters: PlyParameters, tangent: Any = None
    ) -> Evaluation:
        """Forces and energies at ``u``."""
        energies, _ = self.energies(u, parameters)
        f, load = self.residual(u, parameters), self.load(u, parameters)
        return Evaluation(self.load_factor, u, f, load, energies, parameters, tangent)

    def at(self, load_factor: float, propping: ndarray | float = 0.0) -> "Problem":
        """The same problem, with the same clock, at another load factor."""
        self.ply.uncouple()
        _ = self.system, self._size  # so that both share them
        other = copy(self)
        other.load_factor, other.propping = load_factor, propping
        return other

    def ended(self, load_factor: float) -> "Problem":
        """The same problem without the conditions that end at a load factor."""
        other = copy(self)
        other._known = {}
        other.constraints = after = self.endings[load_factor]
        other.surfaces = after.surfaces
        other.endings = {t: x for t, x in self.endings.items() if t > load_factor}
        return other

    def let_go(self, before: PlyParameters, after: PlyParameters) -> list[str]:
        """Names of the clamps that let go between two values of all parameters."""
        at = "released_at"
        names = [x.name for x in self.clamps if x.parameters]
        return [name for name in names if after[name][at] < before[name][at]]

    def turn(self, u: ndarray) -> csr_matrix | None:
        """Matrix from the unknowns at a displacement to the Cartesian unknowns.

        None if they are the same.  The unknowns of nodes on a surface rotate with it.
        """
        if self.surfaces is None:
            return self.constraints.turn
        return self.surfaces.turn(u, self.load_factor)

    def moved(self, u: ndarray, du: ndarray) -> ndarray:
        """Displacement after an increment, with nodes projected back onto surfaces.

        Raises an error if the projection of a node fails.
        """
        u = u + du
        return self.surfaces.onto(u, self.load_factor) if self.surfaces else u

    def motions_of_supports(self, u: ndarray) -> ndarray:
        """Unit motion of each prescribed unknown, along the surfaces of its node.

        Shape (n_prescribed, n_unknowns).
        """
        turn, prescribed = self.constraints.turn, self.constraints.prescribed
        units = np.zeros((len(prescribed), len(u)))
        units[np.arange(len(prescribed)), prescribed] = 1.0
        t, motions = self.load_factor, [plain(unit, turn) for unit in units]
        if self.surfaces:
            motions = [self.surfaces.motion(u, t, x, along=True) for x in motions]
        return np.array(motions)

    def unfixed(self, f: ndarray, u: ndarray) -> ndarray:
        """Project a DOF vector onto the free directions at ``u``."""
        turn = self.turn(u)
        q = turned(f, turn).copy()
        q[self.constraints.fixed] = 0.0
        return plain(q, turn)

    def unbalanced(self, f: ndarray, u: ndarray) -> float:
        """Largest nodal force along the free unknowns at ``u``.

        Raises an error if any nodal force, free or fixed, is not finite.
        """
        if not np.isfinite(f).all():
            raise NoEquilibriumError("the forces are not finite", advice=NOT_FINITE)
        free = turned(f, self.turn(u))[self.constraints.free]
        return float(np.abs(free).max(initial=0.0))

    def nodal(self, u: ndarray) -> ndarray:
        """DOF vector as one column per node, shape (d, n_nodes)."""
        return u.reshape(-1, self._dimension).T

    def forces(self, f: ndarray) -> dict[str, ndarray]:
        """Sum of the nodal forces over the nodes of each condition, shape (d,)."""
        forces, nodes = self.nodal(f), self.constraints.nodes
        return {name: forces[:, n].sum(axis=1) for name, n in nodes.items()}

    def reactions(self, f: ndarray, u: ndarray) -> dict[str, ndarray]:
        """Force of each condition on the ply, see `reactions`."""
        return reactions(self.constraints, self.nodal(f), u, self.load_factor)

    def is_fixed(self, u: ndarray, fixed_values: ndarray) -> bool:
        """True if fixed unknowns have their values, and nodes are on surfaces."""
        constraints = self.constraints
        off = turned(u, constraints.turn)[constraints.prescribed] - fixed_values
        size = np.abs(u).max(initial=0.0) + np.abs(self.nodes).max()
        size *= constraints.rounding
        surfaces, t = self.surfaces, self.load_factor
        reached = bool((np.abs(off) <= 8 * EPSILON * size).all())
        return reached and (not surfaces or surfaces.are_on(u, t))

    def in_domain(self, u: ndarray, parameters: PlyParameters) -> bool:
        """True if every law is defined at ``u`` and has a finite energy."""
        if self.ply.fabric.unbounded:
            return True
        return self.ply.in_domain(u) and bool(np.isfinite(self.energy(u, parameters)))

    def area_ratio(self, u: ndarray) -> ndarray:
        """Smallest det F of each element; negative if it is inverted.

        On a surface, an element is inverted if it faces opposite to most elements.
        """
        ply, ratio = self.ply, self.ply.least_area_ratio(u)
        if self.surfaces is None:
            return ratio
        elements = ply.basis.element_dofs[:: self._dimension] // self._dimension
        arguments = u, self.load_factor, elements, ply.normals(u)
        return ratio * self.surfaces.facing(*arguments)

    def blocks(
        self, u: ndarray, contact_forces: Any, parameters: PlyParameters, *how: Any
    ) -> ndarray:
        """Blocks of the tangent, see `Tangent.at`."""
        ply, t = self.ply, self.load_factor
        couple(ply, self.contacts, u, parameters)
        arguments = u, t, parameters, *how
        blocks = self.clock.time("assembly", ply.stiffness, *arguments)
        if contact_forces is None and self.surfaces:
            f = self.nodal(self.residual(u, parameters))
            contact_forces = self.surfaces.forces(u, t, f)
        blocks = curved(ply, u, t, blocks, self.surfaces, contact_forces)
        if not self.tools:
            return blocks
        return between_tools(ply, self.contacts, u, t, parameters, blocks)

    def around(self, u: ndarray) -> ndarray:
        """Elements at the node where a DOF vector is largest."""
        forces = self.nodal(u)
        dof = len(forces) * np.linalg.norm(forces, axis=0).argmax()
        return np.flatnonzero((self.ply.basis.element_dofs == dof).any(axis=0))


class Tangent:
    """Factorised tangent of a problem on the free unknowns.

    ``definite`` is True if it is positive definite on the free unknowns, ``projected``
    if an indefinite tangent was projected.

    Parameters
    ----------
    problem, u
        The problem, and the displacement.
    assemble
        Computes its blocks; kept only with nodes on surfaces, which need them again.

    Raises
    ------
    NoEquilibriumError
        If the tangent is singular.
    """

    def __init__(self, problem: Problem, u: ndarray, assemble: Callable) -> None:
        self._problem, clock, system = problem, problem.clock, problem.system
        self._u, self._computed, self._turn = u, assemble, problem.turn(u)
        self.projected, blocks = False, assemble()
        if problem.surfaces:
            self._matrix = problem.ply.pattern.matrix(blocks)
        if not np.isfinite(blocks.sum()):
            raise NoEquilibriumError("the tangent is not finite", advice=NOT_FINITE)
        matrix = clock.time("assembly", reduced, system, blocks, self._turn)
        self._coupling, self._largest_row = matrix.coupling, largest_row(system, matrix)
        factorise = system.solver.factorise
        clock.factorisations += 1
        try:
            self._factors = clock.time("solve", factorise, matrix.upper.data)
        except SingularMatrixError:
            raise problem.singular() from None
        self.definite: bool = self._factors.definite

    @classmethod
    def at(
        cls,
        problem: Problem,
        u: ndarray,
        parameters: PlyParameters,
        tension: ndarray | None = None,
        positive: bool = False,
        contact_forces: ndarray | float | None = None,
        stretched: bool = False,
    ) -> "Tangent":
        """The tangent at a displacement.

        Parameters
        ----------
        problem, u, parameters
            The problem, displacement, and parameters of the ply's terms.
        tension
            Fibre tensions for the geometric stiffness, instead of the tensions at
            ``u``.
        positive, stretched
            See `Ply.stiffness`.
        contact_forces
            Contact forces of nodes on surfaces, shape (n_nodes,), instead of those at
            ``u``; 0 for a tangent without contact forces.
        """
        arguments = u, contact_forces, parameters, tension, positive, stretched
        return cls(problem, u, partial(problem.blocks, *arguments))

    @cached_property
    def _matrix(self) -> csr_matrix:
        """The tangent of all unknowns."""
        blocks = self._computed()
        return self._problem.ply.pattern.matrix(blocks)

    @cached_property
    def negative_pivots(self) -> int | None:
        """Number of negative eigenvalues; None if the factors do not determine it."""
        clock, factors = self._problem.clock, self._factors
        before = factors.factorisations
        try:
            return clock.time("solve", getattr, factors, "negative_pivots")
        except SingularMatrixError:
            return None
        finally:
            clock.factorisations += factors.factorisations - before

    def increment(self, f: ndarray, u: ndarray, fixed_values: ndarray) -> ndarray:
        """Solve K·du = −f, with the fixed unknowns set to their values."""
        problem, turn, dq = self._problem, self._turn, np.zeros_like(u)
        constraints, free = problem.constraints, problem.constraints.free
        prescribed = constraints.prescribed
        dq[prescribed] = fixed_values - turned(u, constraints.turn)[prescribed]
        if problem.surfaces:
            du = plain(dq, constraints.turn)
            dq = turned(problem.surfaces.motion(u, problem.load_factor, du), turn)
        b = -(turned(f, turn)[free] + self._coupling @ dq[constraints.fixed])
        dq[free] = self._solve(b)
        return plain(dq, turn)

    def motions(self) -> ndarray:
        """Linear response to a unit displacement of each prescribed unknown.

        Shape (n_prescribed, n_unknowns); see `Problem.motions_of_supports`.
        """
        problem, turn = self._problem, self._turn
        motions = problem.motions_of_supports(self._u)
        for i, motion in enumerate(motions):
            dq = turned(motion, turn)
            fixed = dq[problem.constraints.fixed]
            dq[problem.constraints.free] = self._solve(-self._coupling @ fixed)
            motions[i] = plain(dq, turn)
        return motions

    def contact_forces(self, f: ndarray, du: ndarray) -> ndarray | None:
        """Contact forces of nodes on surfaces after an increment, to first order.

        None if there are no such nodes.
        """
        problem = self._problem
        if not problem.surfaces:
            return None
        after = problem.nodal(f + self._matrix @ du)
        return problem.surfaces.forces(self._u, problem.load_factor, after)

    def equilibrated(self, f: ndarray) -> tuple[ndarray, ndarray]:
        """One linearised correction, and the nodal forces after it."""
        problem, turn = self._problem, self._turn
        free, fixed = problem.constraints.free, problem.constraints.fixed
        motion, after, before = np.zeros_like(f), np.zeros_like(f), turned(f, turn)
        motion[free] = self._solve(-before[free])
        after[fixed] = before[fixed] + self._coupling.T @ motion[free]
        return plain(motion, turn), plain(after, turn)

    def response(
        self, motion: ndarray, forces: ndarray | float = 0.0
    ) -> tuple[ndarray, ndarray]:
        """Linear response to a motion of fixed unknowns and to nodal forces.

        The motion of all unknowns, and the nodal forces after it.
        """
        moved = self._matrix @ motion
        correction, after = self.equilibrated(moved + forces)
        return motion + correction, after

    def stiffness(self, motion: ndarray) -> float:
        """Stiffness against a motion of the fixed unknowns, condensed.

        It is twice the energy of the linear response to the motion.
        """
        return float(motion @ self.response(motion)[1])

    def softest(self) -> ndarray:
        """Eigenvector of the smallest stiffness, with largest component 1.

        Computed by inverse iteration from a vector without symmetry.
        """
        problem = self._problem
        q, free = np.zeros(problem.ply.basis.N), problem.constraints.free
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
        except SingularMatrixError:
            raise self._problem.singular() from None
        finally:
            clock.factorisations += factors.factorisations - before

    def tolerance(self, u: ndarray, f: ndarray, parameters: PlyParameters) -> float:
        """Tolerance of the residual: a share of the largest force plus round-off.

        Where loads act, round-off counts up to a small share of the forces.  Before the
        first motion of supports and tools, which will cause larger forces, the
        round-off of the undeformed ply always counts.
        """
        problem = self._problem
        largest, round_off = float(np.abs(f).max()), self.round_off(u)
        if round_off > _ROUND_OFF_OF_FORCES * largest and problem.loaded:
            most = _ROUND_OFF_OF_FORCES * problem.acting_force(f, u, parameters)
            if most and problem.moves and not problem.load_factor:
                most = max(most, self.round_off(np.zeros_like(u)))
            round_off = min(round_off, most or np.inf)
        return problem.converged * largest + round_off

    def round_off(self, u: ndarray) -> float:
        """Round-off of nodal forces in N.

        Rounding moves nodes by 2⁻⁵³ of their displacement and changes gradients by
        2⁻⁵³, a few times in the computation of a stretch; the stiffness, as the largest
        absolute row sum, converts both to forces.  Nodes on surfaces are projected to
        positions, which are rounded as a whole.
        """
        problem = self._problem
        size = np.abs(u).max() + problem.element_size
        if problem.surfaces:
            size += np.abs(problem.nodes).max()
        return float(ROUNDINGS * EPSILON * size * self._largest_row)


def tangent_at(
    problem: Problem, u: ndarray, parameters: PlyParameters
) -> Tangent | None:
    """The consistent tangent; None if it is singular."""
    try:
        return Tangent.at(problem, u, parameters)
    except NoEquilibriumError:
        return None
