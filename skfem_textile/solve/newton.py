"""Newton's method for an equilibrium at one load factor."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, NamedTuple, Protocol

import numpy as np
from numpy import ndarray

from ..ply.parameters import PlyParameters
from . import contact
from .problem import EPSILON, HOLD, InitialGuess, Problem, Tangent, between, tangent_at
from .states import Equilibrium, NoEquilibriumError

# Fibre tension in N/mm in the first geometric stiffness of a ply whose tangent is
# singular, and the minimum one in a projected tangent in space, off surfaces.  Along
# the fibres it must not outweigh the stiffness of a crimped fabric at rest.
_FIRST_TENSION = 0.1

# Where nodes are on surfaces, the minimum fibre tension in that stiffness relative to
# the shear stiffness: an initial guess there is far from inextensible.
_OVER_SHEAR_STIFFNESS = 10.0

# Unbalanced share of the largest force below which an equilibrium is near, and mean
# stretches are accurate enough for a stiffness.
_NEAR = 0.1

#: Maximum number of repetitions of the iteration at a state with updated parameters.
MOST_UPDATES = 8

#: Share of the energy and of the largest reaction by which an update of the parameters
#: may change them at a state.
SETTLED = 0.0025

# Ratio of residual to tolerance up to which a failed iteration counts as limited by
# round-off.
_STALLED = 100.0

#: Advice where round-off prevents balance.
LESS_ROUNDING = (
    "coordinates of mesh and surfaces that are closer to the origin, or larger loads, "
    "because the remaining residual is due to round-off"
)

# Advice where a ply on a surface finds no balance.
_ON_SURFACE = (
    "a ply that ends before sharp corners of the surface or, if it has none, tension "
    "on the edges or fibres with bending stiffness"
)

# Trial lengths of an increment, each half the previous one, until every law has a value
# or the energy decreases.  Chosen: the last, 2⁻¹¹, is shorter than any in a converging
# iteration.
_HALVINGS = 12

# Smallest force by which others are divided, in N.
_TINY = 1e-300

# Maximum number of iterations with the line search, as a multiple of the maximum before
# it.
_DESCENT = 3

# Maximum number of iterations between tools, as a multiple of the maximum without them.
# Chosen: steps of slack plies, which have many wrinkled states, often take more than a
# hundred, and halving a step takes longer than continuing.
_BETWEEN_TOOLS = 10

# Number of increments between tools that may follow one that did not decrease the
# energy, the last of which must have decreased it.  Chosen: with fewer, a slack ply of
# stiff fibres takes more than twice as many solves, with more as many (`pytest
# tests/forming/test_stiff_fibres.py` bounds the solves with 8).
_WATCHED = 8

# Share of the predicted decrease of the energy that an increment must reach (Armijo's
# rule, with the constant of Nocedal & Wright, Numerical Optimization, 2006, section
# 3.1).
_ARMIJO = 1e-4

#: Called with the number of an iteration, its residual and its tolerance, both in N.
Report = Callable[[int, float, float], None]


class Method(Protocol):
    """A nonlinear solver.

    Its ``repr`` identifies it when a checkpoint is resumed.

    Attributes
    ----------
    name
        Name in reports and messages.
    follows_path
        True if a state is on the load path if at most `MOST_PROJECTED` tangents were
        projected.
    """

    name: ClassVar[str]
    follows_path: ClassVar[bool]

    @property
    def most(self) -> int:
        """Maximum number of iterations before the line search."""
        ...

    def solve(
        self,
        problem: Problem,
        start: InitialGuess,
        fixed_values: ndarray,
        most_projected: float,
        report: Report,
    ) -> Equilibrium:
        """Balance the forces and bring the fixed unknowns to their values.

        Parameters
        ----------
        problem, start, fixed_values
            Problem, initial guess, and values of the fixed unknowns.
        most_projected
            Maximum number of projected tangents.
        report
            Called after each iteration.

        Raises
        ------
        NoEquilibriumError
            If the forces do not balance.
        """
        ...


@dataclass(frozen=True)
class Newton:
    """Mixed-integration-point Newton with a positive definite tangent.

    The geometric stiffness contains the fibre tensions that the previous iteration
    predicted, T(ε) + T′ ∂ε·∇du, instead of those at its displacement, which are far
    larger wherever nearly inextensible fibres rotate (Magisano, Leonetti & Garcea
    2017). The residual is unchanged.  Where the tangent is not positive definite it is
    projected, so that increments do not lead to saddle points (`definite`).  No
    increment changes the displacement gradient by more than ``longest``, except for the
    first of a ply in its plane, which brings the fixed unknowns to their values.

    An iteration that has not converged after ``most`` increments but has a positive
    definite tangent continues with a line search: increments are halved until the
    energy decreases.  Where a term has a ``line_search``, this holds for every
    increment after the first.

    Near the equilibrium the parameters of the terms are updated with the predicted
    tensions, until an update changes the energy by less than `SETTLED`; between tools
    they are updated in the first iteration at a load factor, and kept in those that
    follow an update at an equilibrium.

    Between tools, each increment finds the nodes that touch, see
    `contact.Increments`.  An increment that rotates nearly inextensible fibres also
    stretches them, to second order, and may increase the energy, which the next ones
    then decrease.  If the eighth increment after it has not decreased the energy
    either, the iteration continues from the displacement before the first, with a
    halved increment (the watchdog technique of Chamberlain et al. 1982; Nocedal &
    Wright 2006, section 15.6).
    Increments do not follow the load path: tangents that are not positive definite
    count as projected only near the equilibrium, where they show that there are others.

    The iteration leaves an unstable equilibrium along its softest mode, and continues
    with the line search, except where the load path is followed, which avoids it.

    Parameters
    ----------
    most
        Maximum number of iterations; with the line search, three times as many more;
        between tools, ten times as many.
    longest
        Largest change of the displacement gradient in an increment.
    imperfection
        Size of the motion by which an unstable equilibrium is left, as a share of the
        element size.
    """

    most: int = 30
    longest: float = 1.0
    imperfection: float = 0.01
    name: ClassVar[str] = "newton"
    follows_path: ClassVar[bool] = True

    def solve(
        self,
        problem: Problem,
        start: InitialGuess,
        fixed_values: ndarray,
        most_projected: float,
        report: Report,
    ) -> Equilibrium:
        """See `Method`."""
        if problem.contacts:
            progress = _Progress(problem, fixed_values, np.inf, report)
            return progress.equilibrium(self._between_tools(progress, start))
        progress = _Progress(problem, fixed_values, most_projected, report)
        tangent, p = _first_tangent(problem, start)
        changed = problem.surfaces or problem.ply.follows_load_factor
        f = problem.residual(start.u, p) if changed else start.f
        first = _Iterate(start.u, f, p, tangent)
        end = self._iterate(progress, first, self.most)
        leave = not np.isfinite(most_projected) and end.unstable
        if leave:
            u, p = self._disturbed(problem, end), end.parameters
            tension = problem.ply.geometric_tension(u, np.zeros_like(u), p)
            tangent = definite(problem, u, p, tension)
            end = _Iterate(u, problem.residual(u, p), p, tangent)
        if leave or not (progress.is_balanced or end.tangent.projected):
            end = self._iterate(progress, end, _DESCENT * self.most, descend=True)
        return progress.equilibrium(end)

    def _between_tools(self, progress: "_Progress", start: InitialGuess) -> "_Iterate":
        """Iterate until the forces balance, or too often, in contact with tools."""
        problem, u, p = progress.problem, start.u, start.parameters
        tension = problem.ply.geometric_tension(u, np.zeros_like(u), p)
        if not contact.is_set(problem, p):
            p = contact.with_stiffness(problem, u, p, tension)
        f, forces = problem.residual(u, p), contact.forces(problem, p)
        near = 0.0 if start.keeps_parameters else _NEAR
        increments, watched = contact.Increments(problem), None
        for _ in range(_BETWEEN_TOOLS * self.most):
            increment = increments(u, f, p, tension, forces, progress.fixed_values)
            du = self._limited(problem, u, increment.du, p)
            if watched is None:
                watched, left = (Line(problem, u, du, f, p), increment), _WATCHED
            if watched[0].falls_to(problem.moved(u, du)):
                watched = None
            elif not left:
                line, increment = watched
                u, f, p = line.u, line.f, line.parameters
                du, watched = line.halved(), None
            left -= 1
            whole, tangent, forces, shifted = increment
            share = float(np.linalg.norm(du)) / max(float(np.linalg.norm(whole)), _TINY)
            tension = problem.ply.geometric_tension(u, du, p)
            u = problem.moved(u, du)
            p = contact.towards(problem, p, forces, share)
            f = problem.residual(u, p)
            largest = max(float(np.abs(x).max()) for x in (f, *forces.values()))
            unbalanced = problem.unbalanced(f, u) / max(largest, _TINY)
            tangent.projected = shifted and unbalanced <= _NEAR
            if unbalanced < near:
                near *= _NEAR
                p = problem.ply.updated(p, u, problem.load_factor, tension)
                f = problem.residual(u, p)
            end = _Iterate(u, f, p, tangent)
            if progress.balanced(tangent, u, f, p):
                end = end._replace(tangent=tangent_at(problem, u, p))
                if not end.unstable:
                    break
                u, watched = self._disturbed(problem, end), None
                f = problem.residual(u, p)
        return end

    def _limited(
        self, problem: Problem, u: ndarray, du: ndarray, parameters: PlyParameters
    ) -> ndarray:
        """The increment with at most the ``longest`` gradient, within all laws."""
        du = du / max(1.0, problem.ply.largest_gradient(du) / self.longest)
        return within_laws(problem, u, du, parameters)

    def _disturbed(self, problem: Problem, end: "_Iterate") -> ndarray:
        """Displacement from an unstable equilibrium, moved along its softest mode."""
        motion = self.imperfection * problem.element_size * end.tangent.softest()
        return problem.moved(end.u, motion)

    def _iterate(
        self,
        progress: "_Progress",
        at: "_Iterate",
        most: int,
        descend: bool = False,
    ) -> "_Iterate":
        """Iterate until the forces balance, or ``most`` times."""
        problem, near, last = progress.problem, _NEAR, np.inf
        u, f, p, tangent = at
        descend = descend or problem.line_search
        for _ in range(most):
            du = tangent.increment(f, u, progress.fixed_values)
            if progress.residuals or problem.in_space:
                du = self._limited(problem, u, du, p)
            else:
                du = within_laws(problem, u, du, p)
            if progress.residuals and descend:
                du = Line(problem, u, du, f, p).halved()
            tension = problem.ply.geometric_tension(u, du, p)
            multipliers = tangent.contact(f, du)
            u = problem.moved(u, du)
            f = problem.residual(u, p)
            unbalanced = problem.unbalanced(f, u) / np.abs(f).max(initial=_TINY)
            if unbalanced <= near:
                after = problem.ply.updated(p, u, problem.load_factor, tension)
                change = 0.0
                if after is not p:
                    both = problem.energies(u, p), problem.energies(u, after)
                    old, new = (sum(energies.values()) for energies, _ in both)
                    change = abs(new - old) / abs(old) if old else np.inf
                if change > last / 2:
                    after = between(p, after, 0.5)
                near = _NEAR * near if SETTLED < change <= last / 2 else 0.0
                if last == np.inf or change > SETTLED / 2:
                    p, f = after, problem.residual(u, after)
                last = change
            if progress.balanced(tangent, u, f, p):
                return _Iterate(u, f, p, tangent_at(problem, u, p))
            tangent = definite(problem, u, p, tension, multipliers)
        return _Iterate(u, f, p, tangent)


@dataclass(frozen=True)
class PlainNewton:
    """Newton's method with the consistent tangent, for small steps.

    Parameters
    ----------
    most
        Maximum number of iterations.
    """

    most: int = 20
    name: ClassVar[str] = "plain"
    follows_path: ClassVar[bool] = False

    def solve(
        self,
        problem: Problem,
        start: InitialGuess,
        fixed_values: ndarray,
        most_projected: float,
        report: Report,
    ) -> Equilibrium:
        """See `Method`."""
        u, p, tangent = start.u, start.parameters, start.tangent
        f = problem.residual(u, p)
        progress = _Progress(problem, fixed_values, most_projected, report)
        for _ in range(self.most):
            if tangent is None or problem.surfaces:  # which move with the load factor
                tangent = Tangent.at(problem, u, p)
            du = within_laws(problem, u, tangent.increment(f, u, fixed_values), p)
            u = problem.moved(u, du)
            f = problem.residual(u, p)
            if progress.balanced(tangent, u, f, p):
                break
            tangent = None
        tangent = tangent_at(problem, u, p)
        return progress.equilibrium(_Iterate(u, f, p, tangent))


#: Nonlinear solvers by name.
METHODS: dict[str, Method] = {x.name: x for x in (Newton(), PlainNewton())}


class _Iterate(NamedTuple):
    """Displacement, forces, parameters, and the tangent of the next increment.

    At equilibrium this is the consistent tangent; None where it is singular.
    """

    u: ndarray
    f: ndarray
    parameters: PlyParameters
    tangent: Any

    @property
    def unstable(self) -> bool:
        """True if the consistent tangent is regular and indefinite."""
        tangent = self.tangent
        return tangent is not None and bool(
            tangent.projected or tangent.negative_pivots
        )


@dataclass
class _Progress:
    """Residuals and convergence of an iteration; arguments of `Method.solve`."""

    problem: Problem
    fixed_values: ndarray
    most_projected: float
    report: Report
    residuals: list[float] = field(default_factory=list)
    projected: int = 0
    tolerance: float = 0.0
    is_balanced: bool = False
    tangent: Tangent | None = None

    def balanced(
        self, tangent: Tangent, u: ndarray, f: ndarray, parameters: PlyParameters
    ) -> bool:
        """True if the forces balance after an increment by a tangent.

        Raises an error if too many tangents were projected, forces are not finite, or
        the ply flies away.
        """
        problem = self.problem
        self.residuals.append(problem.unbalanced(f, u))
        self.tolerance, self.tangent = tangent.tolerance(u, f, parameters), tangent
        self.projected += tangent.projected
        self.report(len(self.residuals), self.residuals[-1], self.tolerance)
        if self.projected > self.most_projected:
            raise NoEquilibriumError(
                f"more than {self.most_projected:g} tangents were indefinite",
                problem.around(problem.unfixed(f, u)),
                advice=_ON_SURFACE if problem.surfaces else "",
            )
        self._refuse_flight(u)
        below = self.residuals[-1] <= self.tolerance
        self.is_balanced = below and problem.is_fixed(u, self.fixed_values)
        return self.is_balanced

    def _refuse_flight(self, u: ndarray) -> None:
        """Refuse a displacement far beyond the size of ply, tools and motions."""
        if self.problem.flies(u, self.fixed_values):
            raise NoEquilibriumError(
                f"the ply moves by {np.abs(u).max():.2g} mm, far beyond its size and "
                "the motions of supports and tools: nothing stops it",
                advice=HOLD,
            )

    def equilibrium(self, end: _Iterate) -> Equilibrium:
        """The equilibrium at the end of the iteration; an error if there is none."""
        problem, (u, f, p, tangent) = self.problem, end
        residual, tolerance = self.residuals[-1], self.tolerance
        if not self.is_balanced:
            advice = "more steps, or a larger stabilisation"
            assert self.tangent
            if residual <= _STALLED * max(tolerance, self.tangent.round_off(u)):
                advice = LESS_ROUNDING
            elif problem.surfaces:
                advice = _ON_SURFACE
            raise NoEquilibriumError(
                f"the residual is {residual:.2g} N after {len(self.residuals)} "
                f"iterations, and the tolerance is {tolerance:.2g} N",
                problem.around(problem.unfixed(f, u)),
                advice=advice,
            )
        residuals = tuple(self.residuals)
        return Equilibrium(u, f, p, residuals, tolerance, self.projected, tangent)


def _first_tangent(
    problem: Problem, start: InitialGuess
) -> tuple[Tangent, PlyParameters]:
    """The first tangent and parameters.

    Where the tangent at the start is singular, a fibre tension is added to it. On
    surfaces the parameters are then updated with the tension due to the loads, because
    those at rest are too small if it is large.
    """
    u, p = start.u, start.parameters
    regular = start.tangent and start.tangent.negative_pivots is not None
    if start.tangent and regular and not problem.surfaces:
        return start.tangent, p
    tension = problem.ply.geometric_tension(u, np.zeros_like(u), p)
    if regular:  # but surfaces have moved with the load factor
        return definite(problem, u, p, tension), p
    size = _FIRST_TENSION
    if problem.surfaces:
        # As in a square, two sides of which carry all loads along surfaces. With a ten
        # times larger or smaller value, a sphere takes twice as many solves.
        along = problem.nodal(problem.unfixed(problem.load(u, p), u))
        sides = 2 * np.sqrt(problem.ply.basis.dx.sum())
        of_loads = np.full_like(tension, np.linalg.norm(along, axis=0).sum() / sides)
        p = problem.ply.updated(p, u, problem.load_factor, of_loads)
        G = problem.ply.fabric.shear_law.tangent(np.zeros((tension.shape[1], 1))).mean()
        size = max(float(of_loads.max()), _OVER_SHEAR_STIFFNESS * G) or size
    first = np.full_like(tension, size)
    return Tangent.at(problem, u, p, first, contact=0.0), p


def definite(
    problem: Problem,
    u: ndarray,
    parameters: PlyParameters,
    tension: ndarray,
    contact: ndarray | float | None = None,
) -> Tangent:
    """The tangent; where it is not positive definite, a projected one.

    The projected tangent has no compressive fibre tensions, positive semi-definite
    projections of the element matrices, and on surfaces no contact forces.  In space,
    off surfaces, it has a minimum fibre tension. If it is still not definite, the
    tensions at ``u`` are used. Arguments and exceptions are as for `Tangent`.
    """
    try:
        tangent = Tangent.at(problem, u, parameters, tension, contact=contact)
        if tangent.definite:
            return tangent
    except NoEquilibriumError:
        pass
    free_in_space = problem.in_space and not problem.surfaces
    least = _FIRST_TENSION if free_in_space else 0.0

    def projected(tension: ndarray) -> Tangent:
        clipped = np.maximum(tension, least)
        tangent = Tangent.at(problem, u, parameters, clipped, True, contact=0.0)
        tangent.projected = True
        return tangent

    try:
        tangent = projected(tension)
        if tangent.definite:
            return tangent
    except NoEquilibriumError:
        pass
    # A law without slope at rest predicts no tension.
    return projected(problem.ply.geometric_tension(u, np.zeros_like(u), parameters))


def within_laws(
    problem: Problem, u: ndarray, du: ndarray, parameters: PlyParameters
) -> ndarray:
    """The increment, halved until every law has a value; an error if none has one."""
    for share in 0.5 ** np.arange(_HALVINGS):
        if problem.in_domain(u + share * du, parameters):
            return share * du
    end = problem.ply.closest_end(u + share * du)
    raise NoEquilibriumError(
        "even the shortest increment leaves the domain of a law"
        + (f": {end}" if end else ""),
        end.elements if end else (),
        "a law with a larger domain (for a table: more points, or "
        "extrapolation='linear'), or a smaller load",
        end.quantity if end else "",
    )


@dataclass(frozen=True, eq=False)
class Line:
    """Energy along an increment.

    Attributes
    ----------
    problem, u, du
        The problem, displacement and increment.
    f, parameters
        Nodal forces at the displacement, and parameters of the terms.
    """

    problem: Problem
    u: ndarray
    du: ndarray
    f: ndarray
    parameters: PlyParameters

    @cached_property
    def energy(self) -> float:
        """Energy at the displacement in N·mm."""
        return self.problem.energy(self.u, self.parameters)

    def falls_to(self, u: ndarray, share: float = 1.0) -> bool:
        """True if the energy at u is as small as its slope f·du predicts for a share.

        Also true if the slope is not negative.
        """
        slope, round_off = float(self.f @ self.du), 8 * EPSILON * abs(self.energy)
        if slope >= 0:
            return True
        fall = self.problem.energy(u, self.parameters) - self.energy
        return fall <= _ARMIJO * share * slope + round_off

    def halved(self) -> ndarray:
        """The increment, halved until the energy falls; the whole one if none does."""
        for share in 0.5 ** np.arange(_HALVINGS):
            if self.falls_to(self.problem.moved(self.u, share * self.du), share):
                return share * self.du
        return self.du
