"""Codes that are timed on a mesh: elements of this library and of other codes."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy import ndarray
from skfem import CellBasis

from skfem_textile import Condition
from skfem_textile.ply import Ply
from skfem_textile.scenes import Scene
from skfem_textile.solve.result import Result, StepError
from skfem_textile.solve.stepper import LoadStepper
from skfem_textile.solve.stepping.adaptive import AdaptiveResult, AdaptiveStepper

from ..common.log import errors_only
from ..common.rivals.newton import STEPS, NotConvergedError, Run
from ..common.rivals.rival import Rival
from ..common.rivals.task import Task
from ..formulations.cases import Case, Method, Specimen
from ..study import Row
from .errors import errors, unfolded

#: Refinements of a uniform mesh: element edges across the scene, after any division.
ACROSS = (4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256)

#: Tolerances of the load to which a mesh is refined, and edges across the first mesh.
TOLERANCES, _FIRST_ACROSS = (0.2, 0.1, 0.05, 0.02, 0.01, 0.005, 0.002), 8

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

    @property
    def refinements(self) -> Sequence[Any]:
        """What `measured` takes, from coarse to fine."""
        ...

    def measured(self, problem: Specimen, refinement: Any) -> Row:
        """Errors and times on a mesh, and how many edges it has across."""
        ...


@dataclass(frozen=True)
class ThisLibrary:
    """One of the formulations of this library."""

    element: str
    method: Method
    code: ClassVar[str] = "skfem_textile"
    refinements: ClassVar[tuple[int, ...]] = ACROSS

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

        return {"across": across} | _own(scene, problem, loaded)


@dataclass(frozen=True)
class Refined:
    """A formulation of this library on a mesh that is refined to a tolerance."""

    element: str
    method: Method
    code: ClassVar[str] = ThisLibrary.code
    refinements: ClassVar[tuple[float, ...]] = TOLERANCES

    def missing(self) -> str:
        """Nothing."""
        return ""

    @errors_only()
    def measured(self, problem: Specimen, tolerance: float) -> Row:
        """Refine to a tolerance, with the whole load in one step on each mesh."""
        method, formulation = self.method, self.method.formulation(1.0)
        mesh = problem.mesh(method.mesh, _FIRST_ACROSS // method.parts, _SEED)
        scene = problem.scene(mesh)

        def loaded() -> AdaptiveResult:
            ply = Ply(scene.mesh, problem.fabric(scene), formulation)
            return AdaptiveStepper(ply, scene.conditions, tolerance, 1).run()

        row = _own(scene, problem, loaded)
        return {"across": _FIRST_ACROSS, "tolerance": tolerance} | row


@dataclass(frozen=True)
class OtherCode:
    """A rival of this library."""

    rival: Rival
    refinements: ClassVar[tuple[int, ...]] = ACROSS

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
            return {"across": across} | _row(task.basis, note=note)
        if (repeats := _repeats(run.seconds[0])) > 1:
            run = self.rival.run(task, steps, repeats)
        load = _load(scene, problem, task.reaction(run.f))
        figures = errors(scene, task.basis, run.u, load) | _times(run.seconds)
        row = _row(task.basis, figures, steps, run.linear_solves)
        return {"across": across} | row

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


def _own(scene: Scene, problem: Specimen, loaded: Callable[[], Result]) -> Row:
    """Errors and times of a run of this library."""
    try:
        result = loaded()
        seconds = _clocked(loaded)
    except StepError as error:
        return _row(error.result.ply.basis, note=str(error))
    steps, basis = len(result.states) - 1, result.ply.basis
    load = _load(scene, problem, scene.reaction(result.states[-1]))
    figures = errors(scene, basis, result.u, load) | _times(seconds)
    figures["strain"] = result.states[-1].verdict.max_fibre_strain
    solves = result.linear_solves
    if isinstance(result, AdaptiveResult):
        solves = sum(one.linear_solves for one in result.rounds)
    return _row(basis, figures, steps, solves)


def _load(scene: Scene, problem: Specimen, reaction: ndarray) -> float:
    """Force along the prescribed displacement in N, or its share of the exact one."""
    if scene.load is not None:
        return float(reaction[1] / scene.load(problem.law, 1.0))
    driven = scene.conditions[scene.driven]
    assert isinstance(driven, Condition)
    direction = driven.direction
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
