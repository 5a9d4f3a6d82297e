"""Contact with tools: its parameters, and Newton directions with an active set.

The contact forces λ of a state are parameters, multipliers of the augmented Lagrangian
(`ContactTerm`) with a contact as stiff as the fibres.  No state depends on that
stiffness, because updates of the forces reduce the penetration to round-off.
"""

from contextlib import suppress
from dataclasses import dataclass, field

import numpy as np
from numpy import ndarray
from scipy.optimize import brentq
from scipy.sparse import csr_matrix

from ..ply.parameters import Frozen, PlyParameters, Values
from ..ply.terms import STIFFNESS_OF_GAP
from .contact_points import couple, curved
from .direction import NEAR, TINY, Direction, Increment, Iterate
from .problem import Evaluation, Problem, Tangent
from .states import NoEquilibriumError

#: Tolerance of contact: penetration, and contact force over stiffness, relative to the
#: size of the ply, below which contact is a constraint.
CLOSED = 1e-9

# Maximum number of linear solves by which an increment finds the nodes that touch.
# With more, early iterations solve for nodes that the next ones change; with one, the
# nodes of flat plies between two tools alternate.
_MOST_SOLVES, _MOST_SOLVES_OF_PLIES = 3, 10

# Accuracy of the share of an increment of plies.
_SHARE = 1e-6

# Force of a node that touches or leaves after a solve, relative to the largest
# unbalanced force before it, up to which the contact nodes are accepted.  An exact set
# of an inexact increment is of no use: with it, forming takes more solves.
_ACCEPTED = 0.01

# Shift of a tangent relative to the contact stiffness, with the values of Wächter &
# Biegler (2006): the first, smallest and largest one, its growth until one was found
# and later, and its decrease in the next increment.
_FIRST_SHIFT, _LEAST_SHIFT, _LARGEST_SHIFT = 1e-4, 1e-20, 1e40
_FIRST_GROWTH, _GROWTH, _DECREASE = 100.0, 8.0, 3.0


def values(problem: Problem, parameters: PlyParameters, key: str) -> ndarray:
    """Values of each tool under a key, ``force`` or ``stiffness``.

    Shape (n_tools, n_nodes).
    """
    return np.array([parameters[x.name][key] for x in problem.contacts])


def with_values(
    problem: Problem, parameters: PlyParameters, key: str, new: ndarray
) -> PlyParameters:
    """Parameters with other ``values``."""
    tools = zip(problem.contacts, new, strict=True)
    changed = {x.name: Values({**parameters[x.name], key: of}) for x, of in tools}
    return Frozen({**parameters, **changed})


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
    every = np.full((len(problem.contacts), len(ply.pattern.diagonal)), largest)
    return with_values(problem, parameters, "stiffness", every)


def of_tools(problem: Problem, parameters: PlyParameters) -> dict[str, Values]:
    """Parameters of the contact with tools, by name."""
    return {x.name: parameters[x.name] for x in problem.contacts}


def without(problem: Problem, parameters: PlyParameters) -> PlyParameters:
    """Parameters without contact with tools."""
    at_rest = of_tools(problem, problem.ply.parameters_at_rest)
    return Frozen({**parameters, **at_rest})


def frictional(problem: Problem, parameters: PlyParameters) -> PlyParameters:
    """Parameters without normal contact with tools, but with their friction."""
    none = np.zeros(problem.nodes.shape[1])
    contact = {"force": none, "stiffness": none}
    changed = {
        x.name: Values({**parameters[x.name], **contact}) for x in problem.contacts
    }
    return Frozen({**parameters, **changed})


def is_closed(problem: Problem, u: ndarray, parameters: PlyParameters) -> bool:
    """True if gaps and contact forces satisfy the contact conditions.

    Their violation, penetration or force at an open gap over stiffness, is at most
    `CLOSED` of the size of the ply.
    """
    most = CLOSED * float(np.ptp(problem.nodes, axis=1).max())
    for tool in problem.contacts:
        p = parameters[tool.name]
        force = tool.forces(u, problem.load_factor, p)
        off = np.abs(force - p["force"]) / np.maximum(p["stiffness"], TINY)
        if not p["stiffness"].any() or off.max() > most:
            return False
    return True


