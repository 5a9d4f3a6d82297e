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
from skfem_textile.solve.adaptive import AdaptiveResult, AdaptiveStepper
from skfem_textile.solve.result import Result, StepError
from skfem_textile.solve.stepper import LoadStepper

from ..common.log import errors_only
from ..common.rivals.newton import STEPS, NotConvergedError, Run
from ..common.rivals.rival import Rival
from ..common.rivals.task import Task
from ..formulations.cases import Case, Method, Specimen
from ..study import Row
from .errors import shape_errors, unfolded

#: Refinements of a uniform mesh: element edges across the scene, after any division.
ACROSS = (4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256)

#: Tolerances of the load to which a mesh is refined, and edges across the first mesh.
TOLERANCES, _FIRST_ACROSS = (0.2, 0.1, 0.05, 0.02), 8

#: Seconds of a run after which a method is not refined further.
LONG = 1.5

#: In the note of a search for a number of steps that took too long.
GIVEN_UP = "given up"

#: Seconds for which a rival may search for a number of steps with which it converges.
PATIENCE = 15.0

#: Linear solvers of this library by the name of their set.
SOLVERS = {"SciPy": "superlu", "fastest": "auto"}


class TimedCode(Protocol):
    """A code with an element and a linear solver."""

    @property
    def code(self) -> str:
        """The code."""
        ...

    @property
    def element(self) -> str:
        """The element."""
        ...

    @property
    def solver(self) -> str:
        """The linear solver."""
        ...

    def missing(self) -> str:
        """Packages to install first; empty if nothing is missing."""
        ...

    @property
    def refinements(self) -> Sequence[Any]:
        """What `measured` takes, from coarse to fine."""
        ...

    def measured(self, problem: Specimen, refinement: Any, seed: int) -> Row:
        """Errors and the time on a mesh, and how many edges it has across."""
        ...


@dataclass(frozen=True)
class ThisLibrary:
    """One of the formulations of this library, with a solver of `SOLVERS`."""

    element: str
    method: Method
    solver: str
    code: ClassVar[str] = "skfem_textile"
    refinements: ClassVar[tuple[int, ...]] = ACROSS

    def missing(self) -> str:
        """Nothing."""
        return ""

    @errors_only()
    def measured(self, problem: Specimen, across: int, seed: int) -> Row:
        """Load in one step, which the load stepper halves if it must."""
        scene = Case("", problem, self.method, across, seed).scene()

        def loaded() -> Result:
            formulation = self.method.formulation(problem.stabilisation)
            ply = Ply(scene.mesh, problem.fabric(scene), formulation)
            solver = SOLVERS[self.solver]
            return LoadStepper(ply, scene.conditions, 1, solver=solver).run()

        return {"across": across} | _own(scene, loaded)


