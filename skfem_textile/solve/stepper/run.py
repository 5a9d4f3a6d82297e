"""A run of a load stepper: from rest, or where a checkpoint ends, to the whole load."""

import logging
from collections.abc import Callable, Mapping, Sequence
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np
from numpy import ndarray

from ..checkpoint import CheckpointError, Progress, Replay, Saved
from ..linear.solver import Clock
from ..problem import Goal, tangent_at
from ..result import Result, StepError
from ..states import Equilibrium, NoEquilibriumError, State, UserError
from ..stepping.growth import grown
from ..stepping.limit import balanced_at_rest, is_known, limit_error, load_growth
from ..stepping.load_path import MOST_ALTERED, LoadPath
from ..stepping.step_length import StepLength
from ..verdict import Trial

if TYPE_CHECKING:
    from ..stepping.equilibrium_search import EquilibriumSearch
    from .record import Record

log = logging.getLogger(__name__)

_NOTHING_DRIVES = (
    "nothing will move: no condition prescribes a displacement other than zero, and "
    "there is no load; look at the displacements of the conditions"
)


class Run:
    """A run of a load stepper, called once.

    Parameters
    ----------
    search
        Finds the state at a load factor.
    load_factors
        Load factors to reach.
    max_halvings
        How often a step may be halved.
    record
        Where its states go.
    reached
        Called with each state.
    """

    def __init__(
        self,
        search: "EquilibriumSearch",
        load_factors: Sequence[float],
        max_halvings: int,
        record: "Record",
        reached: Callable[[State], None],
    ) -> None:
        self._search, self.problem, self.record = search, search.problem, record
        self._load_factors, self._reached = load_factors, reached
        self.problem.clock, self._began = Clock(), perf_counter()
        self._steps_cut = 0
        longest = load_factors[0]
        shortest = longest / 2.0**max_halvings
        self._length = StepLength(longest, shortest, next=longest)
        follows = search.method.follows_path
        self._path = LoadPath(longest, max_halvings if follows else 0)

    def __call__(self, resume: bool) -> Result:
        """Apply the whole load; see `LoadStepper.run`."""
        try:
            self._begin(resume)
            self._reach_load_factors()
        except NoEquilibriumError as failure:
            raise StepError.after(failure, self.result) from None
        except (StepError, CheckpointError, MemoryError):
            raise
        except Exception as error:  # a user's function may raise anything
            if not self.record.states:
                raise
            raise StepError.after(UserError(error), self.result) from error
        finally:
            if warning := self._path.warning():
                log.warning(warning)
            if self.record.checkpoint:
                self.record.checkpoint.release()
        return self.result

    @property
    def result(self) -> Result:
        """What it has found so far."""
        return self.record.result(self._progress)

    @property
    def _progress(self) -> Progress:
        """Where it is."""
        elapsed, clock = perf_counter() - self._began, self.problem.clock
        return Progress(self._length.next, self._steps_cut, self._path, clock, elapsed)

    def _begin(self, resume: bool) -> None:
        """Start from the ply at rest, or from where the checkpoint ends."""
        problem, checkpoint = self.problem, self.record.checkpoint
        replay = Replay(problem)
        if checkpoint and resume and (saved := checkpoint.load(replay)):
            self._go_on(saved, replay.last)
            return
        u, p = problem.ply.basis.zeros(), problem.ply.parameters_at_rest
        with np.errstate(all="ignore"):  # what is not finite is caught
            f, (energies, potentials) = problem.residual(u, p), problem.energies(u, p)
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
        p = problem.ply.parameters_at_rest
        tangent, unbalanced = tangent_at(problem, u, p), problem.unbalanced(f, u)
        tolerance = tangent.tolerance(u, f) if tangent else 0.0
        undeformed = Equilibrium(u, f, p, (unbalanced,), tolerance, 0, tangent)
        trial = Trial(problem, undeformed, None, energies, potentials)
        state, values = self._state(0.0, trial), problem.constraints.fixed_values(0.0)
        balanced = unbalanced <= tolerance and problem.is_fixed(u, values)
        if balanced and not state.verdict.negative_pivots:
            self._keep(state, trial)
            rest = self._load_factors, tolerance
            if not self._search.moved and balanced_at_rest(problem, *rest):
                log.warning(_NOTHING_DRIVES)
        else:
            self.record.states = [state]  # until the ply is in balance
            found = self._search.at_rest(problem.start(u, p, tangent), values)
            state = self._state(0.0, found.trial)
            hard = found.altered > MOST_ALTERED or not found.followed_path
            if hard or not found.settled or self._depends_on_steps(state):
                self._path.mark(0.0)
            self.record.states = []
            self._keep(state, found.trial)

    def _go_on(self, saved: Saved, last: Trial) -> None:
        """Take up a run where its checkpoint ends."""
        progress, problem = saved.progress, last.problem
        end = last.equilibrium
        tangent = tangent_at(problem, end.u, end.parameters)
        last.equilibrium = end._replace(tangent=tangent)
        self._start = last.next_start()
        self.record.states = saved.states
        self._length.next, self._steps_cut = progress.length, progress.steps_cut
        self._path = progress.path
        problem.clock = self.problem.clock = progress.clock  # with that tangent
        self._began -= progress.elapsed
        log.info("resumed at load factor %g", saved.states[-1].load_factor)

    def _reach_load_factors(self) -> None:
        """Reach the requested load factors one after the other."""
        for goal in self._load_factors:
            while (t := self.record.states[-1].load_factor) < goal:
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
        last = self.record.states[-1]
        step = target - last.load_factor
        loaded = self._search.loads_drive(self._start)
        growth = load_growth(self.problem.ply, last, target) if loaded else 0.0
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
            self.problem.at(t).load(
                self._start.u, self._start.parameters
            )  # whose factor is a user's function
        except ValueError as error:
            raise StepError.after(error, self.result) from None
        last, step = self._start, t - self.record.states[-1].load_factor
        loaded = self._search.loads_drive(last)
        most_altered = self._path.most_altered(step, t, loaded)
        start = grown(self.problem.at(t), last)
        goal = Goal(t, step, values, start, last, most_altered)
        trial, altered, followed_path, is_settled = self._search(goal)
        state = self._state(t, trial)
        if self._path.must_repeat(step, state, altered, followed_path):
            log.info("step to %g was hard, taken again as two", t)
            return False
        if not is_settled or self._depends_on_steps(state):
            self._path.mark(t)
        self._path.reached(state)
        self._length.after(altered)
        self._keep(state, trial)
        return True

    def _depends_on_steps(self, state: State) -> bool:
        """Whether energies depend on the number of steps, however short these are."""
        now, before = (
            s.energies | s.potentials for s in (state, self.record.states[-1])
        )
        return any(
            term.parameters is not None
            and term.parameters.depends_on_steps
            and now[term.name] != before[term.name]
            for term in self.problem.ply.terms
        )

    def _state(self, t: float, trial: Trial) -> State:
        before = sum(state.linear_solves for state in self.record.states)
        return trial.state(t, self.problem.clock.solves - before)

    def _keep(self, state: State, trial: Trial) -> None:
        """Add a state, and make it the start of the next step."""
        self.record.add(state, trial.warnings, self._progress)
        log.info(
            "load factor %g: %d linear solves", state.load_factor, state.linear_solves
        )
        self._reached(state)
        self._start = trial.next_start()
