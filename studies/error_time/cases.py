"""Codes timed on successively finer meshes, and the converged load of a scene.

The codes are elements of this library and of other codes.  The converged load of the
bias extension comes from two formulations on fibre-aligned meshes, whose cells are
halved three times.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from time import perf_counter
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy import ndarray
from skfem import CellBasis, ElementTriP1

from skfem_textile import Condition
from skfem_textile.fabric import kinematics as kin
from skfem_textile.mesh.bases import GAUSS, SIX
from skfem_textile.ply import Ply
from skfem_textile.ply.formulations import Full, Quadratic
from skfem_textile.ply.terms import Formulation
from skfem_textile.scenes import Scene, bias_extension
from skfem_textile.solve.result import Result, StepError
from skfem_textile.solve.stepper import LoadStepper

from ..angles.cases import Specimen as AlignedPly
from ..common.rivals.codes import RIVALS
from ..common.rivals.newton import STEPS, NotConvergedError, Run
from ..common.rivals.rival import Rival, Task
from ..common.running import errors_only
from ..common.tables import Row
from ..formulations.cases import (
    AUTO,
    BIAS,
    FULL,
    MACRO,
    MACRO_TRIANGLES,
    MEAN_QUADRATIC,
    QUADRATIC,
    SEEDS,
    STRIP,
    Case,
    Method,
    Specimen,
)

#: Scenes in one load step: the strip, and the bias extension to 40° at E/G = 2·10⁵.
PROBLEMS = {
    "strip": replace(STRIP, steps=1, last=1),
    "bias_extension": replace(BIAS[1], scene=bias_extension, steps=1, last=1),
}

#: Formulations of this library by element name.
BY_ELEMENT = {
    "Q4, one point": AUTO,
    "macro, quads": MACRO,
    "macro, triangles": MACRO_TRIANGLES,
    "P2, 3 points": QUADRATIC,
    "P2, mean stretch": MEAN_QUADRATIC,
    "Q4, 2×2": FULL,
}

#: Refinements of a uniform mesh: element edges across the scene, after any splitting.
ACROSS = (4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256)

#: Run time in s beyond which a method is not refined further.
LONG = 1.5

#: Text in the note of a search for a number of steps that exceeded its time.
GIVEN_UP = "given up"

#: Time limit in s of another code's search for a number of steps that converges.
PATIENCE = 15.0

#: Linear solvers of this library by set: the one it requires, the fastest installed.
SOLVERS = {"required": "rslab", "fastest": "auto"}

#: Ply of the reference: 45°, linear law, E/G = 2·10⁵; the last step ends at 40°.
SPECIMEN = AlignedPly(45.0, "linear", 2e5)

#: Formulations, and cells along a rhombus side.
FORMULATIONS: dict[str, Formulation] = {"Quadratic()": Quadratic(), "Full()": Full()}
CELLS = (8, 16, 32, 64)

#: Entry ``code`` of reference rows.
CODE = "reference"


@dataclass(frozen=True)
class ThisLibrary:
    """A formulation of this library with a solver of `SOLVERS`."""

    element: str
    method: Method
    solver: str
    code: ClassVar[str] = "skfem_textile"

    def missing(self) -> str:
        """Missing packages; none."""
        return ""

    @errors_only()
    def measured(self, problem: Specimen, across: int, seed: int) -> Row:
        """Errors and run time of one load step, halved if necessary."""
        scene = Case("", problem, self.method, across, seed).scene()

        def loaded() -> Result:
            formulation = self.method.formulation(problem.stabilisation)
            ply = Ply(scene.mesh, problem.fabric(scene), formulation)
            solver = SOLVERS[self.solver]
            return LoadStepper(ply, scene.conditions, 1, solver=solver).run()

        return {"across": across} | _run_twice(scene, loaded)


@dataclass(frozen=True)
class OtherCode:
    """An element of another code."""

    rival: Rival

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
        """Missing packages."""
        return self.rival.missing()

    def measured(self, problem: Specimen, across: int, seed: int) -> Row:
        """Load in a sufficient number of steps; the search for it is not timed."""
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
        """A timed run and its number of steps, from an earlier run or a search."""
        run = self._unfolded(task, _STEPS[mesh], 1) if mesh in _STEPS else None
        if run is None:
            _STEPS[mesh] = self._best_steps(task, _STEPS.get(_coarser(mesh), 1))
            run = self.rival.run(task, _STEPS[mesh], repeats=1)
        return run, _STEPS[mesh]

    def _best_steps(self, task: Task, coarser: int) -> int:
        """The number of equal steps with fewer solves, of the first two that converge.

        The search starts one number below the result of the next coarser mesh.

        Raises
        ------
        NotConvergedError
            If no number within the time limit gives a state without inverted elements.
        """
        start, steps_by_solves = perf_counter(), dict[int, int]()
        for steps in STEPS[max(0, STEPS.index(coarser) - 1) :]:
            if run := self._unfolded(task, steps, 0):
                steps_by_solves[run.linear_solves] = steps
            elif steps_by_solves:
                break
            if len(steps_by_solves) == 2:
                break
            if perf_counter() - start > PATIENCE:
                break
        if steps_by_solves:
            return steps_by_solves[min(steps_by_solves)]
        note = f"inverted elements in up to {steps} equal steps"
        if steps < STEPS[-1]:
            note += f", {GIVEN_UP} after {PATIENCE:.0f} s"
        raise NotConvergedError(note)

    def _unfolded(self, task: Task, steps: int, repeats: int) -> Run | None:
        """A run; None if it fails or elements are inverted."""
        try:
            run = self.rival.run(task, steps, repeats)
        except NotConvergedError:
            return None
        return run if unfolded(task.basis, run.u) else None


# Numbers of steps by problem, element, edges across and seed; codes with the same
# element have the same Newton iterates.
_STEPS: dict[tuple[str, str, int, int], int] = {}


def _coarser(mesh: tuple[str, str, int, int]) -> tuple[str, str, int, int]:
    problem, element, across, seed = mesh
    before = ACROSS[max(0, ACROSS.index(across) - 1)]
    return problem, element, before, seed


def _run_twice(scene: Scene, loaded: Callable[[], Result]) -> Row:
    """Errors and run time of the second of two runs of this library."""
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
    return _row(basis, figures, steps, result.linear_solves)


def _errors(scene: Scene, basis: CellBasis, u: ndarray, reaction: ndarray) -> Row:
    """Load in N along the prescribed displacement; shape errors if the shape is known.

    The exact shape of the bias extension is known only for inextensible fibres.
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
    """A row of the table; a failed run has a note and no results."""
    return {
        "elements": basis.mesh.nelements,
        "unknowns": basis.N,
        **dict.fromkeys(("position", "angle", "load", "seconds")),
        **(figures or {}),
        "steps": steps,
        "linear_solves": linear_solves,
        "note": note,
    }


