"""Incremental solution: a growing load, and at each step a state that stands trial."""

import logging
import os
from collections.abc import Callable, Collection, Mapping, Sequence
from time import perf_counter
from typing import Any

import numpy as np
from numpy import ndarray

from .body import Body
from .checkpoint import Checkpoint, CheckpointError, Progress, Saved
from .conditions import Condition, Constraints
from .linear import check_solver
from .path import Path
from .problem import (
    PROBED,
    Clock,
    Equilibrium,
    NoEquilibriumError,
    Problem,
    Start,
    tangent_at,
)
from .result import Iteration, Result, State, StepError
from .search import Goal, Search, follows_path, strategy_of
from .strategies import STRATEGIES, Strategy
from .verdict import CHECKS, Trial

log = logging.getLogger(__name__)

#: What a step tries and which checks only warn, unless told otherwise.
DEFAULT_STRATEGIES = "mixed", "descent"
DEFAULT_WARN_ONLY = "work", "stabilisation", "corners"

# After a step of no more linear solves than this the next may be twice as long.
_EASY_SOLVES = 6

_MOST_STEPS = 1_000_000

# How well a limit load is to be known, as a share of it, and the shortest step on the
# way to it, as a share of the load.
_LIMIT_KNOWN, _SHORTEST = 0.005, 1e-9

# Share of the element size by which nodes are moved to see what loads depend on.
_PROBE = 1e-3

# A load factor near 1 has 53 binary digits, and 20 of them are for the steps.
_MOST_HALVINGS = 30


