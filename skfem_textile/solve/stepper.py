"""Load stepper: incremental loading with a checked state after each step."""

import logging
import os
from bisect import bisect_right
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from datetime import timedelta
from functools import cached_property, partial
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy import ndarray

from ..mesh.progress import clear, shown
from ..mesh.user_input import real_numbers, refuse_unknown, shortened
from ..ply import Ply
from ..ply.amount import ends_of_parts
from .conditions import Conditions, Constraints, constraints_after, travels
from .continuation import (
    MOST_PROJECTED,
    Continuation,
    balanced_at_rest,
    initial_guess,
    load_growth,
    load_steps,
    loads_drive,
    moves,
    path_warning,
    refuse_unless_whole,
)
from .linear import solver_named
from .linear.solver import Clock, SolverOfPattern
from .newton import Method
from .problem import Problem, tangent_at
from .result import UNCHANGING, Result, StepError
from .search import EquilibriumSearch, Target, method_of
from .states import (
    CheckpointError,
    Equilibrium,
    Iteration,
    NoEquilibriumError,
    State,
    UserError,
)
from .verdict import CHECKS, Trial

if TYPE_CHECKING:
    from .checkpoint import Checkpoint, Replay, RestoredRun
    from .interval import ErrorInterval

log = logging.getLogger(__name__)

#: Checks that only warn by default.
DEFAULT_WARN_ONLY = (
    *("work", "stabilisation", "deviation", "corners", "surface", "slack"),
)

# Maximum number of halvings: a load factor near 1 has 53 binary digits, of which 20 are
# for the steps.
_MOST_HALVINGS = 30

# Change of the shear angle in radians, in a step in which loads drive the ply, above
# which the step may have passed a limit load: fabrics reach 1.2 in all their steps.
_JUMP = 1.0


