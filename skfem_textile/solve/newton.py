"""Newton's method for an equilibrium at one load factor, with its globalisation."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar, Protocol

import numpy as np
from numpy import ndarray

from ..ply.parameters import Frozen, PlyParameters, Values
from . import active_set
from .direction import NEAR, Definite, Direction, Increment, Iterate
from .problem import EPSILON, HOLD, Evaluation, Problem, Tangent, tangent_at
from .states import Equilibrium, NoEquilibriumError

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

#: Share of the energy and of the largest reaction by which an update of the parameters
#: may change them at a state.
SETTLED = 0.0025

# Maximum number of iterations with the line search, as a multiple of the maximum before
# it.
_DESCENT = 3

# Maximum number of iterations between tools before and after an unstable equilibrium,
# as a multiple of the maximum without them.  Steps of slack plies, which have many
# wrinkled states, often take more than a hundred, and halving a step takes longer than
# continuing.
_BETWEEN_TOOLS = 5

# Increments between tools that the watchdog (`Descent`) allows before it goes back.
# With fewer, a slack ply of stiff fibres takes more than twice as many solves, with
# more as many (`pytest tests/contact/test_stiff_fibres.py` bounds the solves with 8).
_WATCHED = 8

# Trial lengths of an increment, each half the previous one, until every law has a value
# or the energy decreases.  The last, 2⁻¹¹, is shorter than any in a converging
# iteration.
_HALVINGS = 12

# Share of the predicted decrease of the energy that an increment must reach (Armijo's
# rule, with the constant of Nocedal & Wright, Numerical Optimization, 2006, section
# 3.1).
_ARMIJO = 1e-4

#: Update of the parameters of an iterate after an increment with a tangent.
Update = Callable[[Iterate, Tangent], Iterate]

# Reaction of a support, relative to the sum of all loads, below which there is none.
# Measured: with 1e-5 shear angles differ by up to 0.02° from another path to the same
# state.
_IN_BALANCE = 1e-6

# Residual, relative to the sum of all loads, below which self-balancing loads are
# balanced within an iteration, and share of it below which they are balanced again.
# Measured on four tools: 9 to 15 solves, without it 11 to 20, with 1e-5 10 to 19; up to
# 31 if they are balanced at each tenth, because reactions at a residual differ from
# those at equilibrium by a share of it.
_BALANCED, _BALANCED_AGAIN = 1e-4, 1e-2

#: Called with the number of an iteration, its residual and its tolerance, both in N.
Report = Callable[[int, float, float], None]


@dataclass
class Whole:
    """Full increments, limited in length and to the domains of all laws.

    The first increment of a ply in its plane has any length: it brings the fixed
    unknowns to their values.

    Parameters
    ----------
    problem
        The problem.
    longest
        Largest change of the displacement gradient in an increment.
    """

    problem: Problem
    longest: float = np.inf

    def __call__(self, at: Iterate, increment: Increment) -> tuple[Iterate, Increment]:
        """Iterate to continue from, and the shortened increment."""
        problem, du = self.problem, increment.du
        if at.tension is not None or problem.in_space:
            du = du / max(1.0, problem.ply.largest_gradient(du) / self.longest)
        du = within_laws(problem, at.u, du, at.parameters)
        return at, increment._replace(du=du)


@dataclass
class Descent(Whole):
    """Line search or watchdog: the energy must decrease after a few increments.

    If the energy has not decreased after an increment and ``patience`` further ones,
    the iteration goes back to the displacement before the first of them and halves it:
    a backtracking line search for a patience of 0, else the watchdog technique of
    Chamberlain et al. (1982; Nocedal & Wright 2006, section 15.6).  The first increment
    of a ply in its plane is exempt.

    Parameters
    ----------
    patience
        Number of further increments.
    """

    patience: int = 0
    _watched: "tuple[Line, Increment] | None" = None
    _left: int = 0

    def __call__(self, at: Iterate, increment: Increment) -> tuple[Iterate, Increment]:
        """Iterate to continue from, this or an earlier one, and the increment there."""
        at, increment = super().__call__(at, increment)
        if at.tension is None:
            return at, increment
        if self._watched is None:
            line = Line(self.problem, at, increment.du)
            self._watched, self._left = (line, increment), self.patience
        line, first = self._watched
        moved = self.problem.moved(at.u, increment.du)
        if line.falls_to(moved) or self._nearer(at, line.at):
            self._watched = None
        elif not self._left:
            at, increment = line.at, first._replace(du=line.halved())
            self._watched = None
        self._left -= 1
        return at, increment

    def _nearer(self, at: Iterate, before: Iterate) -> bool:
        """True if forces between plies, which have no energy, are closer to balance."""
        problem = self.problem
        if problem.tools == problem.contacts:
            return False
        both = (problem.unbalanced(x.f, x.u) for x in (at, before))
        return next(both) < 0.5 * next(both)


@dataclass(frozen=True, eq=False)
class Line:
    """Energy along an increment.

    Attributes
    ----------
    problem, at, du
        The problem, the iterate before the increment, and the increment.
    """

    problem: Problem
    at: Iterate
    du: ndarray

    @cached_property
    def energy(self) -> float:
        """Energy before the increment in N·mm."""
        return self.problem.energy(self.at.u, self.at.parameters)

    def falls_to(self, u: ndarray, share: float = 1.0) -> bool:
        """Armijo's condition for a share of the increment, with the slope f·du.

        Also true if the slope is not negative.
        """
        slope, round_off = float(self.at.f @ self.du), 8 * EPSILON * abs(self.energy)
        if slope >= 0:
            return True
        fall = self.problem.energy(u, self.at.parameters) - self.energy
        return fall <= _ARMIJO * share * slope + round_off

    def halved(self) -> ndarray:
        """Backtrack until the energy decreases; the full increment if it never does."""
        for share in 0.5 ** np.arange(1, _HALVINGS):
            if self.falls_to(self.problem.moved(self.at.u, share * self.du), share):
                return share * self.du
        return self.du


def within_laws(
    problem: Problem, u: ndarray, du: ndarray, parameters: PlyParameters
) -> ndarray:
    """Halve an increment until every law is defined after it; error if none is."""
    for share in 0.5 ** np.arange(_HALVINGS):
        if problem.in_domain(u + share * du, parameters):
            return share * du
    raise problem.beyond(
        u + share * du,
        "even the shortest increment leaves the domain of a law",
        "a law with a larger domain (for a table: more points, or "
        "extrapolation='linear'), or a smaller load",
    )


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

    def solve(self, attempt: "Attempt", start: Evaluation) -> Equilibrium:
        """Balance the forces and bring the fixed unknowns to their values.

        ``start`` is the initial guess.

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

    An iteration that has not converged after ``most`` increments continues with a line
    search (`Descent`).  Where a term has a ``line_search``, this holds for every
    increment after the first.  Near the equilibrium the parameters of the terms are
    updated (`NearEquilibrium`).

    Between tools, each increment determines the contact nodes (`ActiveSet`).  An
    increment that rotates nearly inextensible fibres stretches them to second order and
    may increase the energy, which the next increments decrease (`Descent`).  Parameters
    are updated before the first equilibrium at a load factor, and kept in the
    iterations that follow an update there.

    At an unstable equilibrium, or if it has not converged and the tangent is
    indefinite, the iteration moves along the softest mode and continues, without tools
    with the line search.  It does not where the load path is followed.

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

    def solve(self, attempt: "Attempt", start: Evaluation) -> Equilibrium:
        """See `Method`."""
        problem = attempt.problem
        follows = attempt.most_projected < np.inf and not problem.contacts
        if not follows:
            attempt.most_projected = np.inf
        direction = (active_set.ActiveSet if problem.contacts else Definite)(problem)
        at = direction.first(start)
        for stage in self._stages(problem, start.keeps_parameters):
            if attempt.residuals and at.unstable and not follows:
                motion = self.imperfection * problem.element_size * at.tangent.softest()
                at = direction.beside(at, problem.moved(at.u, motion))
            at = iterate(attempt, at, direction, *stage)
            if attempt.is_balanced and (follows or not at.unstable):
                break
        return attempt.equilibrium(at)

    def _stages(
        self, problem: Problem, keeps_parameters: bool
    ) -> list[tuple[Whole, Update, int]]:
        """Globalisation, update of parameters and most increments of each stage.

        The second stage follows if the first does not converge, or converges to an
        unstable equilibrium.
        """
        each = problem, self.longest
        if problem.contacts:
            update = unchanged if keeps_parameters else NearEquilibrium(problem)
            most = _BETWEEN_TOOLS * self.most
            return [(Descent(*each, _WATCHED), update, most) for _ in range(2)]
        first = (Descent if problem.line_search else Whole)(*each)
        return [
            (first, NearEquilibrium(problem, _BALANCED), self.most),
            (Descent(*each), NearEquilibrium(problem), _DESCENT * self.most),
        ]


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

    def solve(self, attempt: "Attempt", start: Evaluation) -> Equilibrium:
        """See `Method`."""
        direction, whole = Direction(attempt.problem), Whole(attempt.problem)
        at = direction.first(start)
        at = iterate(attempt, at, direction, whole, unchanged, self.most)
        return attempt.equilibrium(at)