class LoadStepper:
    """Load a ply, in steps that shrink where they fail and grow where they are easy.

    Each step tries its strategies one after the other.  What they find stands trial: a
    state that is folded, torn or not stable is refused.  A step that fails is halved.

    Parameters
    ----------
    ply
        The ply to load.
    conditions
        Displacement conditions by name.
    steps
        Number of equal steps to the load factor 1.  The run has a state at the end of
        each, and in between where a step had to be halved.
    strategies
        What a step tries, in this order: names of `STRATEGIES`, or strategies.
    max_halvings
        How often a step may be halved before the run stops.
    warn_only
        Checks of `CHECKS` that do not refuse a state but only warn.
    on_iteration, on_step
        Called with each `Iteration` and with each converged `State`.
    checkpoint
        A folder to which every converged state is written.
    solver
        Linear solver: ``superlu``, ``cholmod`` (needs cvxopt), ``pardiso`` (needs
        pypardiso), or ``auto`` for the fastest that is installed, which large systems
        measure once in a process.

    Raises
    ------
    ValueError
        If a condition is not valid at some load factor, ``steps`` is no whole number
        from 1 to a million, ``max_halvings`` none from 0 to 30, a strategy or check
        unknown, the solver unknown or not installed, or something is of another kind.

    Examples
    --------
    A square ply sheared by 45°:

    >>> from skfem import MeshQuad
    >>> from skfem_textile import Condition, Fabric, Full, LoadStepper, Ply
    >>> ply = Ply(MeshQuad().refined(2), Fabric(1e4, shear=1.0), Full())
    >>> def arc(X, t):
    ...     angle = np.full(X.shape[1], t * np.pi / 4)
    ...     return np.stack([np.sin(angle), np.cos(angle) - 1])
    >>> conditions = {
    ...     "clamp": Condition(lambda X: X[1] == 0),
    ...     "slide": Condition(lambda X: X[1] == 1, arc),
    ... }
    >>> stepper = LoadStepper(ply, conditions, steps=2)
    >>> result = stepper.run()
    >>> round(result.summary()["max_shear_angle_deg"], 1)
    45.0
    """

    def __init__(
        self,
        ply: Body,
        conditions: Mapping[str, Condition],
        steps: int = 20,
        *,
        strategies: Sequence[str | Strategy] = DEFAULT_STRATEGIES,
        max_halvings: int = 8,
        warn_only: Collection[str] = DEFAULT_WARN_ONLY,
        on_iteration: Callable[[Iteration], None] | None = None,
        on_step: Callable[[State], None] | None = None,
        checkpoint: str | os.PathLike[str] | None = None,
        solver: str = "auto",
    ) -> None:
        if isinstance(ply, type) or not hasattr(ply, "stiffness"):
            raise ValueError(f"ply must be a Ply, not {type(ply).__name__}")
        _refuse_numbers(steps, max_halvings)
        _refuse_no_list("strategies", strategies, STRATEGIES)
        _refuse_no_list("checks in warn_only", warn_only, CHECKS)
        if not strategies:
            raise ValueError(f"name at least one strategy of {', '.join(STRATEGIES)}")
        for name in warn_only:
            if name not in [*CHECKS]:
                known = ", ".join(CHECKS)
                raise ValueError(f"unknown check {name!r}: choose of {known}")
        for name, function in (("on_iteration", on_iteration), ("on_step", on_step)):
            if function is not None and not callable(function):
                raise ValueError(f"{name} must be a function, not {function!r}")
        check_solver(solver)
        self.problem = Problem(ply, Constraints(ply.basis, conditions), solver)
        self.load_factors = np.linspace(0.0, 1.0, int(steps) + 1)[1:].tolist()
        for t in (0.0, *self.load_factors):
            self.problem.constraints.fixed_values(t)  # refuses what is not valid
        chosen = [strategy_of(strategy) for strategy in strategies]
        self._follows = any(map(follows_path, chosen))
        # Loads that grow may jump to another equilibrium: there work must agree.
        self._loaded = self._follows and self._loads_grow()
        at_rest = ply.load(ply.basis.zeros(), 0.0)
        self._loaded_at_rest = self._follows and bool(np.any(at_rest))
        refusing = {"work"} if self._loaded else set()
        self._search = Search(
            self.problem, chosen, frozenset(warn_only) - refusing, self._tell
        )
        self.max_halvings = max_halvings
        self.on_iteration, self.on_step = on_iteration, on_step
        self.checkpoint = (
            Checkpoint(checkpoint, self.problem, self._settings())
            if checkpoint
            else None
        )
        self._states: list[State] = []

    def run(self, resume: bool = False) -> Result:
        """Apply the whole load.

        Parameters
        ----------
        resume
            Go on from the last state in the checkpoint, if it holds one.

        Raises
        ------
        StepError
            If a step fails however often it is halved, a condition has no valid value
            at some load factor, or a checkpoint cannot be written.
        CheckpointError
            If the checkpoint is damaged, or of another run.
        ValueError
            If there is no checkpoint to resume from, or a law is not finite at rest.
        """
        if resume and not self.checkpoint:
            raise ValueError("no checkpoint to resume from: name its folder")
        try:
            self._begin(resume)
            self._march()
        except NoEquilibriumError as failure:
            raise self._stopped(failure) from None
        finally:
            self._warn_of_path()
            if self.checkpoint:
                self.checkpoint.release()
        return self.result

    @property
    def states(self) -> tuple[State, ...]:
        """The states so far; none before a run."""
        return tuple(self._states)

    @property
    def result(self) -> Result:
        """What the run has found so far; after an interruption, all of it."""
        if not self._states:
            raise RuntimeError("the load stepper has not been run")
        clock = self.problem.clock
        return Result(
            ply=self.problem.ply,
            states=list(self._states),
            converged=self._states[-1].load_factor == 1.0,
            linear_solves=clock.solves,
            factorisations=clock.factorisations,
            steps_cut=self._steps_cut,
            unresolved=tuple(self._path.unresolved),
            wall_time_s=perf_counter() - self._began,
            assembly_time_s=clock.seconds["assembly"],
            solve_time_s=clock.seconds["solve"],
            solver=self.problem.system.solver.choice,
        )

    def _begin(self, resume: bool) -> None:
        """Start from the ply at rest, or from where the checkpoint ends."""
        problem, checkpoint = self.problem, self.checkpoint
        problem.clock, self._began = Clock(), perf_counter()
        self._length, self._steps_cut, self._states = self.load_factors[0], 0, []
        halvings = self.max_halvings if self._follows else 0
        self._path = Path(self._length, halvings)
        self._warned: set[str] = set()
        saved = checkpoint.load() if checkpoint and resume else None
        if saved:
            self._go_on(saved)
            return
        problem.ply.reset()
        u = problem.ply.basis.zeros()
        with np.errstate(all="ignore"):  # what is not finite is caught
            f, (energies, potentials) = problem.residual(u), problem.energies(u)
            if not np.isfinite([*f, *energies.values(), *potentials.values()]).all():
                raise ValueError("a law has no finite energy or force at rest: mend it")
            if checkpoint:
                checkpoint.begin()
            if resume:
                log.warning("nothing to resume: the run starts from the undeformed ply")
            self._rest(u, f, energies, potentials)

    def _loads_grow(self) -> bool:
        """Whether the load factor drives loads, and not only displacements."""
        ply = self.problem.ply
        if "load" not in ply.roles.values():
            return False
        moved = np.random.default_rng(0).uniform(-1.0, 1.0, ply.basis.N)
        u = _PROBE * ply.element_size * moved  # some loads depend on it
        at_rest = ply.load(u, 0.0)
        return any(
            not np.array_equal(ply.load(u, t), at_rest)
            for t in (*PROBED, *self.load_factors)
        )

    def _rest(
        self,
        u: ndarray,
        f: ndarray,
        energies: Mapping[str, float],
        potentials: Mapping[str, float],
    ) -> None:
        """Keep the state at the load factor 0: balanced, and held as conditions ask.

        A ply at rest may have motions without stiffness, but none that gains energy.
        """
        problem = self.problem
        tangent, unbalanced = tangent_at(problem, u), problem.unbalanced(f)
        tolerance = tangent.tolerance(u, f) if tangent else 0.0
        undeformed = Equilibrium(u, f, (unbalanced,), tolerance)
        trial = Trial(problem, undeformed, None, 0.0, energies, potentials)
        trial.tangent = tangent
        state = self._state(0.0, trial)
        self._start = Start(u, f, problem.load(u), tangent)
        values = problem.constraints.fixed_values(0.0)
        balanced = unbalanced <= tolerance and problem.is_fixed(u, values)
        if balanced and not state.verdict.negative_pivots:
            self._keep(state, trial)
        else:
            self._states = [state]  # until the ply is in balance
            self._advance(0.0)

    def _go_on(self, saved: Saved) -> None:
        """Take up a run where its checkpoint ends."""
        progress, last = saved.progress, saved.states[-1]
        problem, u = self.problem.at(last.load_factor), last.u
        self._start = problem.start(u)
        self._states = saved.states
        self._length, self._steps_cut = progress.length, progress.steps_cut
        self._path = progress.path
        problem.clock = self.problem.clock = progress.clock  # with that tangent
        self._began -= progress.elapsed
        log.info("resumed at load factor %g", saved.states[-1].load_factor)

    def _march(self) -> None:
        """Reach the requested load factors one after the other."""
        longest = self.load_factors[0]
        shortest = longest / 2.0**self.max_halvings
        for goal in self.load_factors:
            while (t := self._states[-1].load_factor) < goal:
                ahead, until = t + self._length, self._path.until(goal)
                if ahead > until - 0.5 * min(shortest, self._length):
                    ahead = until
                try:
                    kept = self._advance(ahead)
                except NoEquilibriumError as failure:
                    step = ahead - t
                    if step > 1.5 * shortest or self._brackets(t, ahead):
                        log.info("step to %g failed, halved: %s", ahead, failure)
                        kept = False
                    elif self._growth(t, ahead):
                        raise _limit(failure, t, ahead) from None
                    elif self._path.stop_following(goal):
                        log.info("step to %g failed, however short: %s", ahead, failure)
                        self._length, kept = longest, True
                    else:
                        raise
                if not kept:
                    self._length = 0.5 * (ahead - t)
                    self._steps_cut += 1

    def _advance(self, t: float) -> bool:
        """Find a state at the load factor ``t``; whether it was kept."""
        try:
            values = self.problem.constraints.fixed_values(t)
            self.problem.ply.load(self._start.u, t)  # whose factor is a user's function
        except ValueError as error:
            raise self._stopped(error) from None
        before = self._states[-1]
        step, energy = t - before.load_factor, sum(before.energies.values())
        loaded = self._loaded if t else self._loaded_at_rest
        most_altered = self._path.most_altered(step, t, loaded)
        goal = Goal(t, step, values, self._start, energy, most_altered)
        trial, followed_path = self._search(goal)
        state, altered = self._state(t, trial), trial.found.altered
        if self._path.must_repeat(step, state, altered, followed_path):
            log.info("step to %g was hard, taken again as two", t)
            return False
        if step == 0:
            self._states = []
        self._path.reached(state)
        self._keep(state, trial)
        return True

    def _brackets(self, t: float, beyond: float) -> bool:
        """Whether a limit between two load factors is not yet known well enough."""
        return beyond - t > _SHORTEST and self._growth(t, beyond) > _LIMIT_KNOWN

    def _growth(self, t: float, beyond: float) -> float:
        """By how much loads grow between load factors, over their growth from 0 on.

        Zero where some motion of the last good state meets no stiffness: whatever the
        load, it finds no balance there.
        """
        if not self._loaded or self._states[-1].verdict.negative_pivots is None:
            return 0.0
        ply, u = self.problem.ply, self._states[-1].u
        none, least, most = (ply.load(u, factor) for factor in (0.0, t, beyond))
        largest = max(np.abs(least - none).max(), np.abs(most - none).max())
        return float(np.abs(most - least).max() / largest) if largest else 0.0

    def _tell(self, iteration: Iteration) -> None:
        log.debug("%s", iteration)
        if self.on_iteration is not None:
            self.on_iteration(iteration)

    def _state(self, t: float, trial: Trial) -> State:
        problem, found = self.problem, trial.found
        return State(
            load_factor=t,
            u=found.u,
            reactions=problem.reactions(found.f),
            displacements=problem.displacements(found.u),
            energies=dict(trial.energies),
            potentials=dict(trial.potentials),
            verdict=trial.verdict(),
            linear_solves=problem.clock.solves
            - sum(before.linear_solves for before in self._states),
            residuals=found.residuals,
            tolerance=found.tolerance,
        )

    def _keep(self, state: State, trial: Trial) -> None:
        """Add a state, and make it the start of the next step."""
        problem, found, t = trial.problem, trial.found, state.load_factor
        for check, warning in trial.warnings.items():
            first = check not in self._warned
            level = logging.WARNING if first else logging.INFO
            log.log(level, "load factor %g: %s", t, warning)
            self._warned.add(check)
        if problem.ply.commit(u := found.u):
            self._start = problem.start(u)
        else:
            self._start = Start(u, found.f, problem.load(u), trial.tangent)
        if t > 0:
            self._judge_drift(state)
        if state.linear_solves <= _EASY_SOLVES:
            self._length = min(2 * self._length, self.load_factors[0])
        self._save(state)
        self._states.append(state)
        log.info("load factor %g: %d linear solves", t, state.linear_solves)
        if self.on_step is not None and t > 0:
            self.on_step(state)

    def _judge_drift(self, state: State) -> None:
        """Tell the path how much depends on what the ply remembers of this step."""
        before, tangent = self._states[-1], self._start.tangent
        drift, held = self.problem.ply.drift
        names = self.problem.ply.memories
        now, then = (s.energies | s.potentials for s in (state, before))
        rise = sum(now[name] - then[name] for name in names)
        self._path.drifted(state, rise, drift, held)
        if state.load_factor == 1.0 and tangent and self._path.matters(state, drift):
            settled = self.problem.reactions(tangent.settled(self._start.f))
            self._path.settles(state, settled)

    def _warn_of_path(self) -> None:
        if places := self._path.unresolved:
            shown = ", ".join(f"{t:.4g}" for t in places[:5])
            log.warning(
                "the path was not resolved at load factor %s: another number of steps "
                "may lead to another equilibrium; compare with more steps",
                shown + (", ..." if len(places) > 5 else ""),
            )

    def _save(self, state: State) -> None:
        """Write a state to the checkpoint, if there is one."""
        if not self.checkpoint:
            return
        elapsed, clock = perf_counter() - self._began, self.problem.clock
        progress = Progress(self._length, self._steps_cut, self._path, clock, elapsed)
        try:
            self.checkpoint.save(len(self._states), state, progress)
        except CheckpointError as error:
            if not self._states:
                raise
            raise self._stopped(error) from None

    def _stopped(self, error: Exception) -> StepError:
        """The error that ends a run, with what the run has found."""
        at = self._states[-1].load_factor
        elements = getattr(error, "elements", np.empty(0, dtype=int))
        return StepError(
            f"stopped at load factor {at:.6g}: {error}"
            + _among(elements)
            + (f"; try {advice}" if (advice := getattr(error, "advice", "")) else ""),
            self.result,
            elements,
        )

    def _settings(self) -> dict[str, Any]:
        """What the states depend on beyond the problem."""
        return {
            "steps": len(self.load_factors),
            "strategies": [repr(strategy) for strategy in self._search.strategies],
            "max_halvings": self.max_halvings,
            "warn_only": sorted(self._search.warn_only),
        }


