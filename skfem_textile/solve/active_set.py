"""Contact with tools: its parameters, and Newton directions with an active set.

The contact forces λ of a state are parameters, multipliers of the augmented Lagrangian
(`ContactTerm`) with a contact as stiff as the fibres.  No state depends on that
stiffness, because updates of the forces reduce the penetration to round-off.
"""

from dataclasses import dataclass

import numpy as np
from numpy import ndarray
from scipy.sparse import csr_matrix

from ..ply.parameters import Frozen, PlyParameters, Values
from ..ply.terms import STIFFNESS_OF_GAP
from .direction import NEAR, TINY, Direction, Increment, Iterate
from .problem import Evaluation, Problem, Tangent
from .states import NoEquilibriumError

#: Tolerance of contact: penetration, and contact force over stiffness, relative to the
#: size of the ply, below which contact is a constraint.
CLOSED = 1e-9

# Maximum number of linear solves by which an increment finds the nodes that touch.
# With more, early iterations solve for nodes that the next ones change; with one, the
# nodes of flat plies between two tools alternate.
_MOST_SOLVES = 3

# Force of a node that touches or leaves after a solve, relative to the largest
# unbalanced force before it, up to which the contact nodes are accepted.  An exact set
# of an inexact increment is of no use: with it, forming takes more solves.
_ACCEPTED = 0.01

# Shift of a tangent relative to the contact stiffness, with the values of Wächter &
# Biegler (2006): the first, smallest and largest one, its growth until one was found
# and later, and its decrease in the next increment.
_FIRST_SHIFT, _LEAST_SHIFT, _LARGEST_SHIFT = 1e-4, 1e-20, 1e40
_FIRST_GROWTH, _GROWTH, _DECREASE = 100.0, 8.0, 3.0


def is_set(problem: Problem, parameters: PlyParameters) -> bool:
    """True if contact stiffnesses have been assigned."""
    return all(parameters[x.name]["stiffness"].any() for x in problem.contacts)


def with_stiffness(
    problem: Problem, u: ndarray, parameters: PlyParameters, tension: ndarray
) -> PlyParameters:
    """Parameters with the stiffness of the fibres as contact stiffness.

    The stiffness is the mean over the nodes of the largest stiffness of a node, without
    contact.  Fibre tensions are arguments of `Ply.stiffness`.
    """
    ply, bare = problem.ply, without(problem, parameters)
    blocks = ply.stiffness(u, problem.load_factor, bare, tension)
    largest = np.linalg.eigvalsh(blocks[ply.pattern.diagonal])[:, -1].mean()
    stiffness = {
        x.name: np.full_like(parameters[x.name]["stiffness"], largest)
        for x in problem.contacts
    }
    return with_values(parameters, "stiffness", stiffness)


def with_values(
    parameters: PlyParameters, key: str, values: dict[str, ndarray]
) -> PlyParameters:
    """Parameters with other values under a key, by name of the tool."""
    changed = {k: Values({**parameters[k], key: x}) for k, x in values.items()}
    return Frozen({**parameters, **changed})


def of_tools(problem: Problem, parameters: PlyParameters) -> dict[str, Values]:
    """Parameters of the contact with tools, by name."""
    return {x.name: parameters[x.name] for x in problem.contacts}


def forces(problem: Problem, parameters: PlyParameters) -> dict[str, ndarray]:
    """Contact forces λ by name of the tool, shape (n_nodes,)."""
    return {x.name: parameters[x.name]["force"] for x in problem.contacts}


def error(problem: Problem, u: ndarray, parameters: PlyParameters) -> float:
    """Largest violation in mm: penetration, or force at an open gap over stiffness."""
    worst = 0.0
    for tool in problem.contacts:
        p = parameters[tool.name]
        force = tool.forces(u, problem.load_factor, p)
        off = np.abs(force - p["force"]) / np.maximum(p["stiffness"], TINY)
        worst = max(worst, float(off.max()))
    return worst


def without(problem: Problem, parameters: PlyParameters) -> PlyParameters:
    """Parameters without contact with tools."""
    at_rest = of_tools(problem, problem.ply.parameters_at_rest)
    return Frozen({**parameters, **at_rest})


def frictional(problem: Problem, parameters: PlyParameters) -> PlyParameters:
    """Parameters without normal contact with tools, but with their friction."""
    none = {
        x.name: np.zeros_like(parameters[x.name]["force"]) for x in problem.contacts
    }
    parameters = with_values(parameters, "force", none)
    return with_values(parameters, "stiffness", none)


def resultants(
    problem: Problem, u: ndarray, parameters: PlyParameters
) -> dict[str, tuple[ndarray, ndarray]]:
    """Force of each tool on the ply in N, and its travel in mm, shape (3,), by name."""
    t = problem.load_factor
    return {
        x.name: (
            -problem.nodal(x.residual(u, t, parameters[x.name])).sum(axis=1),
            x.travel(t),
        )
        for x in problem.contacts
    }