@dataclass(frozen=True)
class Refined:
    """A formulation of this library on a mesh that is refined to a tolerance."""

    element: str
    method: Method
    solver: str
    code: ClassVar[str] = ThisLibrary.code
    refinements: ClassVar[tuple[float, ...]] = TOLERANCES

    def missing(self) -> str:
        """Nothing."""
        return ""

    @errors_only()
    def measured(self, problem: Specimen, tolerance: float, seed: int) -> Row:
        """Refine to a tolerance, with the whole load in one step on each mesh."""
        method, formulation = self.method, self.method.formulation(1.0)
        mesh = problem.mesh(method.mesh, _FIRST_ACROSS // method.parts, seed)
        scene = problem.scene(mesh)

        def loaded() -> AdaptiveResult:
            ply = Ply(scene.mesh, problem.fabric(scene), formulation)
            return AdaptiveStepper(
                ply, scene.conditions, tolerance, 1, solver=SOLVERS[self.solver]
            ).run()

        row = _own(scene, loaded)
        return {"across": _FIRST_ACROSS, "tolerance": tolerance} | row


@dataclass(frozen=True)
class OtherCode:
    """A rival of this library."""

    rival: Rival
    refinements: ClassVar[tuple[int, ...]] = ACROSS

    @property
    def code(self) -> str:
        """The code."""
        return self.rival.code

    @property
    def element(self) -> str:
        """The element."""
        return self.rival.shape.name

    @property
    def solver(self) -> str:
        """The linear solver."""
        return self.rival.solver

    def missing(self) -> str:
        """Packages to install first."""
        return self.rival.missing()

    def measured(self, problem: Specimen, across: int, seed: int) -> Row:
        """Load in the number of steps that suffices; finding it is not timed."""
        shape = self.rival.shape
        scene = problem.scene(problem.mesh(shape.mesh, across // shape.parts, seed))
        G = float(problem.law.tangent(np.zeros(1))[0])
        task = Task(scene, shape.element, shape.rule, problem.E, G)
        try:
            run, steps = self._run((problem.name, shape.name, across, seed), task)
        except NotConvergedError as error:
            return {"across": across} | _row(task.basis, note=str(error))
        figures = _errors(scene, task.basis, run.u, task.reaction(run.f))
        figures["seconds"] = run.seconds[0]
        row = _row(task.basis, figures, steps, run.linear_solves)
        return {"across": across} | row

    def _run(self, mesh: tuple[str, str, int, int], task: Task) -> tuple[Run, int]:
        """A timed run, and its number of steps, known or found."""
        run = self._unfolded(task, _STEPS[mesh], 1) if mesh in _STEPS else None
        if run is None:
            _STEPS[mesh] = self._best_steps(task, _STEPS.get(_coarser(mesh), 1))
            run = self.rival.run(task, _STEPS[mesh], repeats=1)
        return run, _STEPS[mesh]

    def _best_steps(self, task: Task, coarser: int) -> int:
        """The number of equal steps, out of the first two that suffice.

        It is the one with fewer linear solves.  The first that is tried is the one
        before that of the next coarser mesh.

        Raises
        ------
        NotConvergedError
            If no number leads to an unfolded state, or not in time.
        """
        start, found = perf_counter(), dict[int, int]()
        for steps in STEPS[max(0, STEPS.index(coarser) - 1) :]:
            if run := self._unfolded(task, steps, 0):
                found[run.linear_solves] = steps
            elif found:
                break
            if len(found) == 2:
                break
            if perf_counter() - start > PATIENCE:
                break
        if found:
            return found[min(found)]
        note = f"no unfolded state in up to {steps} equal steps"
        if steps < STEPS[-1]:
            note += f", {GIVEN_UP} after {PATIENCE:.0f} s"
        raise NotConvergedError(note)

    def _unfolded(self, task: Task, steps: int, repeats: int) -> Run | None:
        """A run, None if it fails."""
        try:
            run = self.rival.run(task, steps, repeats)
        except NotConvergedError:
            return None
        return run if unfolded(task.basis, run.u) else None


# Numbers of steps by problem, element, edges across and seed: other codes with the same
# element take the same Newton steps.
_STEPS: dict[tuple[str, str, int, int], int] = {}


def _coarser(mesh: tuple[str, str, int, int]) -> tuple[str, str, int, int]:
    problem, element, across, seed = mesh
    before = ACROSS[max(0, ACROSS.index(across) - 1)]
    return problem, element, before, seed


def _own(scene: Scene, loaded: Callable[[], Result]) -> Row:
    """Errors and the time of the second of two runs of this library."""
    try:
        loaded()
        start = perf_counter()
        result = loaded()
        seconds = perf_counter() - start
    except StepError as error:
        return _row(error.result.ply.basis, note=str(error))
    steps, basis = len(result.states) - 1, result.ply.basis
    figures = _errors(scene, basis, result.u, scene.reaction(result.states[-1]))
    figures["seconds"] = seconds
    solves = result.linear_solves
    if isinstance(result, AdaptiveResult):
        solves = sum(one.linear_solves for one in result.rounds)
    return _row(basis, figures, steps, solves)


def _errors(scene: Scene, basis: CellBasis, u: ndarray, reaction: ndarray) -> Row:
    """Load in N along the prescribed displacement; errors of the shape if it is known.

    That of the bias extension is known only for fibres that do not stretch.
    """
    if scene.load is not None:
        return {"load": float(reaction[1])}
    driven = scene.conditions[scene.driven]
    assert isinstance(driven, Condition)
    load = float(abs(reaction @ np.asarray(driven.direction)))
    return {"load": load} | shape_errors(scene, basis, u)


def _row(
    basis: CellBasis,
    figures: Row | None = None,
    steps: int | None = None,
    linear_solves: int | None = None,
    note: str = "",
) -> Row:
    """A row of the table; a run that failed has a note and no figures."""
    return {
        "elements": basis.mesh.nelements,
        "unknowns": basis.N,
        **dict.fromkeys(("position", "angle", "load", "seconds")),
        **(figures or {}),
        "steps": steps,
        "linear_solves": linear_solves,
        "note": note,
    }
