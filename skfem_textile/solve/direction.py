"""Iterates, and directions of increments; between tools see `active_set.ActiveSet`."""

from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray

from ..ply.parameters import PlyParameters
from .problem import Evaluation, Problem, Tangent
from .states import NoEquilibriumError

# Fibre tension in N/mm in the first geometric stiffness of a ply whose tangent is
# singular, and the minimum one in a projected tangent in space, off surfaces.  Along
# the fibres it must not outweigh the stiffness of a crimped fabric at rest.
_FIRST_TENSION = 0.1

# Where nodes are on surfaces, the minimum fibre tension in that stiffness relative to
# the shear stiffness: an initial guess there is far from inextensible.
_OVER_SHEAR_STIFFNESS = 10.0

#: Unbalanced share of the largest force below which an equilibrium is near, and mean
#: stretches are accurate enough for a stiffness.
NEAR = 0.1

#: Smallest force in N, or sum of forces, by which others are divided.
TINY = 1e-300


class Iterate(NamedTuple):
    """Displacement between two increments.

    Attributes
    ----------
    u, f, parameters
        Displacement, nodal forces, and parameters of the terms.
    tension
        Fibre tensions that the last increment predicts, for the geometric stiffness;
        None before the first one.
    contact_forces
        Contact forces λ that it predicts: of nodes on surfaces, shape (n_nodes,), or of
        tools, shape (n_tools, n_nodes).
    tangent
        Tangent of the next increment, if it is known; at equilibrium the consistent
        one, None if it is singular.
    """

    u: ndarray
    f: ndarray
    parameters: PlyParameters
    tension: ndarray | None = None
    contact_forces: Any = None
    tangent: Any = None

    @property
    def unstable(self) -> bool:
        """True if the tangent is regular and indefinite, or has been projected."""
        tangent = self.tangent
        return tangent is not None and bool(
            tangent.projected or tangent.negative_pivots
        )

    def unbalanced(self, problem: Problem) -> float:
        """Largest free nodal force relative to the largest nodal or contact force."""
        forces = (self.f, self.contact_forces) if problem.contacts else (self.f,)
        largest = max(float(np.abs(x).max(initial=TINY)) for x in forces)
        return problem.unbalanced(self.f, self.u) / largest


class Increment(NamedTuple):
    """Increment of the displacement.

    Attributes
    ----------
    du
        The increment, shape (n_unknowns,).
    tangent
        Tangent of which it is the solution.
    whole
        The solution itself, of which ``du`` is a share.
    contact_forces
        Contact forces of tools after it to first order, shape (n_tools, n_nodes).
    """

    du: ndarray
    tangent: Tangent
    whole: ndarray
    contact_forces: Any = None


@dataclass
class Direction:
    """Newton direction with the consistent tangent; base of the other directions.

    Parameters
    ----------
    problem
        The problem.
    """

    problem: Problem

    def first(self, start: Evaluation) -> Iterate:
        """The iterate before the first increment."""
        problem, u, p = self.problem, start.u, start.parameters
        # Surfaces move with the load factor.
        tangent = None if problem.surfaces else start.tangent
        return Iterate(u, problem.residual(u, p), p, tangent=tangent)

    def increment(self, at: Iterate, fixed_values: ndarray) -> Increment:
        """Solve the linearised problem.

        ``fixed_values`` are the values of the fixed unknowns after the increment.
        """
        tangent = at.tangent or self.tangent(at)
        du = tangent.increment(at.f, at.u, fixed_values)
        return Increment(du, tangent, du)

    def after(self, at: Iterate, increment: Increment) -> Iterate:
        """The iterate after an increment."""
        return self.beside(at, self.problem.moved(at.u, increment.du))

    def beside(self, at: Iterate, u: ndarray) -> Iterate:
        """An iterate at another displacement, with the same parameters."""
        f = self.problem.residual(u, at.parameters)
        return at._replace(u=u, f=f, tangent=None)

    def tangent(self, at: Iterate) -> Any:
        """Tangent of the next increment; None if the increment itself determines it."""
        return Tangent.at(self.problem, at.u, at.parameters)


