"""Continuation in the load factor: step length, load path, limit loads.

A ply may have several stable equilibria under one load.  A short step leads to the one
that continues the load path; a long step may lead to another.  Indefinite tangents
during the iterations indicate this.  A step with few of them is easy and stays on the
path.  A hard step is halved until its halves are easy or short; then its end is
computed in one step and in two, and both must agree.
"""

import logging
from bisect import bisect_left
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray

from ..mesh.user_input import shortened
from ..ply.amount import ends_of_parts
from ..ply.parameters import PlyParameters
from . import active_set
from .direction import TINY
from .problem import HOLD, Evaluation, Problem
from .states import NoEquilibriumError, Overload, State

log = logging.getLogger(__name__)

# Relative difference of energies and reactions below which two states count as one.  A
# larger value would merge two equilibria; with a smaller one, differences caused by
# round-off and by C_s of the previous state would count as another equilibrium.
_SAME_STATE = 0.01

#: Maximum number of projected tangents in an easy step.  Checked by `python -m studies
#: stability`: with more, a run reaches another equilibrium unnoticed; with fewer, steps
#: that stay on the path are halved.
MOST_PROJECTED = 2

#: Divisor of a step in which the ply flew away, a limit of work: shorter steps seldom
#: stop it, and each attempt is long.
SHORTER_AFTER_FLIGHT = 16

# Number of halvings of a requested step after which a hard step is accepted: 2⁻⁶.
_PATH_HALVINGS = 6

# Maximum number of load factors listed in a warning.
_SHOWN = 5

# Relative accuracy of a limit load, a limit of work: half the value takes about one
# more halving.
_KNOWN_SHARE = 0.005

# Shortest step towards a limit, in load factors.  With a longer one, the search may end
# before the limit is located; a shorter one adds steps whose changes are round-off.
_SHORTEST_STEP = 1e-9

# Work of growing loads, relative to the energy of a ply, above which they drive it:
# half, because the work of a load that alone drives a ply is at least the energy.
_DRIVES = 0.5


# Largest accepted number of equal steps; more are considered a mistake.
_MOST_STEPS = 1_000_000


@dataclass(frozen=True)
class LoadSteps:
    """Requested load steps: parts of equal length, each in equal steps.

    Attributes
    ----------
    numbers
        Number of steps of each part.
    """

    numbers: tuple[int, ...]

    @property
    def stated(self) -> int | list[int]:
        """The numbers as an argument of `LoadStepper`."""
        return self.numbers[0] if len(self.numbers) == 1 else [*self.numbers]

    def ends(self, finer: int = 1) -> list[float]:
        """Load factors from 0 on at which steps end; or parts of these, if finer."""
        load_factors, bounds = [0.0], pairwise(self._parts)
        for (first, last), steps in zip(bounds, self.numbers, strict=True):
            load_factors += np.linspace(first, last, finer * steps + 1)[1:].tolist()
        return load_factors

    def number(self, t: float) -> int:
        """Number of steps of the part that contains a load factor or ends there."""
        return self.numbers[bisect_left(self._parts[1:], t)]

    @cached_property
    def _parts(self) -> list[float]:
        return ends_of_parts(len(self.numbers))

    def length(self, t: float) -> float:
        """Length of these steps."""
        return 1.0 / (len(self.numbers) * self.number(t))


def load_steps(steps: Any) -> LoadSteps:
    """Validated numbers of steps."""
    if not isinstance(steps, list | tuple):
        refuse_steps("steps", steps)
        return LoadSteps((int(steps),))
    for part, number in enumerate(steps, 1):
        refuse_steps(f"steps of part {part}", number)
    refuse_steps("the sum of steps", sum(steps))
    return LoadSteps(tuple(map(int, steps)))


def refuse_steps(name: str, number: Any) -> None:
    """Refuse what is not a number of steps."""
    refuse_unless_whole(name, number, 1, _MOST_STEPS)


def refuse_unless_whole(name: str, number: Any, least: int, most: int) -> None:
    """Refuse a number that is not whole or beyond its limits."""
    with suppress(TypeError, ValueError, OverflowError):
        if least <= int(number) == number <= most:
            return
    raise ValueError(
        f"{name} must be a whole number from {least} to {most}, got {shortened(number)}"
    )