#: Nonlinear solvers by name.
METHODS: dict[str, Method] = {x.name: x for x in (Newton(), PlainNewton())}


@dataclass
class Attempt:
    """Attempt of a nonlinear solver: its target, residuals and convergence.

    Attributes
    ----------
    problem, fixed_values
        Problem, and values of the fixed unknowns.
    most_projected
        Maximum number of projected tangents.
    report
        Called after each iteration.
    residuals, tolerance
        Largest free nodal force in N after each iteration, and its last tolerance.
    projected
        Number of projected tangents.
    is_balanced
        True if the last iteration has converged.
    round_off
        Round-off of the forces in N after the last iteration.
    """

    problem: Problem
    fixed_values: ndarray
    most_projected: float
    report: Report
    residuals: list[float] = field(default_factory=list)
    projected: int = 0
    tolerance: float = 0.0
    is_balanced: bool = False
    round_off: float = 0.0

    def record(self, tangent: Tangent, at: Iterate) -> bool:
        """Record an iteration by a tangent; True if the forces balance after it.

        Raises an error if too many tangents were projected, forces are not finite, or
        the ply flies away.
        """
        problem, u, f = self.problem, at.u, at.f
        self.residuals.append(problem.unbalanced(f, u))
        self.tolerance = tangent.tolerance(u, f, at.parameters)
        self.round_off = tangent.round_off(u)
        self.projected += tangent.projected
        self.report(len(self.residuals), self.residuals[-1], self.tolerance)
        if self.projected > self.most_projected:
            raise NoEquilibriumError(
                f"more than {self.most_projected:g} tangents were indefinite",
                problem.around(problem.unfixed(f, u)),
                advice=_ON_SURFACE if problem.surfaces else "",
            )
        if problem.flies(u, self.fixed_values):
            raise NoEquilibriumError(
                f"the ply moves by {np.abs(u).max():.2g} mm, far beyond its size and "
                "the motions of supports and tools: nothing stops it",
                advice=HOLD,
            )
        below = self.residuals[-1] <= self.tolerance
        self.is_balanced = below and problem.is_fixed(u, self.fixed_values)
        return self.is_balanced

    def equilibrium(self, end: Iterate) -> Equilibrium:
        """The equilibrium at the end of the iteration; an error if there is none."""
        problem, (u, f, p, *_, tangent) = self.problem, end
        residual, tolerance = self.residuals[-1], self.tolerance
        if not self.is_balanced:
            advice = "more steps, or a larger stabilisation"
            if residual <= _STALLED * max(tolerance, self.round_off):
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


