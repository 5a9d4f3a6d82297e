"""Processor time of small runs by part of the program.

Functions of `PARTS` are replaced by ones that measure; the time of a part excludes the
parts that it calls.
"""

import json
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import cached_property, wraps
from importlib import import_module
from operator import attrgetter
from time import process_time
from typing import Any
from unittest import mock

import numpy as np
from skfem import Mesh

from skfem_textile import LoadStepper, Ply
from skfem_textile.mesh.progress import unlogged
from skfem_textile.ply.formulations import SMOOTH
from skfem_textile.scenes import Scene

from ..common.tables import Row, markdown_table
from ..formulations.cases import MEAN_QUADRATIC, STRIP, Case
from .needs import output_of
from .solving import Settings

# Edges across the strip, quadratic triangles in one step; number of runs, and the share
# of them, the fastest, of which the times are the mean; number of new processes.
_ACROSS, _RUNS, _SHARE, _PROCESSES = (4, 8), 400, 0.05, 5

# The first run of a process, which prints its processor time in s, imports included.
_FIRST = """
import json, sys
from time import process_time
import numpy as np
from skfem import MeshTri
from skfem_textile import Fabric, LoadStepper, Ply, Quadratic
from skfem_textile.scenes import strip
p, t = map(np.array, json.load(sys.stdin))
scene = strip(MeshTri(p, t))
ply = Ply(scene.mesh, Fabric(1e4, 0.0, scene.warp, scene.weft), Quadratic(80.0))
LoadStepper(ply, scene.conditions, 1, solver="rslab").run()
print(process_time())
"""

#: Functions of each part, ``module:name``, relative to the library; the rest is last.
PARTS: dict[str, tuple[str, ...]] = {
    "checks of mesh and laws": ("ply.formulations:check_mesh", "ply.ply:check_laws"),
    "ply: bases and terms": ("ply.ply:Ply.__init__",),
    "load stepper: conditions": ("solve.stepper:LoadStepper.__init__",),
    "pattern of the tangent": (
        "ply.sum_of_terms:SumOfTerms.pattern",
        "ply.sum_of_terms:SumOfTerms._kinds",
        "solve.linear.system:System.__init__",
    ),
    "analysis by RSLAB": ("solve.linear.rslab:Rslab.__init__",),
    "element matrices and their sum": (
        "ply.sum_of_terms:SumOfTerms.stiffness",
        "solve.problem:reduced",
    ),
    "factorisation and solution": (
        "solve.linear.solver:ChosenSolver.factorise",
        "solve.problem:Tangent.increment",
        "solve.problem:Tangent.equilibrated",
    ),
    "forces and energies": (
        "ply.sum_of_terms:SumOfTerms.residual",
        "ply.sum_of_terms:SumOfTerms.energies",
    ),
    "predicted tensions": ("ply.sum_of_terms:SumOfTerms.geometric_tension",),
    "updates of parameters": (
        "ply.sum_of_terms:SumOfTerms.updated",
        "ply.sum_of_terms:SumOfTerms.parameters_at_rest",
    ),
    "tolerance and convergence": (
        "solve.problem:Tangent.tolerance",
        "solve.newton:Attempt.record",
    ),
    "acceptance checks and states": (
        "solve.verdict:Trial.of",
        "solve.verdict:Trial.apply_checks",
        "solve.verdict:Trial.state",
    ),
    "rest": (),
}


def small_runs(settings: Settings) -> Row:
    """Time in ms of each part of a run with a new ply, and of a run on the same ply."""
    with unlogged():
        return {"runs": [_small_run(across) for across in _ACROSS]}


def _small_run(across: int) -> Row:
    scene = Case("", STRIP, MEAN_QUADRATIC, across, 0).scene()
    stepper = _stepper(scene)
    result = stepper.run()
    whole, again = _fastest(lambda: _stepper(scene).run()), _fastest(stepper.run)
    clock = _Clock()
    with clock.measuring():
        _fastest(lambda: clock.run(lambda: _stepper(scene).run()))
    runs = sorted(clock.runs, key=lambda run: sum(run.values()))
    fastest = runs[: round(_SHARE * len(runs))]
    parts = {part: 1e3 * float(np.mean([x[part] for x in fastest])) for part in PARTS}
    return {
        "across": across,
        "unknowns": int(result.ply.basis.N),
        "linear_solves": result.linear_solves,
        "whole": whole,
        "again": again,
        "first": _first(scene.mesh),
        "parts": parts,
    }


def _stepper(scene: Scene) -> LoadStepper:
    ply = Ply(scene.mesh, STRIP.fabric(scene), SMOOTH)
    return LoadStepper(ply, scene.conditions, 1, solver="rslab")


def _fastest(run: Callable[[], object]) -> float:
    """Processor time in ms of the fastest runs of many, mean."""
    times = []
    for _ in range(_RUNS):
        start = process_time()
        run()
        times.append(process_time() - start)
    return 1e3 * float(np.mean(sorted(times)[: round(_SHARE * _RUNS)]))


def _first(mesh: Mesh) -> float:
    """Processor time in ms of the fastest of new processes, which run once."""
    text = json.dumps([mesh.p.tolist(), mesh.t.tolist()])
    return 1e3 * min(float(output_of(("-c", _FIRST), text)) for _ in range(_PROCESSES))


class _Clock:
    """Processor time in s of the parts of each run."""

    def __init__(self) -> None:
        self.runs: list[dict[str, float]] = []
        self._part, self._since = "rest", 0.0

    def run(self, function: Callable[[], object]) -> None:
        """Measure a run."""
        self.runs.append(dict.fromkeys(PARTS, 0.0))
        self._since = process_time()
        function()
        self._enter("rest")

    def _enter(self, part: str) -> str:
        """Start to measure a part; returns the one measured before."""
        now, before = process_time(), self._part
        self.runs[-1][before] += now - self._since
        self._part, self._since = part, now
        return before

    def _measured(self, part: str, function: Callable) -> Callable:
        @wraps(function)
        def measured(*arguments: Any, **options: Any) -> Any:
            before = self._enter(part)
            try:
                return function(*arguments, **options)
            finally:
                self._enter(before)

        return measured

    @contextmanager
    def measuring(self) -> Iterator[None]:
        """Replace the functions of all parts."""
        patches = ExitStack()
        for part, names in PARTS.items():
            for path in names:
                module, _, name = path.partition(":")
                owner: Any = import_module(f"skfem_textile.{module}")
                *outer, last = name.split(".")
                if outer:
                    owner = attrgetter(".".join(outer))(owner)
                function = vars(owner)[last]
                if isinstance(function, cached_property):
                    owner, last, function = function, "func", function.func
                if isinstance(function, classmethod):
                    new: Any = classmethod(self._measured(part, function.__func__))
                else:
                    new = self._measured(part, function)
                patches.enter_context(mock.patch.object(owner, last, new))
        with patches:
            yield


def small_runs_table(results: Row) -> str:
    """A line for each part."""
    runs = results["runs"]
    head = ["ms", *(f"{run['across']} across" for run in runs)]
    rows = [[part, *(f"{run['parts'][part]:.1f}" for run in runs)] for part in PARTS]
    for name, key in (("whole", "whole"), ("again, on the same ply", "again")):
        rows.append([name, *(f"{run[key]:.1f}" for run in runs)])
    first = [f"{run['first']:.0f}" for run in runs]
    rows.append(["first of a new process, with imports", *first])
    for name, key in (("unknowns", "unknowns"), ("linear solves", "linear_solves")):
        rows.append([name, *(str(run[key]) for run in runs)])
    return markdown_table(head, rows)
