"""PETSc on several processes, compared with SuperLU.

``mpirun -n N python -m studies.speed.processes SOLVER ELEMENTS FOLDER`` writes the
results of each process to a folder.
"""

import os
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy import ndarray

from skfem_textile import Fabric, Full, LoadStepper, Ply
from skfem_textile.solve.problem import reduced

from ..common.running import ONE_THREAD
from ..common.tables import Row
from .one_ply import peak
from .solving import Iteration, Settings, seconds, strip_of

# Approximate numbers of quadrilaterals, and numbers of processes.
_SIZES, _PROCESSES = (15_000, 60_000), (1, 2, 4)

# Fibre and shear stiffness in N/mm, and timed rounds after one for warm-up.
_E, _G, _ROUNDS = 1e4, 0.5, 3

#: The parts whose time and peak memory are measured.
PARTS = "set_up", "factorisation", "solution"

# Open MPI refuses root and more processes than cores by default.  Idle processes yield
# their core.
_MPI = {
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "OMPI_MCA_rmaps_base_oversubscribe": "1",
    "OMPI_MCA_mpi_yield_when_idle": "1",
}


def processes(settings: Settings) -> Row:
    """Factorisation and solution by PETSc on 1, 2 and 4 processes of one machine.

    Strips with 2×2 points are loaded in one step; displacement and reaction are
    compared with SuperLU.  Times and peak memory, for one tangent, are the largest
    values of all processes.
    """
    if missing():
        return {"missing": f"skipped, needs {missing()}", "runs": []}
    rows = []
    for elements in _SIZES:
        if elements > settings.most:
            continue
        (expected,) = run("superlu", elements)
        rows.append(_row(elements, "superlu", [expected], expected))
        for n in _PROCESSES:
            rows.append(_row(elements, "petsc", run("petsc", elements, n), expected))
    return {"petsc": _version(), "runs": rows}


def missing() -> str:
    """The missing packages; empty if none is missing."""
    there = {"petsc4py": find_spec("petsc4py"), "mpirun": shutil.which("mpirun")}
    return ", ".join(name for name, found in there.items() if not found)


def run(
    solver: str, elements: int, n: int = 1, options: str = ""
) -> list[dict[str, ndarray]]:
    """Results of each process, with options of PETSc."""
    before = ["mpirun", "-n", str(n)] if solver == "petsc" else []
    words = "-m", "studies.speed.processes", solver, str(elements)
    root = str(Path(__file__).parents[2])
    path = os.pathsep.join([root, os.environ.get("PYTHONPATH", "")])
    more = {"PYTHONPATH": path, "PETSC_OPTIONS": options}
    environment = os.environ | ONE_THREAD | _MPI | more
    with TemporaryDirectory() as folder:
        command = [*before, sys.executable, *words, folder]
        subprocess.run(command, check=True, env=environment)
        return [dict(np.load(file)) for file in sorted(Path(folder).iterdir())]


def difference(found: dict[str, ndarray], expected: dict[str, ndarray]) -> float:
    """The largest relative difference of displacements and of reactions."""
    return max(
        float(np.abs(found[name] - expected[name]).max() / np.abs(expected[name]).max())
        for name in ("displacement", "reaction")
    )


def _row(
    elements: int,
    solver: str,
    ranks: list[dict[str, ndarray]],
    expected: dict[str, ndarray],
) -> Row:
    """Largest values of the processes."""
    times, memory = (
        np.max([rank[name] for rank in ranks], axis=0).tolist()
        for name in ("seconds", "MiB")
    )
    return {
        "elements": elements,
        "unknowns": len(expected["displacement"]),
        "solver": solver,
        "processes": len(ranks),
        "difference": max(difference(rank, expected) for rank in ranks),
        "seconds": dict(zip(PARTS, times, strict=True)),
        "peak_MiB": dict(zip(PARTS, memory, strict=True)),
    }


def main(solver: str, elements: str, folder: str) -> None:
    """Measure this process, and write its results to a folder."""
    scene = strip_of(int(elements), jitter=0.3)
    ply, built = seconds(Ply, scene.mesh, Fabric(_E, _G), Full())
    iteration = Iteration(ply, scene, solver)
    memory = [peak()]
    system, u = iteration.system, iteration.u
    free = iteration.problem.constraints.free
    b, K = -ply.residual(u)[free], reduced(system, ply.stiffness(u))
    times = []
    for _ in range(1 + _ROUNDS):
        factors, factorised = seconds(system.solver.factorise, K.upper.data)
        memory.append(peak())
        assert factors.definite
        solved = seconds(factors.solve, b)[1]
        memory.append(peak())
        times.append((factorised, solved))
    result = LoadStepper(ply, scene.conditions, 1, solver=solver).run()
    parts = [median(part) for part in zip(*times[1:], strict=True)]
    np.savez(
        Path(folder, f"{_rank(solver)}.npz"),
        displacement=result.u,
        reaction=result.states[-1].reactions[scene.driven],
        seconds=[built + iteration.set_up, *parts],
        MiB=memory[:3],
    )


def _rank(solver: str) -> int:
    return int(_petsc().COMM_WORLD.rank) if solver == "petsc" else 0


def _version() -> str:
    return ".".join(map(str, _petsc().Sys.getVersion()))


def _petsc() -> Any:
    from petsc4py import PETSc

    return PETSc


if __name__ == "__main__":
    main(*sys.argv[1:])