@dataclass
class Relaxed:
    """Aitken's relaxation of a fixed-point iteration, with a share of at most 1.

    The bound of friction follows the contact force, and this the friction: in a wedge,
    which friction jams, both would alternate.
    """

    share: float = 1.0
    change: ndarray | None = None

    def __call__(self, before: ndarray, after: ndarray) -> ndarray:
        """Values between those before and after an iteration."""
        last, self.change = self.change, after - before
        if last is not None:
            ratio = float((self.change * last).sum() / max((last**2).sum(), TINY))
            self.share = min(1.0, self.share / max(1.0 - ratio, TINY))
        return before + self.share * self.change


class ActiveSet(Direction):
    """Newton direction under contact constraints with linearised gaps.

    The increment minimises the second-order model of the energy under these
    constraints, by a primal–dual active set strategy (Hintermüller, Ito & Kunisch
    2002): each linear solve uses the contact nodes after the previous one, until they
    remain the same.  Where the tangent is not positive definite, it is projected far
    from the equilibrium, as in `definite`, and shifted near it, where projected ones
    leave a saddle point slowly (Wächter & Biegler 2006, algorithm IC).  Only near the
    equilibrium do these tangents count as projected: there they indicate a bifurcation;
    elsewhere increments do not follow the load path.

    Parameters
    ----------
    problem
        The problem.
    """

    def __init__(self, problem: Problem) -> None:
        super().__init__(problem)
        self._nodes = problem.ply.pattern.diagonal
        self._last_shift = 0.0
        self._relaxed = Relaxed()

    def first(self, start: Evaluation) -> Iterate:
        """The iterate before the first increment, with a contact stiffness."""
        problem, u, p = self._problem, start.u, start.parameters
        tension = problem.ply.geometric_tension(u, np.zeros_like(u), p)
        if not is_set(problem, p):
            p = with_stiffness(problem, u, p, tension)
        return Iterate(u, problem.residual(u, p), p, tension, forces(problem, p))

    def increment(self, at: Iterate, fixed_values: ndarray) -> Increment:
        """Increment with the contact forces after it."""
        problem, t, p = self._problem, self._problem.load_factor, at.parameters
        f, K, far = *self._without_contact(at), at.unbalanced(problem) > NEAR
        u = at.u
        gaps = [
            _LinearGap(
                *(x.points, x.gaps(u, t), x.normals(u, t)),
                *(p[x.name], at.contact_forces[x.name]),
            )
            for x in problem.contacts
        ]
        shift, projected = 0.0, False
        accepted = _ACCEPTED * problem.unbalanced(at.f, u)
        for _ in range(_MOST_SOLVES):
            force = f + sum(gap.residual() for gap in gaps)
            tangent = self._definite(u, K, gaps, shift)
            if tangent is None and far and not projected:
                K, projected = self._projected(at), True
                tangent = self._definite(u, K, gaps, shift)
            if tangent is None:
                tangent, shift = self._shifted(u, K, gaps, shift)
            du = tangent.increment(force, u, fixed_values)
            if max(gap.moved(problem.nodal(du)) for gap in gaps) <= accepted:
                break
        assert tangent
        self._last_shift = shift or self._last_shift
        tangent.projected = projected or shift > 0
        names = [tool.name for tool in problem.contacts]
        after = {x: gap.force for x, gap in zip(names, gaps, strict=True)}
        return Increment(du, tangent, du, after)

    def after(self, at: Iterate, increment: Increment) -> Iterate:
        """The iterate after an increment, with contact forces by the same share."""
        problem, du, tangent = self._problem, increment.du, increment.tangent
        whole = float(np.linalg.norm(increment.whole))
        share = float(np.linalg.norm(du)) / max(whole, TINY)
        tension = problem.ply.geometric_tension(at.u, du, at.parameters)
        u = problem.moved(at.u, du)
        moved = {
            name: force + share * (increment.contact_forces[name] - force)
            for name, force in forces(problem, at.parameters).items()
        }
        p = with_values(at.parameters, "force", moved)
        p = self._with_friction(p, at.u, u)
        at = Iterate(u, problem.residual(u, p), p, tension, increment.contact_forces)
        tangent.projected &= at.unbalanced(problem) <= NEAR
        return at

    def _with_friction(
        self, parameters: PlyParameters, u: ndarray, after: ndarray
    ) -> PlyParameters:
        """Parameters with the friction after an increment from u."""
        problem, t = self._problem, self._problem.load_factor
        changed = {
            x.name: x.friction.predicted(parameters[x.name], u, after - u, t)
            for x in problem.rubbing
        }
        tools = [x for x in problem.contacts if x.name in changed]
        if tools:
            before = np.array([changed[x.name]["bound"] for x in tools])
            every = [x.friction.bound(t, changed[x.name]["force"]) for x in tools]
            bounds = self._relaxed(before, np.array(every))
            for x, bound in zip(tools, bounds, strict=True):
                p, normals = changed[x.name], x.normals(after, t)
                changed[x.name] = x.friction.bounded(p, t, normals, bound)
        return Frozen({**parameters, **changed})

    def tangent(self, at: Iterate) -> None:
        """None: each increment determines it together with its active set."""

    def _without_contact(self, at: Iterate) -> tuple[ndarray, ndarray]:
        """Nodal forces without tools, and stiffness less λ∇²g."""
        problem, (u, f, p, tension, forces, _) = self._problem, at
        t, rest = problem.load_factor, frictional(problem, p)
        arguments = u, t, rest, tension
        K = problem.clock.time("assembly", problem.ply.stiffness, *arguments)
        for tool in problem.contacts:
            f = f - tool.residual(u, t, p[tool.name])
            f = f + tool.residual(u, t, rest[tool.name])
            K = problem.curved(u, K, tool, forces[tool.name])
        return f, K

    def _projected(self, at: Iterate) -> ndarray:
        """Stiffness without tools and compressive tensions, of projected elements."""
        assert at.tension is not None  # `first` sets it
        problem, p = self._problem, frictional(self._problem, at.parameters)
        arguments = at.u, problem.load_factor, p, np.maximum(at.tension, 0.0), True
        return problem.clock.time("assembly", problem.ply.stiffness, *arguments)

    def _definite(
        self, u: ndarray, K: ndarray, gaps: "list[_LinearGap]", shift: float
    ) -> Tangent | None:
        """Tangent with a shift relative to κ; None if it is not positive definite."""
        every = np.arange(len(self._nodes))
        stiffness = sum(gap.stiffness() for gap in gaps)
        blocks = K + self._problem.at_points(np.asarray(stiffness), every)
        blocks[self._nodes] += shift * gaps[0].kappa * np.eye(3)
        try:
            tangent = Tangent(self._problem, u, blocks)
        except NoEquilibriumError:  # it is singular
            return None
        return tangent if tangent.definite else None

    def _shifted(
        self, u: ndarray, K: ndarray, gaps: "list[_LinearGap]", shift: float
    ) -> tuple[Tangent, float]:
        """Tangent with a larger shift that makes it positive definite, and the shift.

        Raises a `NoEquilibriumError` if there is none.
        """
        last = self._last_shift
        while shift <= _LARGEST_SHIFT:
            if shift:
                shift *= _GROWTH if last else _FIRST_GROWTH
            else:
                shift = max(last / _DECREASE, _LEAST_SHIFT) if last else _FIRST_SHIFT
            if tangent := self._definite(u, K, gaps, shift):
                return tangent, shift
        raise NoEquilibriumError("no shift of the tangent makes it positive definite")