class StepEnd(NamedTuple):
    """Quantities of a state by which a step is compared with two half steps.

    Energy in N·mm, all components of the forces on conditions in N, and the errors of
    both due to the tolerance of the equilibrium.
    """

    load_factor: float
    energy: float
    forces: list[float]
    energy_error: float
    force_error: float

    @classmethod
    def of(cls, state: State) -> "StepEnd":
        """The end of a step to a state."""
        return cls(
            state.load_factor,
            sum(state.energies.values()),
            np.concatenate(list(state.forces.values())).tolist(),
            state.tolerance * float(np.abs(state.u).sum()),
            state.tolerance * state.u.size,
        )

    def agrees(self, other: "StepEnd") -> bool:
        """True if both are the same state within the tolerance."""
        ours, theirs = np.array(self.forces), np.array(other.forces)
        force = np.abs([ours, theirs]).max()
        energy = max(abs(self.energy), abs(other.energy))
        return bool(
            abs(self.energy - other.energy) <= _SAME_STATE * energy + other.energy_error
            and np.abs(ours - theirs).max() <= _SAME_STATE * force + other.force_error
        )


@dataclass
class Continuation:
    """Control of the step length: the end of the next step, and acceptance of a step.

    Attributes
    ----------
    longest
        Length of a requested step, in load factors.
    halvings
        Maximum number of successive halvings.
    follows_path
        True if the load path is followed, see `Method`.
    next
        Length of the next step.
    cut
        Number of halvings so far.
    unresolved
        Load factors at which another number of steps may lead to another equilibrium.
    to_compare
        Ends of hard steps that are being repeated in two halves.
    not_followed_until
        Load factor up to which the path is not followed.
    overloads
        Ends of steps that were refused because a clamp lets go before.
    """

    longest: float
    halvings: int
    follows_path: bool
    next: float
    cut: int = 0
    unresolved: list[float] = field(default_factory=list)
    to_compare: list[StepEnd] = field(default_factory=list)
    not_followed_until: float = -1.0
    overloads: list[Overload] = field(default_factory=list)

    @classmethod
    def of(cls, saved: Mapping[str, Any]) -> "Continuation":
        """The continuation of a checkpoint."""
        to_compare = [StepEnd(*past) for past in saved["to_compare"]]
        overloads = [Overload(*x) for x in saved["overloads"]]
        return cls(**{**saved, "to_compare": to_compare, "overloads": overloads})

    @property
    def _short(self) -> float:
        """Step length at which a hard step is accepted."""
        halvings = max(self.halvings - 2, 0) if self.follows_path else 0
        return self.longest / 2.0 ** min(_PATH_HALVINGS, halvings)

    def enter(self, longest: float) -> None:
        """Scale the step length for requested steps of another length."""
        if longest != self.longest:
            self.next = min(longest, self.next * (longest / self.longest))
            self.longest = longest

    def end(self, t: float, t_end: float) -> float:
        """End of the next step from ``t``, at most ``t_end``.

        The step does not pass the end of a hard step that is to be compared, and leaves
        no remainder that is too short.
        """
        t_end = min([t_end, *(past.load_factor for past in self.to_compare)])
        end = t + self.next
        shortest = self.longest / 2.0**self.halvings
        return t_end if end > t_end - 0.5 * min(shortest, self.next) else end

    def most_projected(self, step: float, t: float, loads_drive: bool) -> float:
        """Number of projected tangents above which a step to ``t`` is halved.

        Always finite if loads drive the ply: beyond a limit load there is no path.
        """
        followed = step > 1.5 * self._short and t > self.not_followed_until
        return MOST_PROJECTED if followed or loads_drive else np.inf

    def accepts(self, step: float, state: State, projected: int, settled: bool) -> bool:
        """True if a step is accepted, False if it is repeated in two halves.

        Parameters
        ----------
        step, state, projected
            Length of the step, the state, and projected tangents in the step.
        settled
            True if the state is independent of the number of steps along the path.
        """
        t = state.load_factor
        if projected > MOST_PROJECTED or not self.follows_path:
            follow = self.follows_path and t > self.not_followed_until
            if follow and self.halves(step):
                self.to_compare.append(StepEnd.of(state))
                return False
            self.mark(t)
        if not settled or t <= self.not_followed_until:
            self.mark(t)
        for past in [past for past in self.to_compare if past.load_factor == t]:
            self.to_compare.remove(past)
            if not past.agrees(StepEnd.of(state)):
                self.mark(t)
        if projected == 0:
            self.next = min(2 * self.next, self.longest)
        return True

    def halves(self, step: float) -> bool:
        """Halve a hard step, unless it is short; False if it is."""
        if not self.halvings or step <= 0.75 * self._short:
            return False
        self.next, self.cut = 0.5 * step, self.cut + 1
        return True

    def _remains(self, overload: Overload) -> bool:
        """True if a clamp is overloaded as at the previous end, further ahead."""
        _, name, load = self.overloads[-1] if self.overloads else (0.0, "", 0.0)
        off = abs(load - overload.load)
        return name == overload.name and off <= _SAME_STATE * load

    def failed(
        self, failure: NoEquilibriumError, t: float, end: float, t_end: float, by: float
    ) -> None:
        """Shorten the failed step from t to ``end``, or stop following the path.

        ``t_end`` is the requested load factor, and ``by`` the growth of the loads in
        the step, see `load_growth`; zero if loads do not drive the ply.  Raises a
        `NoEquilibriumError` if the load exceeds a limit, or if even the shortest steps
        fail.
        """
        step, shortest = end - t, self.longest / 2.0**self.halvings
        if failure.overload:
            if step <= _SHORTEST_STEP or (
                step <= shortest and self._remains(failure.overload)
            ):
                raise NoEquilibriumError(
                    f"{failure}: its force jumps there",
                    failure.elements,
                    "a friction or motion that does not jump, such as rows of a phase, "
                    "more steps, or a larger force of release",
                )
            log.info("the step to load factor %g is shortened: %s", end, failure)
            self.overloads.append(failure.overload)
            return
        known = step <= _SHORTEST_STEP or by <= _KNOWN_SHARE
        if step > 1.5 * shortest or not known:
            log.info(
                "the step to load factor %g failed and is halved: %s", end, failure
            )
            flew = failure.advice == HOLD
            self.next = step / (SHORTER_AFTER_FLIGHT if flew else 2)
            self.cut += 1
        elif by:
            raise NoEquilibriumError(
                f"the load exceeds a limit load between the load factors {t:.6g} and "
                f"{end:.6g}: there is no acceptable state near the last one at a "
                f"higher load ({failure})",
                failure.elements,
                "prescribed displacements instead of the load, or a smaller load",
            )
        elif self.not_followed_until >= t_end or self._short == self.longest:
            raise failure
        else:
            log.info(
                "the step to load factor %g failed even at the minimum length: %s",
                end,
                failure,
            )
            self.not_followed_until = t_end
            self.to_compare.clear()
            self.next = self.longest

    def mark(self, t: float) -> None:
        """Mark the path as unresolved at a load factor."""
        if t not in self.unresolved:
            self.unresolved.append(t)