def shape_errors(scene: Scene, basis: CellBasis, u: ndarray) -> dict[str, float]:
    """Shape errors of the displacement at full load against the exact solution.

    Parameters
    ----------
    scene
        The scene, with load factor 1 at full load.
    basis
        Basis of the displacement.
    u
        Displacement.

    Returns
    -------
    dict
        ``position``, rms error over the nodes in mm; ``angle``, rms error of the shear
        angle at element centres in degrees.
    """
    warp, weft = (np.reshape(A, (2, 1, 1)) for A in (scene.warp, scene.weft))
    centre = _at_points(basis, basis.mesh.elem.refdom.p.mean(axis=1, keepdims=True))
    angle = kin.shear_angle(_F(centre, u), warp, weft)[:, 0]
    nodes, displacement = basis.doflocs[:, ::2], u.reshape(-1, 2).T
    centres = basis.mesh.p[:, basis.mesh.t].mean(axis=1)
    off = scene.distance(nodes, displacement, centres, angle, centre.dx[:, 0], 1.0)
    return {
        "position": off["displacement_error_rms"],
        "angle": off["shear_angle_error_rms_deg"],
    }


def unfolded(basis: CellBasis, u: ndarray) -> bool:
    """True if det F > 0 at the 2×2 points, or at the six points of triangles."""
    points, _ = SIX if basis.mesh.elem is ElementTriP1 else GAUSS
    return bool((kin.area_ratio(_F(_at_points(basis, points), u)) > 0).all())


def _F(basis: CellBasis, u: ndarray) -> ndarray:
    field: Any = basis.interpolate(u)
    return kin.deformation_gradient(field.grad)


def _at_points(basis: CellBasis, points: ndarray) -> CellBasis:
    rule = (points, np.ones(points.shape[1]))
    return CellBasis(basis.mesh, basis.elem, quadrature=rule)


