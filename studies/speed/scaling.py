"""Cost of a Newton iteration against the number of elements, and peak memory.

It measures 10³ to 10⁶ jittered quadrilaterals, each size in a new process.  It times
the work that is done once (bases, pattern, order of elimination, symbolic analysis) and
one iteration, and fits power laws through the sizes from 10⁴ on.
"""

import resource
from functools import partial
from statistics import median

import numpy as np

from skfem_textile import Fabric, Full, LoadStepper, OnePoint, Ply
from skfem_textile.solve.conditions import Constraints
from skfem_textile.solve.linear import ChosenSolver
from skfem_textile.solve.problem import Problem
from skfem_textile.solve.tangent import reduced

from ..common.tables import markdown_table
from ..common.workers import in_new_process
from ..study import Row
from .measuring import Settings, seconds, strip_of

TABLES = "scaling.md", "step.md"

_SIZES = 1_000, 3_000, 10_000, 30_000, 100_000, 300_000, 1_000_000

_ROUNDS = 3

# The timed parts, in the order of the table.
_PARTS = "once", "assembly", "factorisation", "solution", "iteration"


def measured(settings: Settings) -> Row:
    """One iteration on every mesh, their exponents, and a load step on the largest."""
    sizes = [size for size in _SIZES if size <= settings.most]
    rows = [in_new_process(_iteration, size, settings.solver) for size in sizes]
    step = in_new_process(_whole_step, sizes[-1], settings.solver)
    measures = {"sizes": rows, "exponents": _exponents(rows), "step": step}
    return {"solver": settings.solver, **measures}


def _iteration(size: int, solver: str) -> Row:
    """Seconds of each part at one size, and the peak of the memory in GiB."""
    scene = strip_of(size)
    ply, built = seconds(Ply, scene.mesh, Fabric(1e4, 0.5), OnePoint(4.0))
    constraints, held = seconds(Constraints, ply.basis, scene.conditions)
    problem = Problem(ply, constraints, partial(ChosenSolver, solver))
    system, analysed = seconds(lambda: problem.system)
    u = scene.displacement(ply.nodes, 0.02).T.ravel()
    parts = []
    for _ in range(1 + _ROUNDS):
        u = (1 + 1e-9) * u
        f, forces = seconds(ply.residual, u)
        blocks, stiffness = seconds(ply.stiffness, u)
        K, picked = seconds(reduced, system, blocks)
        factors, factorised = seconds(system.solver.factorise, K.upper.data)
        _, solved = seconds(factors.solve, -f[system.free])
        assert factors.definite
        parts.append((forces + stiffness + picked, factorised, solved))
        del factors
    assembly, factorisation, solution = (
        median(x) for x in zip(*parts[1:], strict=True)
    )
    return {
        "elements": ply.mesh.nelements,
        "unknowns": int(ply.basis.N),
        "once": built + held + analysed,
        "assembly": assembly,
        "factorisation": factorisation,
        "solution": solution,
        "iteration": assembly + factorisation + solution,
        "peak_GiB": _peak(),
    }


def _whole_step(size: int, solver: str) -> Row:
    """The whole load in one step: seconds, linear solves and the peak of the memory."""
    scene = strip_of(size, jitter=0.3)
    ply = Ply(scene.mesh, Fabric(1e4), Full())
    result = LoadStepper(ply, scene.conditions, steps=1, solver=solver).run()
    return {
        "elements": ply.mesh.nelements,
        "seconds": result.wall_time_s,
        "linear_solves": result.linear_solves,
        "peak_GiB": _peak(),
    }


def _peak() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20


def _exponents(rows: list[Row]) -> dict[str, float]:
    """Exponents of power laws through the sizes from 10⁴ elements on, for each part."""
    large = [row for row in rows if row["elements"] > 9_000] or rows
    n = np.log([row["elements"] for row in large])
    return {
        part: float(np.polyfit(n, np.log([row[part] for row in large]), 1)[0])
        for part in _PARTS
    }


def tables(results: Row) -> dict[str, str]:
    """A line for each size, and one for the load step."""
    lines = [
        [row["elements"], *(f"{row[n]:.3g}" for n in _PARTS), f"{row['peak_GiB']:.2f}"]
        for row in results["sizes"]
    ]
    exponents = [f"{results['exponents'][name]:.2f}" for name in _PARTS]
    lines.append(["exponent from 10⁴ on", *exponents, ""])
    step = results["step"]
    line = [step["elements"], f"{step['seconds']:.0f}", step["linear_solves"]]
    line.append(f"{step['peak_GiB']:.2f}")
    head = ["elements", *(f"{name}, s" for name in _PARTS), "peak, GiB"]
    of_step = ["elements", "seconds of a step to 62.5°", "linear solves", "peak, GiB"]
    return {
        "scaling.md": markdown_table(head, lines),
        "step.md": markdown_table(of_step, [line]),
    }
