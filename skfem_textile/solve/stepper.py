"""Incremental solution: a growing load, and a state at each step, which is judged."""

import logging
import os
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import partial
from time import perf_counter
from typing import Any

import numpy as np
from numpy import ndarray
from scipy.sparse import csc_matrix

from .body import Body
from .checkpoint import Checkpoint, CheckpointError, Progress, Replay, Saved
from .conditions import Conditions, Constraints, OnSurface
from .linear import ChosenSolver
from .linear.solver import Clock
from .problem import Problem, tangent_at
from .result import Result, StepError
from .states import Equilibrium, Iteration, NoEquilibriumError, State
from .stepping.arguments import check_arguments
from .stepping.equilibrium_search import (
    EquilibriumSearch,
    Goal,
    follows_path,
    strategy_of,
)
from .stepping.error_estimate import estimated_error
from .stepping.limit import (
    is_known,
    limit_error,
    load_growth,
    loads_grow,
    nothing_drives,
)
from .stepping.load_path import MOST_ALTERED, LoadPath
from .stepping.step_length import StepLength
from .strategies import Strategy
from .verdict import Trial

log = logging.getLogger(__name__)

#: What a step tries and which checks only warn, unless told otherwise.
DEFAULT_STRATEGIES = "mixed", "descent"
DEFAULT_WARN_ONLY = "work", "stabilisation", "deviation", "corners", "surface"

_NOTHING_DRIVES = (
    "nothing will move: no condition prescribes a displacement other than zero, and "
    "there is no load; look at the displacements of the conditions"
)