class Definite(Direction):
    """Newton direction with a positive definite tangent, see `definite`."""

    def first(self, start: Evaluation) -> Iterate:
        """The iterate before the first increment."""
        problem, u = self.problem, start.u
        tangent, p = _first_tangent(problem, start)
        changed = bool(problem.surfaces) or problem.ply.follows_load_factor
        f = problem.residual(u, p) if changed else start.f
        return Iterate(u, f, p, tangent=tangent)

    def increment(self, at: Iterate, fixed_values: ndarray) -> Increment:
        """Solve the linearised problem.

        Slack fibres have no stiffness, and hardly limit the increment that first moves
        the supports of a ply in its plane, although it stretches them.  It is therefore
        also computed with their stiffness at rest; the one with less energy is used.
        """
        increment, problem, u = super().increment(at, fixed_values), self.problem, at.u
        rests = at.tension is None and not u[problem.constraints.fixed].any()
        if (
            not rests
            or problem.is_fixed(u, fixed_values)
            or problem.in_space
            or not problem.ply.is_slack(u)
        ):
            return increment
        p, still = at.parameters, np.zeros_like(u)
        tension = problem.ply.geometric_tension(u, still, p)
        tangent = Tangent.at(problem, u, p, tension, stretched=True)
        other = super().increment(at._replace(tangent=tangent), fixed_values)
        return min(increment, other, key=lambda x: problem.energy(u + x.du, p))

    def beside(self, at: Iterate, u: ndarray) -> Iterate:
        """An iterate at another displacement, with the tensions there."""
        du = np.zeros_like(u)
        tension = self.problem.ply.geometric_tension(u, du, at.parameters)
        return super().beside(at, u)._replace(tension=tension)

    def after(self, at: Iterate, increment: Increment) -> Iterate:
        """The iterate after an increment, with the tensions that it predicts."""
        problem, p, du = self.problem, at.parameters, increment.du
        tension = problem.ply.geometric_tension(at.u, du, p)
        u, forces = problem.moved(at.u, du), increment.tangent.contact_forces(at.f, du)
        return Iterate(u, problem.residual(u, p), p, tension, forces)

    def tangent(self, at: Iterate) -> Any:
        """Tangent of the next increment."""
        assert at.tension is not None  # the first iterate has its tangent
        values = at.u, at.parameters, at.tension, at.contact_forces
        return definite(self.problem, *values)


def _first_tangent(
    problem: Problem, start: Evaluation
) -> tuple[Tangent, PlyParameters]:
    """Tangent and parameters of the first increment.

    Where the tangent at the start is singular, a fibre tension is added to it. On
    surfaces, which move with the load factor, the parameters are then updated with the
    tension due to the loads, because those at rest are too small if it is large.
    """
    u, p = start.u, start.parameters
    regular = start.tangent and start.tangent.negative_pivots is not None
    moves = problem.surfaces and start.load_factor != problem.load_factor
    if start.tangent and regular and not moves:
        return start.tangent, p
    tension = problem.ply.geometric_tension(u, np.zeros_like(u), p)
    if regular:
        return definite(problem, u, p, tension), p
    size = _FIRST_TENSION
    if problem.surfaces:
        # Estimate: total tangential load over two sides of a square of equal area. With
        # a ten times larger or smaller value, a sphere takes twice as many solves.
        along = problem.nodal(problem.unfixed(problem.load(u, p), u))
        sides = 2 * np.sqrt(problem.ply.basis.dx.sum())
        of_loads = np.full_like(tension, np.linalg.norm(along, axis=0).sum() / sides)
        p = problem.ply.updated(p, u, problem.load_factor, of_loads)
        G = problem.ply.fabric.shear_law.tangent(np.zeros((tension.shape[1], 1))).mean()
        size = max(float(of_loads.max()), _OVER_SHEAR_STIFFNESS * G) or size
    first = np.full_like(tension, size)
    return Tangent.at(problem, u, p, first, contact_forces=0.0), p


def definite(
    problem: Problem,
    u: ndarray,
    parameters: PlyParameters,
    tension: ndarray,
    contact_forces: ndarray | float | None = None,
) -> Tangent:
    """The tangent; where it is not positive definite, a projected one.

    The projected tangent has no compressive fibre tensions, positive semi-definite
    projections of the element matrices, and on surfaces no contact forces.  In space,
    off surfaces, it has a minimum fibre tension. If it is still not definite, the
    tensions at ``u`` are used. Arguments and exceptions are as for `Tangent`.
    """
    free_in_space = problem.in_space and not problem.surfaces
    least = _FIRST_TENSION if free_in_space else 0.0

    def projected(tension: ndarray) -> Tangent:
        clipped = np.maximum(tension, least)
        tangent = Tangent.at(problem, u, parameters, clipped, True, contact_forces=0.0)
        tangent.projected = True
        return tangent

    attempts = (
        partial(Tangent.at, problem, u, parameters, tension, False, contact_forces),
        partial(projected, tension),
    )
    for attempt in attempts:
        with suppress(NoEquilibriumError):
            if (tangent := attempt()).definite:
                return tangent
    # A law without slope at rest predicts no tension.
    return projected(problem.ply.geometric_tension(u, np.zeros_like(u), parameters))