def iterate(
    attempt: Attempt,
    at: Iterate,
    direction: Direction,
    globalisation: Whole,
    update: Update,
    most: int,
) -> Iterate:
    """Run Newton's method for at most ``most`` increments; returns the last iterate.

    Its tangent is the consistent one at equilibrium, else the one of the next
    increment.
    """
    for _ in range(most):
        increment = direction.increment(at, attempt.fixed_values)
        at, increment = globalisation(at, increment)
        at = update(direction.after(at, increment), increment.tangent)
        balanced = attempt.record(increment.tangent, at)
        del increment  # and its factors, before the next ones
        if balanced:
            tangent = tangent_at(attempt.problem, at.u, at.parameters)
            return at._replace(tangent=tangent)
    return at._replace(tangent=direction.tangent(at))


def between(before: PlyParameters, after: PlyParameters, share: float) -> PlyParameters:
    """Parameters interpolated between two sets."""

    def mixed(old: Values, new: Values) -> Values:
        return type(old)({name: x + share * (new[name] - x) for name, x in old.items()})

    return Frozen({term: mixed(old, after[term]) for term, old in before.items()})


@dataclass
class Damped:
    """Fixed-point iteration whose updates are halved unless changes decrease by half.

    Attributes
    ----------
    change
        Change by the last update.
    share
        Share of an update that is applied.
    """

    change: float = np.inf
    share: float = 1.0

    def converges(self, change: float, limit: float) -> bool:
        """True if this change and all further ones add up to at most a limit.

        Further changes form a geometric series with the ratio of the last two.
        """
        return change <= limit * (1.0 - (change / self.change if change else 0.0))

    def __call__(
        self, before: PlyParameters, after: PlyParameters, change: float
    ) -> PlyParameters:
        """Parameters after an update that causes a change."""
        if change > self.change / 2:
            self.share /= 2
        self.change = change
        return after if self.share == 1.0 else between(before, after, self.share)


