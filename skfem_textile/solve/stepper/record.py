"""The states of a run: told of, saved, and handed on as a result."""

import logging
from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

from ..checkpoint import Checkpoint, CheckpointError, Progress
from ..result import Result, StepError
from ..states import ErrorEstimate, State

if TYPE_CHECKING:
    from ..problem import Problem

log = logging.getLogger(__name__)


class Record:
    """The states of a run so far.

    Parameters
    ----------
    problem
        The problem.
    surfaces
        Conditions that keep nodes on surfaces, by name.
    estimate
        Estimated error of a state, after the name of the linear solver.
    checkpoint
        To which every state is written, if there is one.

    Attributes
    ----------
    states
        The states.
    """

    def __init__(
        self,
        problem: "Problem",
        surfaces: Mapping[str, Any],
        estimate: Callable[[str, State], ErrorEstimate],
        checkpoint: Checkpoint | None,
    ) -> None:
        self._problem, self._surfaces, self._estimate = problem, surfaces, estimate
        self.checkpoint = checkpoint
        self.states: list[State] = []
        self._warned: set[str] = set()

    def add(
        self, state: State, warnings: Mapping[str, str], progress: Progress
    ) -> None:
        """Add a state, once it is written to the checkpoint.

        Parameters
        ----------
        state
            The state.
        warnings
            What checks say of it, by their names.
        progress
            Where the run is.

        Raises
        ------
        StepError
            If the checkpoint cannot be written.
        """
        t = state.load_factor
        for check, warning in warnings.items():
            first = check not in self._warned
            level = logging.WARNING if first else logging.INFO
            log.log(level, "load factor %g: %s", t, warning)
            self._warned.add(check)
        if self.checkpoint:
            try:
                self.checkpoint.save(len(self.states), state, progress)
            except CheckpointError as error:
                if not self.states:
                    raise
                raise StepError.after(error, self.result(progress)) from None
        self.states.append(state)

    def result(self, progress: Progress) -> Result:
        """What has been found where the run is.

        Raises
        ------
        RuntimeError
            If there is no state yet.
        """
        if not self.states:
            raise RuntimeError("the load stepper has not been run")
        ply, clock = self._problem.ply, progress.clock
        chosen: Any = self._problem.system.solver
        return Result(
            ply=ply,
            states=list(self.states),
            converged=self.states[-1].load_factor == 1.0,
            linear_solves=clock.solves,
            factorisations=clock.factorisations,
            steps_cut=progress.steps_cut,
            unresolved=tuple(progress.path.unresolved),
            wall_time_s=progress.elapsed,
            assembly_time_s=clock.seconds["assembly"],
            solve_time_s=clock.seconds["solve"],
            solver=chosen.choice,
            surfaces=dict(self._surfaces),
            estimate=partial(self._estimate, chosen.choice.name),
        )
