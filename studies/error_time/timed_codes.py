"""Codes that are timed on a mesh: elements of this library and of other codes."""

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy import ndarray
from skfem import CellBasis

from skfem_textile.ply import Ply
from skfem_textile.scenes import Scene
from skfem_textile.solve.result import Result, StepError
from skfem_textile.solve.stepper import LoadStepper

from ..common.log import errors_only
from ..common.rivals.newton import STEPS, NotConvergedError, Run
from ..common.rivals.rival import Rival
from ..common.rivals.task import Task
from ..formulations.cases import Case, Method, Specimen
from ..study import Row
from .errors import errors, unfolded

#: Seconds of a run after which a method is not refined further.
LONG = 5.0

# Seconds for which a rival may search for a number of steps with which it converges.
_PATIENCE = 60.0

_SEED = 1

# Number of timed runs; fewer for runs that take longer than some seconds.
_REPEATS, _FEWER, _SOME_SECONDS = 5, 3, 1.0

_NOTHING = dict.fromkeys(
    (
        *("position", "angle", "strain", "load", "load_error"),
        *("seconds", "seconds_min", "seconds_max"),
    ),
    np.nan,
)


class TimedCode(Protocol):
    """A code with an element and a solver."""

    @property
    def code(self) -> str:
        """The code, and the solver if there is a choice."""
        ...

    @property
    def element(self) -> str:
        """The element."""
        ...

    def missing(self) -> str:
        """Packages to install first; empty if nothing is missing."""
        ...

    def measured(self, problem: Specimen, across: int) -> Row:
        """Errors and times on a mesh with so many edges across."""
        ...


@dataclass(frozen=True)
class ThisLibrary:
    """One of the formulations of this library."""

    element: str
    method: Method
    code: ClassVar[str] = "skfem_textile"

    def missing(self) -> str:
        """Nothing."""
        return ""

    @errors_only()
    def measured(self, problem: Specimen, across: int) -> Row:
        """Load in one step, which the load stepper halves if it must."""
        scene = Case("", problem, self.method, across, _SEED).scene()

        def loaded() -> Result:
            formulation = self.method.formulation(problem.stabilisation)
            ply = Ply(scene.mesh, problem.fabric(scene), formulation)
            return LoadStepper(ply, scene.conditions, 1).run()

        try:
            result = loaded()
            seconds = _clocked(loaded)
        except StepError as error:
            return _row(error.result.ply.basis, note=str(error))
        steps, basis = len(result.states) - 1, result.ply.basis
        load = _load(scene, problem, scene.reaction(result.states[-1]))
        figures = errors(scene, basis, result.u, load) | _times(seconds)
        figures["strain"] = result.states[-1].verdict.max_fibre_strain
        return _row(basis, figures, steps, result.linear_solves)


@dataclass(frozen=True)
class OtherCode:
    """A rival of this library."""

    rival: Rival

    @property
    def code(self) -> str:
        """The code, and the solver if there is a choice."""
        return self.rival.code

    @property
    def element(self) -> str:
        """The element."""
        return self.rival.shape.name

    def missing(self) -> str:
        """Packages to install first."""
        return self.rival.missing()

    def measured(self, problem: Specimen, across: int) -> Row:
        """Load in the smallest number of steps that leads to an unfolded state.

        Only the runs with this number count for the time.
        """
        shape = self.rival.shape
        scene = problem.scene(problem.mesh(shape.mesh, across // shape.parts, _SEED))
        G = float(problem.law.tangent(np.zeros(1))[0])
        task = Task(scene, shape.element, shape.rule, problem.E, G)
        steps, run = self._fewest_steps(task)
        if run is None:
            note = f"no unfolded state in up to {steps} equal steps"
            if steps < STEPS[-1]:
                note += f", given up after {_PATIENCE:.0f} s"
            return _row(task.basis, note=note)
        if (repeats := _repeats(run.seconds[0])) > 1:
            run = self.rival.run(task, steps, repeats)
        load = _load(scene, problem, task.reaction(run.f))
        figures = errors(scene, task.basis, run.u, load) | _times(run.seconds)
        return _row(task.basis, figures, steps, run.linear_solves)

    def _fewest_steps(self, task: Task) -> tuple[int, Run | None]:
        """Number of steps and the run; None if no run converges, or not in time."""
        start = perf_counter()
        for steps in STEPS:
            try:
                run = self.rival.run(task, steps, repeats=1)
            except NotConvergedError:
                pass
            else:
                if unfolded(task.basis, run.u):
                    return steps, run
            if perf_counter() - start > _PATIENCE:
                break
        return steps, None


def _load(scene: Scene, problem: Specimen, reaction: ndarray) -> float:
    """Force along the prescribed displacement in N, or its share of the exact one."""
    if scene.load is not None:
        return float(reaction[1] / scene.load(problem.law, 1.0))
    direction = scene.conditions[scene.driven].direction
    return float(abs(reaction @ np.asarray(direction)))


def _clocked(function: Callable[[], Any]) -> list[float]:
    """Seconds of several calls."""
    seconds: list[float] = []
    while not seconds or len(seconds) < _repeats(seconds[0]):
        start = perf_counter()
        function()
        seconds.append(perf_counter() - start)
    return seconds


def _repeats(seconds: float) -> int:
    """How often a run of so many seconds is repeated."""
    if seconds > LONG:
        return 1
    return _FEWER if seconds > _SOME_SECONDS else _REPEATS


def _times(seconds: list[float]) -> Row:
    return {
        "seconds": float(np.median(seconds)),
        "seconds_min": min(seconds),
        "seconds_max": max(seconds),
        "repeats": len(seconds),
    }


def _row(
    basis: CellBasis,
    figures: Row | None = None,
    steps: int = 0,
    linear_solves: int = 0,
    note: str = "",
) -> Row:
    """A row of the table; missing figures are nan."""
    return {
        "elements": basis.mesh.nelements,
        "unknowns": basis.N,
        **(_NOTHING | {"repeats": 0} | (figures or {})),
        "steps": steps,
        "linear_solves": linear_solves,
        "note": note,
    }