def _refuse_numbers(steps: Any, max_halvings: Any) -> None:
    if not _is_whole(steps, 1, _MOST_STEPS):
        raise ValueError(
            "steps must be at least 1, and whole, and no more than "
            f"{_MOST_STEPS}; got {steps!r}"
        )
    if not _is_whole(max_halvings, 0, _MOST_HALVINGS):
        raise ValueError(
            f"max_halvings must be a whole number from 0 to {_MOST_HALVINGS}, got "
            f"{max_halvings!r}"
        )


def _limit(failure: NoEquilibriumError, t: float, beyond: float) -> NoEquilibriumError:
    """What to say where a load cannot grow."""
    return NoEquilibriumError(
        f"between the load factors {t:.6g} and {beyond:.6g} the load passes a limit: "
        f"no acceptable state near the last one carries more of it ({failure})",
        failure.elements,
        "displacements in place of the load, or a smaller load",
    )


def _is_whole(number: Any, least: int, most: int) -> bool:
    try:
        return least <= int(number) == number <= most
    except (TypeError, ValueError, OverflowError):
        return False


def _refuse_no_list(what: str, given: Any, known: Collection[str]) -> None:
    """Refuse a name alone, whose letters would be taken for names, and what is none."""
    if isinstance(given, str) or not isinstance(given, Collection):
        raise ValueError(
            f"{what} must be given as a list, of {', '.join(known)}; got {given!r}"
        )


def _among(elements: ndarray) -> str:
    """The first of some elements, for a message."""
    if not elements.size:
        return ""
    first = ", ".join(map(str, elements[:5]))
    return f" (element {first}{', ...' if elements.size > 5 else ''})"
