"""The whole strip on 60 000 quadrilaterals, beside plain Newton in scikit-fem.

Both load the same ply to 62.5°, with 2×2 points, which have one equilibrium.  Plain
Newton takes the equal steps that it needs.  This library begins with one.
"""

from statistics import median

import numpy as np
from numpy import ndarray

from skfem_textile import Fabric, Full, LoadStepper, Ply
from skfem_textile.scenes import Scene
from skfem_textile.solve.result import Result

from ..common.rivals.newton import loaded
from ..common.rivals.plain import Plain
from ..common.rivals.rival import QUAD4
from ..common.rivals.task import Task
from ..common.tables import markdown_table
from ..study import Row
from .measuring import Settings, seconds, spread, strip_of

TABLES = ("whole_strip.md",)

_SIZE, _E, _G = 60_000, 1e4, 0.0

# Load steps of plain Newton, and repeats of this library.
_STEPS, _REPEATS = 20, 5


def measured(settings: Settings) -> Row:
    """Seconds and linear solves of both, and how far apart they end."""
    scene = strip_of(min(_SIZE, settings.most), jitter=0.3)
    _own(scene, settings.solver)  # to warm up
    runs = [seconds(_own, scene, settings.solver) for _ in range(_REPEATS)]
    result, times = runs[0][0], [took for _, took in runs]
    (u, _, solves), took = seconds(_stock, scene)
    return {
        "elements": scene.mesh.nelements,
        "own": spread(times) | {"linear_solves": result.linear_solves},
        "stock": {"seconds": took, "linear_solves": solves, "steps": _STEPS},
        "stock_over_own": took / median(times),
        "largest_difference_mm": float(np.abs(u - result.u).max()),
    }


def _own(scene: Scene, solver: str) -> Result:
    """The end of the load by this library."""
    ply = Ply(scene.mesh, Fabric(_E, _G), Full())
    return LoadStepper(ply, scene.conditions, steps=1, solver=solver).run()


def _stock(scene: Scene) -> tuple[ndarray, ndarray, int]:
    """The end of the load by plain Newton: displacement, forces, iterations."""
    task = Task(scene, QUAD4.element, QUAD4.rule, _E, _G)
    return loaded(Plain(QUAD4).system(task), task.values(_STEPS))


def tables(results: Row) -> dict[str, str]:
    """Both, and their ratio."""
    own, stock = results["own"], results["stock"]
    steps = f"scikit-fem, {stock['steps']} steps of plain Newton"
    lines = [
        ["skfem_textile, one step", f"{own['median']:.2f}", own["linear_solves"]],
        [steps, f"{stock['seconds']:.0f}", stock["linear_solves"]],
        ["ratio", f"{results['stock_over_own']:.0f}", ""],
    ]
    return {"whole_strip.md": markdown_table(["", "seconds", "linear solves"], lines)}