@dataclass
class _LinearGap:
    """Linearised gap g + n·PΔu of all nodes, with λ, κ, and forces max(λ − κ g, 0).

    Shapes (n_nodes,), (3, n_nodes) of the normals, and (n_nodes, n_nodes) of the
    matrix P to the contact points.
    """

    points: csr_matrix
    gap: ndarray
    normal: ndarray
    p: Values
    force: ndarray

    @property
    def kappa(self) -> float:
        """Contact stiffness in N/mm."""
        return float(self.p["stiffness"].max())

    def residual(self) -> ndarray:
        """Nodal forces −(λ − κ g) n of the active nodes."""
        force = np.where(self.force > 0, self.p["force"] - self.kappa * self.gap, 0.0)
        return np.ravel(self.points.T @ -(force * self.normal).T)

    def stiffness(self) -> ndarray:
        """Contact stiffness κ n nᵀ, reduced at open gaps, shape (n_nodes, 3, 3)."""
        of_gap = np.where(np.isfinite(self.gap), STIFFNESS_OF_GAP, 0.0)
        kappa = self.kappa * np.where(self.force > 0, 1.0, of_gap)
        return np.asarray((kappa * self.normal[:, None] * self.normal).T)

    def moved(self, du: ndarray) -> float:
        """Update forces after an increment (3, n_nodes).

        Returns the largest force of a node that touches or leaves, in N.
        """
        moved = (self.points @ du.T).T
        before, gap = self.force > 0, self.gap + (self.normal * moved).sum(axis=0)
        force = self.p["force"] - self.kappa * gap
        self.force = np.maximum(force, 0.0)
        return float(np.abs(force[before != (force > 0)]).max(initial=0.0))