def resultants(
    problem: Problem, u: ndarray, parameters: PlyParameters
) -> dict[str, tuple[ndarray, ndarray]]:
    """Force of each tool and clamp on the ply in N, and its travel in mm, by name.

    Shapes (d,).
    """
    t = problem.load_factor
    return {
        x.name: (x.force(u, parameters.get(x.name, {})), x.travel(u))
        for x in problem.clamps
    } | {
        x.name: (
            -problem.nodal(x.residual(u, t, parameters[x.name])).sum(axis=1),
            x.travel(t),
        )
        for x in problem.tools
    }


@dataclass
class Relaxed:
    """Aitken's relaxation of a fixed-point iteration, with a share of at most 1.

    The bound of friction follows the contact force, and this the friction: in a wedge,
    which friction jams, both would alternate.

    With one unknown it is the relaxation of Irons & Tuck (1969).  With several, their
    share is multiplied by −Δ₀·(Δ₁ − Δ₀)/|Δ₁ − Δ₀|², with the last changes Δ₀ and Δ₁;
    this one by 1/(1 − Δ₁·Δ₀/|Δ₀|²), the factor of a change that only alternates.
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


@dataclass
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

    _last_shift: float = 0.0
    _relaxed: Relaxed = field(default_factory=Relaxed)

    def first(self, start: Evaluation) -> Iterate:
        """The iterate before the first increment, with a contact stiffness."""
        problem, u, p = self.problem, start.u, start.parameters
        tension = start.tension
        if tension is None:
            tension = problem.ply.geometric_tension(u, np.zeros_like(u), p)
        if not values(problem, p, "stiffness").any(axis=1).all():
            p = with_stiffness(problem, u, p, tension)
        forces = values(problem, p, "force")
        return Iterate(u, problem.residual(u, p), p, tension, forces)

    def increment(self, at: Iterate, fixed_values: ndarray) -> Increment:
        """Increment with the contact forces after it."""
        problem, u = self.problem, at.u
        f, K = self._without_contact(at)
        gaps = _LinearGaps.at(problem, at)
        unit = gaps.kappa[0, 0] * np.eye(3)
        far, projected, shift = at.unbalanced(problem) > NEAR, False, 0.0
        accepted = _ACCEPTED * problem.unbalanced(at.f, u)
        between = problem.tools != problem.contacts
        for _ in range(_MOST_SOLVES_OF_PLIES if between else _MOST_SOLVES):
            tangent, (force, touching) = None, gaps.active(problem)
            if far and not projected:
                tangent, _ = self._definite(u, K + touching, unit, shift, shift)
                if tangent is None:
                    K, projected = self._projected(at), True
            if tangent is None:
                tangent, shift = self._definite(u, K + touching, unit, shift)
            if tangent is None:
                raise NoEquilibriumError(
                    "no shift of the tangent makes it positive definite"
                )
            du = gaps.reached(problem, tangent.increment(f + force, u, fixed_values))
            if gaps.moved() <= accepted:
                break
        assert tangent
        self._last_shift = shift or self._last_shift
        tangent.projected = projected or shift > 0
        return Increment(du, tangent, du, gaps.force)

    def after(self, at: Iterate, increment: Increment) -> Iterate:
        """The iterate after an increment, with contact forces by the same share."""
        problem, du, tangent = self.problem, increment.du, increment.tangent
        whole = float(np.linalg.norm(increment.whole))
        share = float(np.linalg.norm(du)) / max(whole, TINY)
        tension = problem.ply.geometric_tension(at.u, du, at.parameters)
        u, before = problem.moved(at.u, du), values(problem, at.parameters, "force")
        moved = before + share * (increment.contact_forces - before)
        p = with_values(problem, at.parameters, "force", moved)
        start, forces = at.u, increment.contact_forces
        at = Iterate(u, problem.residual(u, p), p, tension, forces)
        if problem.rubbing:
            p = self._with_friction(at, start)
            at = at._replace(f=problem.residual(u, p), parameters=p)
        tangent.projected &= at.unbalanced(problem) <= NEAR
        return at

    def _with_friction(self, at: Iterate, start: ndarray) -> PlyParameters:
        """Parameters with the friction after an increment from ``start``.

        Bounds and normals change near the equilibrium: elsewhere contact forces
        are orders of magnitude larger than in any state, and friction with them.
        """
        problem, (u, _, parameters, *_) = self.problem, at
        t, near = problem.load_factor, at.unbalanced(problem) <= NEAR
        changed = {
            x.name: x.friction.predicted(parameters[x.name], start, u - start, t)
            for x in problem.rubbing
        }
        tools = [x for x in problem.contacts if x.name in changed]
        if tools and near:
            before = np.array([changed[x.name]["bound"] for x in tools])
            every = [x.friction.bound(t, changed[x.name]["force"]) for x in tools]
            bounds = self._relaxed(before, np.array(every))
            for x, bound in zip(tools, bounds, strict=True):
                p, normals = changed[x.name], x.normals(u, t)
                changed[x.name] = x.friction.bounded(p, u, t, normals, bound)
        return Frozen({**parameters, **changed})

    def tangent(self, at: Iterate) -> None:
        """None: each increment determines it together with its active set."""

    def _without_contact(self, at: Iterate) -> tuple[ndarray, ndarray]:
        """Nodal forces without tools, and stiffness less λ∇²g."""
        problem, (u, f, p, tension, forces, _) = self.problem, at
        t, rest = problem.load_factor, frictional(problem, p)
        couple(problem.ply, problem.contacts, u, p)
        arguments = u, t, rest, tension
        K = problem.clock.time("assembly", problem.ply.stiffness, *arguments)
        for contact, force in zip(problem.contacts, forces, strict=True):
            f = f - contact.residual(u, t, p[contact.name])
            f = f + contact.residual(u, t, rest[contact.name])
            K = curved(problem.ply, u, t, K, contact, force)
        return f, K

    def _projected(self, at: Iterate) -> ndarray:
        """Stiffness without tools and compressive tensions, of projected elements."""
        assert at.tension is not None  # `first` sets it
        problem, p = self.problem, frictional(self.problem, at.parameters)
        arguments = at.u, problem.load_factor, p, np.maximum(at.tension, 0.0), True
        return problem.clock.time("assembly", problem.ply.stiffness, *arguments)

    def _definite(
        self,
        u: ndarray,
        blocks: ndarray,
        unit: ndarray,
        shift: float,
        most: float = _LARGEST_SHIFT,
    ) -> tuple[Tangent | None, float]:
        """Positive definite tangent with the smallest shift, and the shift.

        The shift is relative to the stiffness ``unit``, shape (3, 3), of each node; it
        grows from ``shift`` to at most ``most``.  None if there is no such tangent.
        """
        nodes, last = self.problem.ply.pattern.diagonal, self._last_shift
        while shift <= most:
            shifted = blocks.copy()
            shifted[nodes] += shift * unit
            with suppress(NoEquilibriumError):  # it is singular
                tangent = Tangent(self.problem, u, shifted.view)
                if tangent.definite:
                    return tangent, shift
            if shift:
                shift *= _GROWTH if last else _FIRST_GROWTH
            else:
                shift = max(last / _DECREASE, _LEAST_SHIFT) if last else _FIRST_SHIFT
        return None, shift


@dataclass
class _LinearGaps:
    """Linearised gaps g + n·RΔu of all contacts, with λ, κ, and forces max(λ − κ g, 0).

    Shapes (n_contacts, n_nodes), (n_contacts, 3, n_nodes) of the normals, (n_contacts,
    1) of κ, and (n_nodes, n_nodes) of each matrix R (`ContactTerm.relative`), with the
    numbers of the contacts that it belongs to.
    """

    relative: list[tuple[csr_matrix, csr_matrix, list[int]]]
    gap: ndarray
    normal: ndarray
    multiplier: ndarray
    kappa: ndarray
    force: ndarray
    last: tuple[ndarray, ndarray, ndarray] | None = None

    @classmethod
    def at(cls, problem: Problem, at: Iterate) -> "_LinearGaps":
        """Gaps at an iterate."""
        contacts, state = problem.contacts, (at.u, problem.load_factor)
        kappa = values(problem, at.parameters, "stiffness").max(axis=1, keepdims=True)
        of_tools = [i for i, x in enumerate(contacts) if not x.of_plies]
        relative = [
            (x.relative(at.u), x.coupled(at.u, at.parameters[x.name])[0], [i])
            for i, x in enumerate(contacts)
            if x.of_plies
        ]
        if of_tools:  # all have the same contact points
            P = contacts[of_tools[0]].points
            relative.append((P, P, of_tools))
        return cls(
            relative,
            np.array([x.gaps(*state, at.parameters[x.name]) for x in contacts]),
            np.array([x.normals(*state) for x in contacts]),
            *(values(problem, at.parameters, "force"), kappa, at.contact_forces),
        )

    def active(self, problem: Problem) -> tuple[ndarray, ndarray]:
        """Nodal forces −(λ − κ g) n of the active nodes, and their tangent κ n nᵀ.

        The stiffness is reduced at open gaps.
        """
        touches, n = self.force > 0, self.normal
        reached = np.isfinite(self.gap)
        pressed = self.multiplier - self.kappa * np.where(reached, self.gap, 0.0)
        force = -np.where(touches, pressed, 0.0)[:, None] * n
        kappa = self.kappa * np.where(touches, 1.0, STIFFNESS_OF_GAP * reached)
        stiffness = kappa[:, None, None] * n[:, :, None] * n[:, None]
        nodal, blocks = np.zeros(n[0].T.shape), np.zeros((1, 3, 3))
        for R, coupled, which in self.relative:
            nodal += R.T @ force[which].sum(axis=0).T
            on_points = stiffness[which].sum(axis=0)
            blocks = blocks + problem.ply.pattern.summed(coupled, on_points)
        return np.ravel(nodal), blocks

    def reached(self, problem: Problem, after: ndarray) -> ndarray:
        """Increment towards one with a set of active nodes, from the previous one.

        The first as a whole; of plies further ones up to the least energy of the
        second-order model with the constraints, along the difference: between several
        plies the sets would alternate.
        """
        opened = self._opened(problem.nodal(after))
        active = np.where(self.force > 0, self._pressed(opened), 0.0)
        if self.last is None or problem.tools == problem.contacts:
            self.last = after, opened, active
            return after
        before, closed, balanced = self.last
        away = opened - closed

        def slope(share: float) -> float:
            linear = (1 - share) * balanced + share * active
            pressed = np.maximum(self._pressed(closed + share * away), 0.0)
            return float(((linear - pressed) * away).sum())

        share = 1.0
        if slope(1.0) > 0:
            share = brentq(slope, 0.0, 1.0, xtol=_SHARE) if slope(0.0) < 0 else 0.0
        self.last = (
            before + share * (after - before),
            closed + share * away,
            balanced + share * (active - balanced),
        )
        return self.last[0]

    def _opened(self, du: ndarray) -> ndarray:
        """Changes of the gaps by an increment (3, n_nodes)."""
        opened = np.zeros_like(self.gap)
        for _, R, which in self.relative:
            opened[which] = (self.normal[which] * (R @ du.T).T).sum(axis=1)
        return opened

    def _pressed(self, opened: ndarray) -> ndarray:
        """Forces λ − κ g of changed gaps; 0 where they are infinite."""
        gap = np.where(np.isfinite(self.gap), self.gap, 0.0)
        pressed = self.multiplier - self.kappa * (gap + opened)
        return np.where(np.isfinite(self.gap), pressed, 0.0)

    def moved(self) -> float:
        """Update forces after an increment.

        Returns the largest force of a node that touches or leaves, in N.
        """
        assert self.last
        before, force = self.force > 0, self._pressed(self.last[1])
        self.force = np.maximum(force, 0.0)
        return float(np.abs(force[before != (force > 0)]).max(initial=0.0))