def path_warning(unresolved: Sequence[float]) -> str:
    """Warning that lists the load factors at which the path was not resolved."""
    factors = ", ".join(f"{t:.4g}" for t in unresolved[:_SHOWN])
    more = ", ..." if len(unresolved) > _SHOWN else ""
    return (
        f"the path was not resolved at load factor {factors}{more}: another number of "
        "steps may lead to another equilibrium; compare with a run with more steps"
    )


def moves(problem: Problem, load_factors: Iterable[float]) -> float:
    """Largest prescribed displacement in mm; infinite if nodes are on surfaces.

    Raises an error if a condition has no valid value at one of the load factors.
    """
    every = map(problem.constraints.fixed_values, load_factors)
    largest = max(float(np.abs(values).max(initial=0.0)) for values in every)
    return np.inf if problem.surfaces else largest


def loads_drive(
    problem: Problem,
    u: ndarray,
    parameters: PlyParameters,
    energies: dict[str, float],
) -> bool:
    """True if growing loads drive the ply, also together with prescribed motions.

    The problem is at the load factor of a state with displacement, parameters and
    energies by term.
    """
    ply, t = problem.ply, problem.load_factor
    if not problem.loaded:
        return False
    if not t:  # no displacement yet, so no work to compare
        return not problem.moves
    parameters = active_set.without(problem, parameters)
    growth = ply.load(u, t, parameters) - ply.load(u, 0.0, parameters)
    if not problem.moves:
        return bool(growth.any())
    return bool(np.abs(growth * u).sum() > _DRIVES * abs(sum(energies.values())))