#: This library with each set of solvers, then the other codes.
CODES: tuple[ThisLibrary | OtherCode, ...] = (
    *(ThisLibrary(*x, solver) for solver in SOLVERS for x in BY_ELEMENT.items()),
    *map(OtherCode, RIVALS),
)


class Timed(NamedTuple):
    """A code, timed on successively finer meshes of a problem.

    ``sizes`` are numbers of edges across.
    """

    seed: int
    scene: str
    problem: Specimen
    code: ThisLibrary | OtherCode
    sizes: Sequence[int]

    def __str__(self) -> str:
        code = self.code
        words = self.scene, code.code, code.element, code.solver, f"seed {self.seed}"
        return ", ".join(words)

    def rows(self) -> list[Row]:
        """Results of a code for one seed, from coarse to fine meshes.

        The mesh is refined until a run other than the first takes longer than `LONG`.
        For a code that is not installed, one row contains a note.
        """
        code = self.code
        head: Row = {"scene": self.scene, "code": code.code, "element": code.element}
        head |= {"solver": code.solver, "seed": self.seed, "across": 0}
        if missing := code.missing():
            return [head | {"note": f"skipped, not installed: {missing}"}]
        rows = []
        for across in self.sizes:
            start = perf_counter()
            row = code.measured(self.problem, across, self.seed)
            rows.append(head | row)
            took = perf_counter() - start if row["note"] else row["seconds"]
            if took > LONG and len(rows) > 1:
                break
        return rows


@dataclass(frozen=True)
class Reference:
    """A formulation on a fibre-aligned mesh with a number of cells."""

    element: str
    cells: int

    def __str__(self) -> str:
        return f"reference, {self.element}, {self.cells} cells"

    def rows(self) -> list[Row]:
        """The load in N, and the load of inextensible fibres."""
        scene = SPECIMEN.along_fibres(self.cells)
        result = SPECIMEN.stepper(scene, FORMULATIONS[self.element]).run()
        assert scene.load is not None
        row = {
            "scene": "bias_extension",
            "code": CODE,
            "element": self.element,
            "across": self.cells,
            "elements": scene.mesh.nelements,
            "unknowns": result.ply.basis.N,
            "load": float(scene.reaction(result.states[-1])[1]),
            "inextensible": float(scene.load(SPECIMEN.shear_law, 1.0)),
        }
        return [row]


class Load(NamedTuple):
    """A load in N, its uncertainty in N, and the load of inextensible fibres in N."""

    load: float
    uncertainty: float
    inextensible: float


def converged(rows: Sequence[Row]) -> Load | None:
    """The converged load; None if a mesh of a formulation has no row.

    The load is the mean of the extrapolated loads of both formulations.  The
    uncertainty is the maximum of their difference and the last changes on halving.
    """
    known = {
        (row["element"], row["across"]): row for row in rows if row["code"] == CODE
    }
    if len(known) < len(FORMULATIONS) * len(CELLS):
        return None
    loads = {e: [known[e, n]["load"] for n in CELLS] for e in FORMULATIONS}
    ends = [extrapolated(series) for series in loads.values()]
    changes = [abs(series[-1] - series[-2]) for series in loads.values()]
    uncertainty = max(np.ptp(ends), *changes)
    inextensible = next(iter(known.values()))["inextensible"]
    return Load(float(np.mean(ends)), float(uncertainty), inextensible)


def extrapolated(series: Sequence[float]) -> float:
    """Richardson extrapolation with the order of the last two changes.

    Returns the last value unless the changes have the same sign and decrease.

    Examples
    --------
    >>> extrapolated([5.0, 2.0, 1.25, 1.0625])
    1.0
    >>> extrapolated([2.0, 1.0, 1.5])
    1.5
    """
    before, last = np.diff(series[-3:])
    if last == 0 or before / last <= 1:
        return series[-1]
    return float(series[-1] + last / (before / last - 1))


def all_cases() -> list[Timed | Reference]:
    """The reference, then all codes in turn, seed by seed."""
    return [
        *(Reference(*options) for options in product(FORMULATIONS, CELLS)),
        *(
            Timed(seed, *problem, code, ACROSS)
            for seed, problem, code in product(SEEDS, PROBLEMS.items(), CODES)
        ),
    ]