class LoadStepper:
    """Load a ply, in steps that shrink where they fail and grow where they are easy.

    Each step tries its strategies one after the other.  The state that they
    find is judged: if it is folded, torn or not stable, it is refused.  A step that
    fails is halved.

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
        conditions: Conditions,
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
        callbacks = {"on_iteration": on_iteration, "on_step": on_step}
        check_arguments(
            ply, steps, max_halvings, strategies, warn_only, solver, callbacks
        )
        constraints = Constraints(ply.basis, conditions)
        self._conditions, self._solver_name = conditions, solver
        self.problem = Problem(ply, constraints, self._choose_solver)
        self.load_factors = np.linspace(0.0, 1.0, int(steps) + 1)[1:].tolist()
        for t in (0.0, *self.load_factors):
            constraints.fixed_values(t)  # refuses what is not valid
        chosen = [strategy_of(strategy) for strategy in strategies]
        self._follows = any(map(follows_path, chosen))
        # Loads that grow may jump to another equilibrium: there work must agree.
        self._loaded = self._follows and loads_grow(ply, self.load_factors)
        refusing = {"work"} if self._loaded else set()
        self._search = EquilibriumSearch(
            self.problem, chosen, frozenset(warn_only) - refusing, self._tell
        )
        self.max_halvings = max_halvings
        self.on_iteration, self.on_step = on_iteration, on_step
        self.checkpoint = (
            Checkpoint(checkpoint, ply, constraints, self._settings())
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
        self._forget()  # no interruption of a run meets one half set up
        try:
            self._begin(resume)
            self._reach_load_factors()
        except NoEquilibriumError as failure:
            raise StepError.after(failure, self.result) from None
        finally:
            self.problem.ply.remembered = self._held
            if warning := self._path.warning():
                log.warning(warning)
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
        clock, solver = self.problem.clock, self._solver.choice
        place = self.problem.ply, self._conditions, solver.name
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
            solver=solver,
            surfaces={
                name: condition
                for name, condition in self._conditions.items()
                if isinstance(condition, OnSurface)
            },
            estimate=partial(estimated_error, *place),
        )

    def _choose_solver(self, lower: csc_matrix) -> ChosenSolver:
        self._solver = ChosenSolver(self._solver_name, lower)
        return self._solver

    def _forget(self) -> None:
        """Forget the run before."""
        self.problem.clock, self._began = Clock(), perf_counter()
        self._steps_cut, self._states = 0, []
        self._held = self.problem.ply.remembered
        longest = self.load_factors[0]
        shortest = longest / 2.0**self.max_halvings
        self._length = StepLength(longest, shortest, next=longest)
        self._path = LoadPath(longest, self.max_halvings if self._follows else 0)
        self._warned: set[str] = set()

    def _begin(self, resume: bool) -> None:
        """Start from the ply at rest, or from where the checkpoint ends."""
        problem, checkpoint = self.problem, self.checkpoint
        problem.ply.reset()
        self._held = problem.ply.remembered
        replay = Replay(problem)
        if checkpoint and resume and (saved := checkpoint.load(replay)):
            self._go_on(saved, replay.last)
            return
        u = problem.ply.basis.zeros()
        with np.errstate(all="ignore"):  # what is not finite is caught
            f, (energies, potentials) = problem.residual(u), problem.energies(u)
            if not np.isfinite([*f, *energies.values(), *potentials.values()]).all():
                raise ValueError("a law has no finite energy or force at rest: mend it")
            if checkpoint:
                checkpoint.begin()
            if resume:
                log.warning("nothing to resume: the run starts from the undeformed ply")
            self._keep_rest(u, f, energies, potentials)

    def _keep_rest(
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
        tangent, unbalanced = tangent_at(problem, u), problem.unbalanced(f, u)
        tolerance = tangent.tolerance(u, f) if tangent else 0.0
        undeformed = Equilibrium(u, f, (unbalanced,), tolerance)
        trial = Trial(problem, undeformed, None, energies, potentials)
        trial.tangent = tangent
        state, values = self._state(0.0, trial), problem.constraints.fixed_values(0.0)
        balanced = unbalanced <= tolerance and problem.is_fixed(u, values)
        if balanced and not state.verdict.negative_pivots:
            self._keep(state, trial)
            if nothing_drives(problem, self.load_factors, tolerance):
                log.warning(_NOTHING_DRIVES)
        else:
            self._states = [state]  # until the ply is in balance
            found = self._search.at_rest(problem.start(u, tangent), values)
            state = self._state(0.0, found.trial)
            hard = found.altered > MOST_ALTERED or not found.followed_path
            if hard or not found.settled or self._depends_on_steps(state):
                self._path.mark(0.0)
            self._states = []
            self._keep(state, found.trial)

    def _go_on(self, saved: Saved, last: Trial) -> None:
        """Take up a run where its checkpoint ends."""
        progress, problem = saved.progress, last.problem
        self._held = problem.ply.remembered
        last.tangent = tangent_at(problem, last.equilibrium.u)
        self._start = last.next_start()
        self._states = saved.states
        self._length.next, self._steps_cut = progress.length, progress.steps_cut
        self._path = progress.path
        problem.clock = self.problem.clock = progress.clock  # with that tangent
        self._began -= progress.elapsed
        log.info("resumed at load factor %g", saved.states[-1].load_factor)

    def _reach_load_factors(self) -> None:
        """Reach the requested load factors one after the other."""
        for goal in self.load_factors:
            while (t := self._states[-1].load_factor) < goal:
                target = self._length.end(t, self._path.until(goal))
                try:
                    kept = self._advance(target)
                except NoEquilibriumError as failure:
                    kept = self._go_on_after(failure, target, goal)
                if not kept:
                    self._length.halve(target - t)
                    self._steps_cut += 1

    def _go_on_after(
        self, failure: NoEquilibriumError, target: float, goal: float
    ) -> bool:
        """Whether to go on at full length after a step that failed, or to halve it.

        Raises
        ------
        NoEquilibriumError
            If the run cannot go on, for the load passes a limit or steps fail however
            short they are.
        """
        last = self._states[-1]
        step = target - last.load_factor
        growth = load_growth(self.problem.ply, last, target) if self._loaded else 0.0
        if self._length.may_be_halved(step) or not is_known(growth, step):
            log.info("step to %g failed, halved: %s", target, failure)
            return False
        if growth:
            raise limit_error(failure, last.load_factor, target)
        if not self._path.stop_following(goal):
            raise failure
        log.info("step to %g failed, however short: %s", target, failure)
        self._length.restore()
        return True

    def _advance(self, t: float) -> bool:
        """Find a state at the load factor ``t``; whether it was kept."""
        try:
            values = self.problem.constraints.fixed_values(t)
            self.problem.ply.load(self._start.u, t)  # whose factor is a user's function
        except ValueError as error:
            raise StepError.after(error, self.result) from None
        start, step = self._start, t - self._states[-1].load_factor
        most_altered = self._path.most_altered(step, t, self._loaded)
        goal = Goal(t, step, values, start, start, most_altered)
        trial, altered, followed_path, is_settled, solves_again = self._search(goal)
        state = self._state(t, trial)
        if self._path.must_repeat(step, state, altered, followed_path):
            log.info("step to %g was hard, taken again as two", t)
            return False
        if not is_settled or self._depends_on_steps(state):
            self._path.mark(t)
        self._path.reached(state)
        self._length.after(state.linear_solves - solves_again)
        self._keep(state, trial)
        return True

    def _depends_on_steps(self, state: State) -> bool:
        """Whether energies depend on the number of steps, however short these are."""
        now, before = (s.energies | s.potentials for s in (state, self._states[-1]))
        return any(
            memory.depends_on == "steps" and now[name] != before[name]
            for name, memory in self.problem.ply.memories.items()
        )

    def _tell(self, iteration: Iteration) -> None:
        log.debug("%s", iteration)
        if self.on_iteration is not None:
            self.on_iteration(iteration)

    def _state(self, t: float, trial: Trial) -> State:
        before = sum(state.linear_solves for state in self._states)
        return trial.state(t, self.problem.clock.solves - before)

    def _keep(self, state: State, trial: Trial) -> None:
        """Add a state, and make it the start of the next step."""
        t = state.load_factor
        for check, warning in trial.warnings.items():
            first = check not in self._warned
            level = logging.WARNING if first else logging.INFO
            log.log(level, "load factor %g: %s", t, warning)
            self._warned.add(check)
        self._save(state)
        self._states.append(state)
        self._held = self.problem.ply.remembered
        log.info("load factor %g: %d linear solves", t, state.linear_solves)
        if self.on_step is not None and t > 0:
            self.on_step(state)
        self._start = trial.next_start()

    def _save(self, state: State) -> None:
        """Write a state to the checkpoint, if there is one."""
        if not self.checkpoint:
            return
        elapsed, clock = perf_counter() - self._began, self.problem.clock
        length = self._length.next
        progress = Progress(length, self._steps_cut, self._path, clock, elapsed)
        try:
            self.checkpoint.save(len(self._states), state, progress)
        except CheckpointError as error:
            if not self._states:
                raise
            raise StepError.after(error, self.result) from None

    def _settings(self) -> dict[str, Any]:
        """What the states depend on beyond the problem."""
        return {
            "steps": len(self.load_factors),
            "strategies": [repr(strategy) for strategy in self._search.strategies],
            "max_halvings": self.max_halvings,
            "warn_only": sorted(self._search.warn_only),
        }