@dataclass
class NearEquilibrium:
    """Updates of the parameters in an iteration near its equilibrium.

    Each one requires a tenth of the residual of the previous one, and uses the
    predicted tensions.  Between tools they continue to the equilibrium, except of the
    contact forces, which each increment determines itself; elsewhere until one changes
    the energy by less than `SETTLED`, or by more than half of the previous change.

    Parameters
    ----------
    problem
        The problem.
    balance
        Residual, relative to the sum of the loads, below which loads that leave the
        supports without reactions are balanced.
    """

    problem: Problem
    balance: float = 0.0
    _near: float = NEAR
    _settled: bool = False
    _damped: Damped = field(default_factory=Damped)

    def __call__(self, at: Iterate, tangent: Tangent) -> Iterate:
        """The iterate, with updated parameters if it is near enough."""
        problem, p = self.problem, at.parameters
        if not at.unbalanced(problem) < self._near:
            return at
        self._near *= NEAR
        after = p if self._settled else self._updated(at)
        if problem.balancing and not tangent.projected:
            loads = np.abs(problem.load(at.u, p)).sum()
            residual = problem.unbalanced(at.f, at.u) / loads
            if residual < self.balance and not balances(problem, at.u, at.f, p):
                self.balance = _BALANCED_AGAIN * residual
                after = balanced(problem, tangent, at.f, after)
        if after is p:
            return at
        return at._replace(parameters=after, f=problem.residual(at.u, after))

    def _updated(self, at: Iterate) -> PlyParameters:
        """Parameters after an update."""
        problem, p = self.problem, at.parameters
        after = problem.ply.updated(p, at.u, problem.load_factor, at.tension)
        if after is p:
            return p
        if problem.contacts:
            return Frozen({**after, **active_set.of_tools(problem, p)})
        change, last = self._change(at, after), self._damped.change
        self._settled = not SETTLED < change <= last / 2
        if change <= SETTLED / 2 and last < np.inf:
            return p
        return self._damped(p, after, change)

    def _change(self, at: Iterate, after: PlyParameters) -> float:
        """Relative change of the energy by an update."""
        both = (self.problem.energies(at.u, p)[0] for p in (at.parameters, after))
        old, new = (sum(energies.values()) for energies in both)
        return abs(new - old) / abs(old) if old else np.inf


def unchanged(at: Iterate, tangent: Tangent) -> Iterate:
    """The iterate, without an update."""
    return at


def balances(problem: Problem, u: ndarray, f: ndarray, p: PlyParameters) -> bool:
    """False if a self-balancing load leaves support reactions."""
    if not problem.balancing:
        return True
    allowed = _IN_BALANCE * np.abs(problem.load(u, p)).sum()
    return bool(np.abs(problem.motions_of_supports(u) @ f).max() <= allowed)


def balanced(
    problem: Problem, tangent: Tangent, f: ndarray, parameters: PlyParameters
) -> PlyParameters:
    """Parameters with self-balancing loads adjusted so that reactions vanish.

    A reaction is the work of the nodal forces over the linear response to a unit
    displacement of its prescribed unknown.
    """
    motions, values = tangent.motions(), {}
    work = motions @ f
    for term in problem.balancing:
        p = parameters[term.name]
        values[term.name] = term.balanced(p, motions, work)
    return Frozen({**parameters, **values})
