"""Incremental solution: a growing load, and a state at each step, which is judged."""

import logging
import os
from collections.abc import Callable, Collection
from functools import partial
from typing import Any

import numpy as np

from ..body import Body
from ..checkpoint import Checkpoint
from ..conditions import Conditions, Constraints
from ..error_estimate import estimated_error
from ..linear import ChosenSolver
from ..newton import Method
from ..problem import Problem
from ..result import Result
from ..states import Iteration, State
from ..stepping.arguments import check_arguments
from ..stepping.equilibrium_search import EquilibriumSearch, method_of
from ..stepping.limit import moves
from ..surface import OnSurface
from .record import Record
from .run import Run

log = logging.getLogger(__name__)

#: Checks that only warn by default.
DEFAULT_WARN_ONLY = "work", "stabilisation", "deviation", "corners", "surface"


class LoadStepper:
    """Load a ply, in steps that shrink where they fail and grow where they are easy.

    A converged state is checked: if it is folded, torn or not stable, it is refused.  A
    step that fails is halved.

    Parameters
    ----------
    ply
        The ply to load.
    conditions
        Displacement conditions by name.
    steps
        Number of equal steps to the load factor 1.  The run has a state at the end of
        each, and in between where a step had to be halved.
    method
        Nonlinear solver: `Newton`, `PlainNewton` or the name of one, ``newton`` or
        ``plain``.
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
        from 1 to a million, ``max_halvings`` none from 0 to 30, a method or check
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
        method: str | Method = "newton",
        max_halvings: int = 8,
        warn_only: Collection[str] = DEFAULT_WARN_ONLY,
        on_iteration: Callable[[Iteration], None] | None = None,
        on_step: Callable[[State], None] | None = None,
        checkpoint: str | os.PathLike[str] | None = None,
        solver: str = "auto",
    ) -> None:
        callbacks = {"on_iteration": on_iteration, "on_step": on_step}
        check_arguments(ply, steps, max_halvings, warn_only, solver, callbacks)
        constraints = Constraints(ply.basis, conditions)
        self._conditions = conditions
        self.problem = Problem(ply, constraints, partial(ChosenSolver, solver))
        self.load_factors = np.linspace(0.0, 1.0, int(steps) + 1)[1:].tolist()
        moved = moves(self.problem, (0.0, *self.load_factors))
        self._search = EquilibriumSearch(
            self.problem, method_of(method), frozenset(warn_only), self._tell, moved
        )
        self.max_halvings = max_halvings
        self.on_iteration, self.on_step = on_iteration, on_step
        self.checkpoint = (
            Checkpoint(checkpoint, ply, constraints, self._settings())
            if checkpoint
            else None
        )
        self._run = self._new_run()

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
        self._run = self._new_run()
        return self._run(resume)

    @property
    def states(self) -> tuple[State, ...]:
        """The states so far; none before a run."""
        return tuple(self._run.record.states)

    @property
    def result(self) -> Result:
        """What the run has found so far; after an interruption, all of it."""
        return self._run.result

    def _new_run(self) -> Run:
        surfaces = {
            name: condition
            for name, condition in self._conditions.items()
            if isinstance(condition, OnSurface)
        }
        estimate = partial(estimated_error, self.problem.ply, self._conditions)
        record = Record(self.problem, surfaces, estimate, self.checkpoint)
        arguments = self.load_factors, self.max_halvings, record, self._reached
        return Run(self._search, *arguments)

    def _tell(self, iteration: Iteration) -> None:
        log.debug("%s", iteration)
        if self.on_iteration is not None:
            self.on_iteration(iteration)

    def _reached(self, state: State) -> None:
        if self.on_step is not None and state.load_factor > 0:
            self.on_step(state)

    def _settings(self) -> dict[str, Any]:
        """What the states depend on beyond the problem."""
        return {
            "steps": len(self.load_factors),
            "method": repr(self._search.method),
            "max_halvings": self.max_halvings,
            "warn_only": sorted(self._search.warn_only),
        }