class LoadStepper:
    """Load a ply incrementally, with adaptive step lengths.

    Each converged state is checked: a state with folded elements, excessive fibre
    strain or an unstable tangent is refused.  A step that fails is halved.

    Parameters
    ----------
    ply
        The ply.
    conditions
        Displacement conditions by name.
    steps
        Number of equal steps to the load factor 1; or a sequence of the numbers of
        equal steps of successive parts, which have equal lengths in the load factor.
        The run has a state at the end of each step, and additional ones where a step
        was halved.
    method
        Nonlinear solver: `Newton`, `PlainNewton` or the name of one, ``newton`` or
        ``plain``.
    max_halvings
        Maximum number of halvings of a step before the run stops.
    warn_only
        Checks of `CHECKS` that warn instead of refusing a state.
    on_iteration, on_step
        Callbacks for each `Iteration` and each converged `State`.
    checkpoint
        Folder to which every converged state is written.
    initial_guess
        Displacement near the equilibrium at the load factor 1, DOF vector.  The run
        then has one state after the undeformed ply: this equilibrium, without load
        steps.  If it is not found, the load is applied in steps.
    solver
        Linear solver: ``rslab``, ``cholmod`` (needs cvxopt), ``pardiso`` (needs
        pypardiso), ``superlu``, ``petsc`` (needs petsc4py), or ``auto`` for the fastest
        installed one, which is measured once per process for large systems.

    Raises
    ------
    ValueError
        If a condition is not valid at some load factor, tools leave no room for the ply
        or never touch it (see `check_tools`), a `Process` has other tools than the ply,
        ``steps`` are not whole numbers from 1 to a million, ``max_halvings`` not one
        from 0 to 30, a method or check is unknown, the solver is unknown or not
        installed, or an argument has the wrong type.

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

    @shown("resolving the conditions")
    def __init__(
        self,
        ply: Ply,
        conditions: Conditions,
        steps: int | Sequence[int] = 20,
        *,
        method: str | Method = "newton",
        max_halvings: int = 8,
        warn_only: Collection[str] = DEFAULT_WARN_ONLY,
        on_iteration: Callable[[Iteration], None] | None = None,
        on_step: Callable[[State], None] | None = None,
        checkpoint: str | os.PathLike[str] | None = None,
        initial_guess: ndarray | None = None,
        solver: str = "auto",
    ) -> None:
        callbacks = {"on_iteration": on_iteration, "on_step": on_step}
        _check_arguments(ply, max_halvings, warn_only, callbacks)
        self.steps = load_steps(steps)
        if check_ply := getattr(steps, "check_ply", None):  # of a process
            check_ply(ply)
        self.load_factors = self.steps.ends()[1:]
        chosen = solver_named(solver)
        self.ply = ply
        self.problem = problem = self._resolved(conditions, chosen)
        self.initial_guess = _checked_guess(initial_guess, problem)
        self._check_moves()
        self.search = EquilibriumSearch(
            problem, method_of(method), frozenset(warn_only), self._report
        )
        self.max_halvings = max_halvings
        self.on_iteration, self.on_step = on_iteration, on_step
        # Settings, besides the problem, on which the states depend.
        self.settings = {
            "method": repr(self.search.method),
            "max_halvings": max_halvings,
            "warn_only": sorted(warn_only),
            "initial_guess": initial_guess is not None,
        }
        self.checkpoint = self._checkpoint(checkpoint) if checkpoint else None
        self.interval = partial(_interval, self.problem, conditions)
        self._run = Run(self)

    def _resolved(self, conditions: Conditions, solver: SolverOfPattern) -> Problem:
        """The problem, whose amounts the steps do not miss."""
        ply, constraints = self.ply, Constraints(self.ply.basis, conditions)
        of_terms = (amount for term in ply.terms for amount in term.amounts)
        for amount in (*constraints.amounts, *of_terms):
            amount.check_steps(self.load_factors)
        ends = *(conditions, self.load_factors), constraints.nodes
        return Problem(ply, constraints, solver, constraints_after(ply.basis, *ends))

    def _checkpoint(self, folder: str | os.PathLike[str]) -> "Checkpoint":
        from .checkpoint import Checkpoint

        return Checkpoint(folder, self.problem, self.steps, self.settings)

    def _check_moves(self) -> None:
        """Find out what moves, and check the tools."""
        problem = self.problem
        moved, contacts = moves(problem, (0.0, *self.load_factors)), problem.contacts
        problem.moves = bool(moved or contacts)
        for check in dict.fromkeys(type(tool).check for tool in contacts):
            check(self.ply, moved)

    def run(
        self,
        resume: bool = False,
        *,
        states_of: str | os.PathLike[str] | None = None,
        until: float = 0.0,
    ) -> Result:
        """Apply the whole load.

        Parameters
        ----------
        resume
            Continue from the last state in the checkpoint, if there is one.
        states_of
            Checkpoint of another run, which may differ beyond the load factor
            ``until``: this run takes its states up to there.  It is not changed.
        until
            Load factor between two parts of the ``steps``, or 0.

        Raises
        ------
        StepError
            If a step fails after the maximum number of halvings, a condition has no
            valid value at some load factor, or a checkpoint cannot be written.
        CheckpointError
            If the checkpoint is damaged or belongs to another run.
        ValueError
            If there is no checkpoint to resume from, a run is resumed and repeated, no
            part of the steps ends at ``until``, or a law is not finite at rest.
        UserError
            If a user's function raises any exception except ValueError before the first
            state.
        """
        if resume and not self.checkpoint:
            raise ValueError(
                "there is no checkpoint to resume from: specify its folder as "
                "checkpoint"
            )
        begun = None if states_of is None else self._begun(states_of, resume, until)
        self._run = Run(self)
        with shown(self._run.progress):
            return self._run(resume, begun)

    def _begun(
        self, folder: Any, resume: bool, until: float
    ) -> "tuple[Checkpoint, float]":
        """Checkpoint of a run that is repeated from a load factor on."""
        if resume:
            raise ValueError("a run is either resumed or repeated: omit one of them")
        parts = ends_of_parts(len(self.steps.numbers))[:-1]
        if until not in parts:
            raise ValueError(
                f"until must be a load factor at which a part of the steps begins, "
                f"{', '.join(f'{t:.6g}' for t in parts)}, got {shortened(until)}"
            )
        other, ours = self._checkpoint(folder), self.checkpoint
        if ours and ours.folder.resolve() == other.folder.resolve():
            raise ValueError(
                f"the checkpoint {ours.folder} would replace the run that is repeated: "
                "choose another folder"
            )
        return other, until

    @property
    def states(self) -> tuple[State, ...]:
        """States so far; none before a run."""
        return tuple(self._run.states)

    @property
    def result(self) -> Result:
        """Result so far; after an interruption it contains every previous state.

        Raises
        ------
        RuntimeError
            If there is no state yet.
        """
        return self._run.result

    def _report(self, iteration: Iteration) -> None:
        self._run.iteration = iteration
        log.debug("%s", iteration)
        if self.on_iteration is not None:
            clear()
            self.on_iteration(iteration)


class Run:
    """One run of a load stepper, from rest or from the end of its checkpoint.

    Holds the converged ``states`` so far and, in ``continuation``, the step length and
    the load path.
    """

    def __init__(self, stepper: LoadStepper) -> None:
        self._stepper, self._search = stepper, stepper.search
        self._use(stepper.problem)
        self.problem.clock, self._began = Clock(), perf_counter()
        longest, follows = stepper.steps.length(0.0), stepper.search.method.follows_path
        halvings = stepper.max_halvings
        self.continuation = Continuation(longest, halvings, follows, next=longest)
        self.states: list[State] = []
        self.iteration: Iteration | None = None
        self._loaded_from = 0.0, self._began  # load factor and time
        self._warned: set[str] = set()

    def _use(self, problem: Problem) -> None:
        """Continue with a problem."""
        self.problem, self._search = problem, replace(self._search, problem=problem)

    def __call__(self, resume: bool = False, begun: Any = None) -> Result:
        """Apply the whole load; see `LoadStepper.run`."""
        checkpoint, problem = self._stepper.checkpoint, self.problem
        try:
            if not (resume and self._resume()) and not (begun and self._repeat(*begun)):
                with np.errstate(all="ignore"):  # non-finite values are detected
                    self._start_at_rest(nothing_to_resume=resume)
            self._loaded_from = self.states[-1].load_factor, perf_counter()
            if self._stepper.initial_guess is not None and len(self.states) == 1:
                try:
                    self._reach(self._stepper.initial_guess)
                except NoEquilibriumError as failure:
                    log.info("no equilibrium near the initial guess: %s", failure)
            for t_end in self._stepper.load_factors:
                while self._frees or self.states[-1].load_factor < t_end:
                    self._free() if self._frees else self._step(t_end)
        except NoEquilibriumError as failure:
            if not self.states:
                raise
            raise self._stopped(failure) from None
        except (StepError, CheckpointError, MemoryError):
            raise
        except Exception as error:  # a user's function may raise anything
            if self.states:
                raise self._stopped(UserError(error)) from error
            if isinstance(error, ValueError):
                raise
            raise UserError(error) from error
        finally:
            if self.continuation.unresolved:
                log.warning(path_warning(self.continuation.unresolved))
            if self.states:
                for warning in problem.ply.contradictions(self.states):
                    log.warning(warning)
            if checkpoint:
                checkpoint.unlock()
        return self.result

    @property
    def result(self) -> Result:
        """Result so far; see `LoadStepper.result`."""
        if not self.states:
            raise RuntimeError("the load stepper has not been run: call run()")
        stepper, clock = self._stepper, self.problem.clock
        surfaces = self.problem.surfaces
        chosen: Any = self.problem.system.solver
        return Result(
            ply=self.problem.ply,
            states=list(self.states),
            converged=self.states[-1].load_factor == 1.0 and not self._lets_go,
            linear_solves=clock.solves,
            factorisations=clock.factorisations,
            steps_cut=self.continuation.cut,
            unresolved=tuple(self.continuation.unresolved),
            unchanging=self._unchanging,
            wall_time_s=perf_counter() - self._began,
            assembly_time_s=clock.seconds["assembly"],
            solve_time_s=clock.seconds["solve"],
            solver=chosen.choice,
            surfaces=surfaces.conditions if surfaces else {},
            interval=partial(stepper.interval, chosen.choice.name),
        )

    @cached_property
    def _unchanging(self) -> bool:
        """True if nothing changes with the load factor."""
        problem, first = self.problem, self.states[0]
        if problem.moves or first.u.any():
            return False
        return balanced_at_rest(problem, self._stepper.load_factors, first.tolerance)

    def _stopped(self, error: Exception) -> StepError:
        """The error that ends the run."""
        state, problem = self.states[-1], self.problem
        far = travels(problem.constraints, problem.nodal(state.u))
        far |= {tool.name: state.displacements[tool.name] for tool in problem.tools}
        return StepError.after(error, self.result, far)

    def progress(self) -> str:
        """One line on the last state, the iteration, and the remaining steps."""
        unknowns, at = f"{self.problem.ply.basis.N} unknowns", self.iteration
        if at is None:
            return f"analysing {unknowns}"
        states, factors = self.states, self._stepper.load_factors
        t, travel = 0.0, 0.0
        if states:
            t, means = states[-1].load_factor, states[-1].displacements.values()
            travel = max(float(np.linalg.norm(mean)) for mean in means)
        steps = len(factors) - bisect_right(factors, t)
        left = f"{steps} step{'s' * (steps != 1)}"
        start, began = self._loaded_from
        if t > start:
            seconds = (perf_counter() - began) * (1 - t) / (t - start)
            left = f"{timedelta(seconds=round(seconds))}"
        ongoing = at.load_factor > t
        now = f"iteration {at.number} to {at.load_factor:.4g}, " if ongoing else ""
        at_end = f"load factor {t:.4g} (moved by {travel:.4g} mm)"
        return f"{at_end}, {now}{left} left, {unknowns}"

    def _resume(self) -> bool:
        """Start from the end of the checkpoint; False if it contains no state."""
        problem, checkpoint = self.problem, self._stepper.checkpoint
        assert checkpoint  # `LoadStepper.run` requires it
        from .checkpoint import Replay

        replay = Replay(problem, self._stepper.initial_guess is not None)
        if not (saved := checkpoint.load(replay)):
            return False
        self._continue(saved, replay)
        log.info("resumed at load factor %g", self.states[-1].load_factor)
        return True

    def _repeat(self, other: "Checkpoint", until: float) -> bool:
        """Start from the states of another run up to a load factor; True."""
        from .checkpoint import Replay

        replay = Replay(self.problem)
        begun, checkpoint = other.begun(replay, until), self._stepper.checkpoint
        if checkpoint:
            checkpoint.begin()
            saved = zip(begun.states, begun.progress, strict=True)
            for number, (state, progress) in enumerate(saved):
                checkpoint.save(number, state, *progress)
        self._continue(begun, replay)
        log.info("states up to load factor %g are taken from %s", until, other.folder)
        return True

    def _continue(self, saved: "RestoredRun", replay: "Replay") -> None:
        """Continue after the last state of a checkpoint."""
        progress, last = saved.progress[-1], replay.last
        self._use(replay.problem)
        self.states, self.continuation = saved.states, progress.continuation
        last.tangent = tangent_at(last.problem, last.u, last.parameters)
        # The checkpoint already includes the time of that tangent.
        self.problem.clock = last.problem.clock = progress.clock
        self._start = last.next_start()
        self._began -= progress.elapsed

    def _start_at_rest(self, nothing_to_resume: bool) -> None:
        """Start from the ply at rest, in equilibrium and with the conditions applied.

        A ply at rest may have singular modes, but no negative ones.
        """
        problem, checkpoint = self.problem, self._stepper.checkpoint
        ply = problem.ply
        u, p = ply.basis.zeros(), ply.parameters_at_rest
        f, (energies, potentials) = problem.residual(u, p), problem.energies(u, p)
        if not np.isfinite([*f, *energies.values(), *potentials.values()]).all():
            raise ValueError(
                "the energy or force of a law is not finite at rest: the law must be "
                "defined at 0 and around it (for a table from 0: odd=True; in a case "
                "file, continuation = 'odd')"
            )
        if checkpoint:
            checkpoint.begin()
        if nothing_to_resume:
            log.warning(
                "there is no state to resume from: the run starts from the undeformed "
                "ply"
            )
        tangent, unbalanced = tangent_at(problem, u, p), problem.unbalanced(f, u)
        tolerance = tangent.tolerance(u, f, p) if tangent else 0.0
        undeformed = Equilibrium(u, f, p, (unbalanced,), tolerance, 0, tangent)
        trial = Trial.of(problem, undeformed, None)
        state, values = trial.state(0), problem.constraints.fixed_values(0.0)
        balanced = unbalanced <= tolerance and problem.is_fixed(u, values)
        if balanced and not state.verdict.negative_pivots:
            self._append(state, trial)
            if self._unchanging:
                log.warning(UNCHANGING)
            return
        self.states = [state]  # until the ply is in equilibrium
        found = self._search.at_rest(problem.evaluation(u, p, tangent), values)
        state, settled = self._reached(found)
        easy = found.projected <= MOST_PROJECTED and self._search.method.follows_path
        if not (easy and settled):
            self.continuation.mark(0.0)
        self.states = []
        self._append(state, found)

    def _reach(self, u: ndarray) -> None:
        """Find the equilibrium at the load factor 1 near a displacement."""
        problem = self.problem.at(1.0)
        values = problem.constraints.fixed_values(1.0)
        with np.errstate(all="ignore"):  # non-finite values are detected
            guess = problem.evaluation(u, problem.ply.parameters_at_rest)
            if not problem.in_domain(u, guess.parameters):
                raise problem.beyond(
                    *(u, "the initial guess is outside the domain of a law"),
                    "a law with a larger domain",
                )
        found = self._search(Target(1.0, 1.0, values, guess, None))
        state, settled = self._reached(found)
        if not settled:
            self.continuation.mark(1.0)
        self._append(state, found)

    def _step(self, t_end: float) -> None:
        """Take a step towards a requested load factor, or prepare a shorter one."""
        last, start, problem = self.states[-1], self._start, self.problem
        if overloads := self.continuation.overloads:
            from .clamp_release import estimated_release

            t_end = min(t_end, estimated_release(problem, self.states, overloads))
        self.continuation.enter(self._stepper.steps.length(t_end))
        t = self.continuation.end(last.load_factor, t_end)
        step = t - last.load_factor
        driven = self._search.method.follows_path and loads_drive(
            problem.at(start.load_factor), start.u, start.parameters, start.energies
        )
        try:
            values = problem.at(t).constraints.fixed_values(t)
            # The factors of loads are user functions.
            problem.at(t).load(start.u, start.parameters)
        except ValueError as error:
            raise self._stopped(error) from None
        most_projected = self.continuation.most_projected(step, t, driven)
        guess = initial_guess(problem.at(t), start, self.states)
        try:
            found = self._search(Target(t, step, values, guess, start, most_projected))
        except NoEquilibriumError as failure:
            # A growing surface has no limit load.
            loaded = driven and not problem.surfaces
            growth = load_growth(problem, last, t) if loaded else 0.0
            self.continuation.failed(failure, last.load_factor, t, t_end, growth)
            return
        state, settled = self._reached(found)
        projected = found.projected
        if driven and self._jumps(state):
            projected = MOST_PROJECTED + 1
        if problem.contacts:  # more steps do not resolve a path
            settled, projected = settled and not projected, 0
        halved = found.crosses_outline and self.continuation.halves(step)
        if not halved and self.continuation.accepts(step, state, projected, settled):
            self._append(state, found)
        else:
            log.info("the step to load factor %g was difficult and is halved", t)

    @property
    def _lets_go(self) -> list[str]:
        """Names of the clamps that let go at the last state."""
        return self.problem.let_go(self.states[-1].parameters, self._start.parameters)

    @property
    def _frees(self) -> bool:
        """True if clamps let go, or conditions end, at the last state."""
        ends = self.states[-1].load_factor in self.problem.endings
        return ends or bool(self._lets_go)

    def _free(self) -> None:
        """Find the equilibrium without the clamps that let go at the last state.

        Or, if there are none, without the conditions that end there.
        """
        last, start, t = self.states[-1], self._start, self.states[-1].load_factor
        what, longest = "conditions end", 1.0
        if clamps := self._lets_go:
            from . import clamp_release

            what = clamp_release.message(clamps, start.parameters)
        else:
            longest = 1.0 / self._stepper.steps.number(t)
            self._use(self.problem.ended(t))
            arguments = self.problem.at(t), start.u, start.parameters
            start = replace(start, tangent=tangent_at(*arguments))
        problem = self.problem
        log.info("load factor %g: %s", t, what)
        try:
            found = self._search.freed(start, longest)
        except NoEquilibriumError as failure:
            failure.args = (f"{what}, and then there is {failure}",)
            raise
        parameters = found.parameters
        if clamps:
            parameters = clamp_release.with_energy_lost(found, start, last)
        found = found.after(start, parameters)
        state, settled = self._reached(found)
        if not settled or found.projected > (0 if problem.contacts else MOST_PROJECTED):
            self.continuation.mark(t)
        self.continuation.overloads.clear()
        self._append(state, found)

    def _reached(self, found: Trial) -> tuple[State, bool]:
        """The state, and whether it is independent of the number of steps."""
        before = sum(state.linear_solves for state in self.states)
        state = found.state(self.problem.clock.solves - before)
        misses = found.misses_sliding or found.crosses_outline
        depends = misses or self._depends_on_steps(state)
        return state, found.converged and not depends

    def _jumps(self, state: State) -> bool:
        """True if the shear angle changes so much that a step may pass a limit load."""
        ply = self.problem.ply
        change = ply.shear_angle(state.u) - ply.shear_angle(self.states[-1].u)
        return bool(np.abs(change).max() > _JUMP)

    def _depends_on_steps(self, state: State) -> bool:
        """True if energies depend on the number of steps, however short these are."""
        energies, before = (s.energies | s.potentials for s in (state, self.states[-1]))
        return any(
            term.parameters is not None
            and term.parameters.depends_on_steps
            and energies[term.name] != before[term.name]
            for term in self.problem.ply.terms
        )

    def _append(self, state: State, trial: Trial) -> None:
        """Add a state, write it to a checkpoint, and start the next step from it."""
        t, stepper = state.load_factor, self._stepper
        clear()
        for check, warning in trial.warnings.items():
            level = logging.INFO if check in self._warned else logging.WARNING
            log.log(level, "load factor %g: %s", t, warning)
            self._warned.add(check)
        if stepper.checkpoint:
            try:
                elapsed = perf_counter() - self._began
                progress = self.continuation, self.problem.clock, elapsed
                stepper.checkpoint.save(len(self.states), state, *progress)
            except CheckpointError as error:
                if not self.states:
                    raise
                raise self._stopped(error) from None
        self.states.append(state)
        self._start = trial.next_start()
        log.info("load factor %g: %d linear solves", t, state.linear_solves)
        if stepper.on_step is not None and t > 0:
            stepper.on_step(state)


def _interval(
    problem: Problem, conditions: Conditions, solver: str, state: State
) -> "ErrorInterval":
    """See `error_interval`."""
    from .interval import error_interval

    return error_interval(problem, conditions, solver, state)


def _check_arguments(
    ply: Any,
    max_halvings: Any,
    warn_only: Any,
    callbacks: Mapping[str, Callable | None],
) -> None:
    """Refuse invalid arguments of `LoadStepper`."""
    if isinstance(ply, type) or not hasattr(ply, "stiffness"):
        raise ValueError(f"ply must be a Ply, not {type(ply).__name__}")
    refuse_unless_whole("max_halvings", max_halvings, 0, _MOST_HALVINGS)
    # A bare string is also a collection, of its letters.
    if isinstance(warn_only, str) or not isinstance(warn_only, Collection):
        raise ValueError(
            f"warn_only must be a list of checks ({', '.join(CHECKS)}), got "
            f"{shortened(warn_only)}"
        )
    for name in warn_only:
        refuse_unknown("check", name, CHECKS)
    for name, function in callbacks.items():
        if function is not None and not callable(function):
            raise ValueError(f"{name} must be a function, not {function!r}")


def _checked_guess(guess: Any, problem: Problem) -> ndarray | None:
    """Validated initial guess of a problem, if there is one."""
    if guess is None:
        return None
    if problem.endings:
        raise ValueError("initial_guess does not apply to conditions that end: omit it")
    if problem.rubbing:
        raise ValueError("initial_guess: friction of tools requires steps: omit it")
    u, n = real_numbers("initial_guess", guess), problem.ply.basis.N
    if u.shape != (n,) or not np.isfinite(u).all():
        raise ValueError(
            f"initial_guess must be {n} finite numbers, one for each unknown "
            f"of the ply, got an array of shape {u.shape}"
        )
    return u
