"""A ply under conditions at one load factor, and initial guesses of its equilibrium."""

from copy import copy
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy import ndarray
from scipy.sparse import csr_matrix

from ..mesh.bases import components, node_positions
from ..ply import Ply
from ..ply.parameters import Frozen, PlyParameters, Values
from .conditions import Constraints, plain, turned
from .linear.solver import Clock, SolverOfPattern
from .linear.system import System
from .states import NoEquilibriumError

#: Relative round-off of a number.
EPSILON = 2.0**-53

#: What to try where forces or a tangent are not finite.
NOT_FINITE = "a smaller load, more steps, or laws that are finite everywhere"

# Share of the largest force that an equilibrium may leave unbalanced; under loads what
# comes back in the reactions is to be seen to ten digits.
_UNBALANCED, _UNBALANCED_LOADED = 1e-8, 1e-12


@dataclass(frozen=True, eq=False)
class Start:
    """Initial guess of an iteration: a displacement, with forces and energies there.

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
    """

    load_factor: float
    u: ndarray
    f: ndarray
    load: ndarray
    energies: dict[str, float]
    parameters: PlyParameters
    tangent: Any = None


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
    held
        Forces in N that act beside the loads: what is not let go yet at rest.
    converged
        Share of the largest force that an equilibrium may leave unbalanced.
    element_size
        Size of the largest element in mm.
    nodes
        Reference positions of the nodes, shape (2, n_nodes).
    in_space
        Whether the ply may leave its plane.
    surfaces
        The nodes on surfaces; None where there are none.
    loaded, line_search
        Whether there are loads, and whether a term has a ``line_search``.

    Raises
    ------
    ValueError
        If a term says why it is ``unsupported`` by the conditions.
    """

    def __init__(
        self, ply: Ply, constraints: Constraints, solver: SolverOfPattern
    ) -> None:
        self.ply = ply
        self.load_factor = 0.0
        self.held: ndarray | float = 0.0
        self.constraints = constraints
        self._solver = solver
        self.clock = Clock()
        self.element_size = ply.basis.mesh.param()
        self.nodes, self._dimension = node_positions(ply.basis), components(ply.basis)
        self.in_space = self._dimension == 3
        self.surfaces = constraints.surfaces
        self.line_search = any(term.line_search for term in ply.terms)
        for term in ply.terms:
            if reason := getattr(term, "unsupported", lambda _: "")(constraints):
                raise ValueError(f"load {term.name!r}: {reason}")
        self._loads = [term.name for term in ply.terms if term.role == "load"]
        self.loaded = bool(self._loads)
        self.converged = _UNBALANCED_LOADED if self.loaded else _UNBALANCED

    @cached_property
    def system(self) -> System:
        """Where the tangent's entries are among the free unknowns, on the clock."""
        clock, ply, constraints = self.clock, self.ply, self.constraints
        pattern = clock.time("assembly", lambda: ply.pattern)
        arguments = pattern, self.nodes, constraints, self._solver
        return clock.time("solve", System, *arguments)

    def energy(self, u: ndarray, parameters: PlyParameters) -> float:
        """Energy in N·mm, potentials of loads included."""
        arguments = u, self.load_factor, parameters
        energies = self.clock.time("assembly", self.ply.energies, *arguments)
        return sum(energies.values()) - float(np.sum(self.held * u))

    def residual(self, u: ndarray, parameters: PlyParameters) -> ndarray:
        """Nodal forces in N, internal ones less loads."""
        arguments = u, self.load_factor, parameters
        return self.clock.time("assembly", self.ply.residual, *arguments) - self.held

    def energies(
        self, u: ndarray, parameters: PlyParameters
    ) -> tuple[dict[str, float], dict[str, float]]:
        """Energies of the terms by name, and potentials of the loads."""
        arguments = u, self.load_factor, parameters
        every = self.clock.time("assembly", self.ply.energies, *arguments)
        potentials = {name: every.pop(name) for name in self._loads}
        return every, potentials

    def load(self, u: ndarray, parameters: PlyParameters) -> ndarray:
        """Nodal forces of the loads."""
        return self.ply.load(u, self.load_factor, parameters) + self.held

    def start(
        self, u: ndarray, parameters: PlyParameters, tangent: Any = None
    ) -> Start:
        """The start of an iteration at ``u``."""
        energies, _ = self.energies(u, parameters)
        f, load = self.residual(u, parameters), self.load(u, parameters)
        return Start(self.load_factor, u, f, load, energies, parameters, tangent)

    def at(self, load_factor: float, held: ndarray | float = 0.0) -> "Problem":
        """The same problem, on the same clock, at another load factor.

        ``held`` are forces beside the loads.
        """
        _ = self.system  # that both share it
        other = copy(self)
        other.load_factor, other.held = load_factor, held
        return other

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
            raise NoEquilibriumError("the forces are not finite", advice=NOT_FINITE)
        free = turned(f, self.turn(u))[self.constraints.free]
        return float(np.abs(free).max(initial=0.0))

    def nodal(self, u: ndarray) -> ndarray:
        """A DOF vector as one column per node, shape (d, n_nodes)."""
        return u.reshape(-1, self._dimension).T

    def reactions(self, f: ndarray) -> dict[str, ndarray]:
        """Sum of the nodal forces over the nodes of each condition, shape (d,)."""
        forces, nodes = self.nodal(f), self.constraints.nodes
        return {name: forces[:, n].sum(axis=1) for name, n in nodes.items()}

    def is_fixed(self, u: ndarray, fixed_values: ndarray) -> bool:
        """Whether the fixed unknowns have their values, to round-off of positions.

        And whether nodes are on their surfaces.
        """
        constraints, surfaces = self.constraints, self.surfaces
        off = turned(u, constraints.turn)[constraints.prescribed] - fixed_values
        size = np.abs(u).max(initial=0.0) + np.abs(self.nodes).max()
        held = bool((np.abs(off) <= 8 * EPSILON * size).all())
        return held and (surfaces is None or surfaces.are_on(u, self.load_factor))

    def in_domain(self, u: ndarray, parameters: PlyParameters) -> bool:
        """Whether every law holds at ``u``, and has a finite energy."""
        if self.ply.fabric.unbounded:
            return True
        return self.ply.in_domain(u) and bool(np.isfinite(self.energy(u, parameters)))

    def around(self, u: ndarray) -> ndarray:
        """Elements at the node where a DOF vector is largest."""
        forces = self.nodal(u)
        dof = len(forces) * np.linalg.norm(forces, axis=0).argmax()
        return np.flatnonzero((self.ply.basis.element_dofs == dof).any(axis=0))


def between(before: PlyParameters, after: PlyParameters, share: float) -> PlyParameters:
    """Parameters a share of the way from some to others."""

    def mixed(old: Values, new: Values) -> Values:
        return type(old)({name: x + share * (new[name] - x) for name, x in old.items()})

    return Frozen({term: mixed(old, after[term]) for term, old in before.items()})