def load_growth(problem: Problem, state: State, beyond: float) -> float:
    """Growth of the loads from a state to a load factor, relative to the growth from 0.

    Zero at a singular tangent: a mechanism has no equilibrium under any load.
    """
    if state.verdict.negative_pivots is None:
        return 0.0
    u, p = state.u, active_set.without(problem, state.parameters)
    factors = 0.0, state.load_factor, beyond
    none, least, most = (problem.ply.load(u, t, p) for t in factors)
    largest = max(np.abs(least - none).max(), np.abs(most - none).max())
    return float(np.abs(most - least).max() / largest) if largest else 0.0


def balanced_at_rest(
    problem: Problem, load_factors: Iterable[float], tolerance: float
) -> bool:
    """True if the undeformed ply is in balance at all load factors of a run.

    The tolerance in N applies to the nodal forces of all nodes, fixed or free.
    """
    zero, p = problem.ply.basis.zeros(), problem.ply.parameters_at_rest
    return all(
        np.abs(problem.at(t).residual(zero, p)).max() <= tolerance for t in load_factors
    )


def initial_guess(
    problem: Problem, start: Evaluation, states: Sequence[State]
) -> Evaluation:
    """Predictor of a step: the last state, or an extrapolation from it.

    See `surface_predictor` and `secant_predictor`.  Parameters are the last ones.
    """
    if problem.surfaces:
        return surface_predictor(problem, start)
    if problem.contacts and len(states) > 1:
        return secant_predictor(problem, start, states)
    return start


def secant_predictor(
    problem: Problem, start: Evaluation, states: Sequence[State]
) -> Evaluation:
    """Predictor between tools: the last two states, extrapolated linearly.

    The extrapolation is in proportion to the motion of supports and tools.  Where this
    motion turns back without friction, the predictor is between two previous states,
    see `_passed`.  Nodes on straight lines stretch fibres that rotate, to second order;
    the first tangent therefore contains the tensions at the last state.  Returns the
    last state if nothing moves, or if the predictor folds the ply or leaves the domain
    of a law.
    """
    before, last = states[-2:]
    factors = (before.load_factor, last.load_factor, problem.load_factor)
    moved, step = np.diff([_places(problem, t) for t in factors], axis=0)
    share = float(moved @ step / (moved @ moved)) if moved.any() else 0.0
    u, p = start.u + share * (last.u - before.u), start.parameters
    if share < 0 and not any(tool.friction for tool in problem.contacts):
        u = _passed(problem, states)
    guess = _usable(problem, u, p) if share else None
    if guess is None:
        return start
    tension = problem.ply.geometric_tension(start.u, np.zeros_like(u), p)
    return replace(guess, tension=tension)


def _passed(problem: Problem, states: Sequence[State]) -> ndarray:
    """Displacement, linear between two states, with the nearest supports and tools.

    A ply that unloads without friction returns along the states of its loading.
    """
    places = np.array([_places(problem, state.load_factor) for state in states])
    moved, ahead = np.diff(places, axis=0), _places(problem, problem.load_factor)
    along, size = (moved * (ahead - places[:-1])).sum(axis=1), (moved**2).sum(axis=1)
    shares = np.clip(along / np.maximum(size, TINY), 0, 1)[:, None]
    nearest = np.linalg.norm(places[:-1] + shares * moved - ahead, axis=1).argmin()
    before, after = states[nearest], states[nearest + 1]
    return np.asarray(before.u + shares[nearest] * (after.u - before.u))


def _places(problem: Problem, t: float) -> ndarray:
    """Values of the fixed unknowns, and travels of the tools, in mm."""
    travels = (tool.travel(t) for tool in problem.contacts)
    return np.hstack([problem.constraints.fixed_values(t), *travels])


def surface_predictor(problem: Problem, start: Evaluation) -> Evaluation:
    """Predictor for a moving surface: the initial guess is carried along geodesics.

    Returns the initial guess itself if no surface grows, or if carrying it folds the
    ply or leaves the domain of a law.
    """
    assert problem.surfaces
    u = problem.surfaces.carried(start.u, start.load_factor, problem.load_factor)
    guess = None if u is None else _usable(problem, u, start.parameters)
    return start if guess is None else guess


def _usable(
    problem: Problem, u: ndarray, parameters: PlyParameters
) -> Evaluation | None:
    """Evaluation of a displacement; None if it is folded or outside of a law."""
    with np.errstate(all="ignore"):  # non-finite values are detected
        usable = problem.area_ratio(u).min() > 0 and problem.in_domain(u, parameters)
        return problem.evaluation(u, parameters) if usable else None
