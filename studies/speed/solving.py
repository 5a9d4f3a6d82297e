"""Benchmarks of the solution: iterations, whole runs, scaling with mesh size.

Each benchmark is a function of the settings with JSON-serialisable results.
"""

import json
import os
import resource
import subprocess
import sys
from collections.abc import Callable, Sequence
from functools import partial
from importlib.util import find_spec
from itertools import product
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import triu
from scipy.sparse.linalg import cg

from skfem_textile import Fabric, Full, LoadStepper, Macro, OnePoint, Ply, split
from skfem_textile.ply.terms import Formulation
from skfem_textile.scenes import Scene, strip
from skfem_textile.solve.conditions import Constraints
from skfem_textile.solve.linear import SOLVERS as LINEAR_SOLVERS
from skfem_textile.solve.linear import ChosenSolver, check_solver, solver_named
from skfem_textile.solve.problem import Problem, reduced

from ..common import provenance
from ..common.rivals.codes import Dolfinx, FElupe, Native, Plain
from ..common.rivals.newton import loaded, one_iteration
from ..common.rivals.rival import QUAD4, QUAD4_CENTRE, Rival, Task
from ..common.running import in_new_process
from ..common.tables import Column, Row

# Fibre and shear stiffness in N/mm, and load factor of iterations.
_E, _G, _LOAD_FACTOR = 1e4, 0.5, 0.02

# Elements of iterations and of the whole strip.
_SIZE = 60_000

# Iterations for warm-up: the first two touch memory that is new to the process.
_WARM = 2

# Rounds in which codes alternate, and rounds per mesh size.
_ROUNDS, _ROUNDS_OF_SIZE = 4, 3

#: Elements of the other codes, and formulations with the same energy.
ELEMENTS: dict[str, Formulation] = {
    "Q4, one point": OnePoint(8 * _G),
    "Q4, 2×2": Full(),
}

#: This library with each of its solvers.
SOLVERS = {"required": "rslab", "pardiso": "pardiso", "cholmod": "cholmod"}

RIVALS: tuple[Rival, ...] = (
    *(Plain(QUAD4_CENTRE, C_s=1.0), Plain(QUAD4)),
    *(FElupe(QUAD4), FElupe(QUAD4, "pypardiso"), Dolfinx(QUAD4), Native(QUAD4)),
)

# Mesh sizes of the benchmarks; of `overhead` as elements along both sides.
_SIZES = 10_000, 100_000, 1_000_000
_OF_ITERATIVE = 10_000, 30_000, 100_000, 300_000
_OF_FACTORISATION = 15_000
_OF_OVERHEAD = (20, 30), (60, 100), (200, 300)

#: The timed parts of `scaling`, in the order of the table.
PARTS = "once", "assembly", "factorisation", "solution", "iteration", "step"

# Optional solvers of `scaling`, if they are installed.
_OPTIONAL = "cholmod", "pardiso"

_MOST_ITERATIONS = 500

# Load steps of plain Newton in `whole_strip`, and repeats of this library.
_STEPS, _REPEATS = 20, 5

# Rounds of two checkouts, and the script that each of them runs.
_TURNS = 5
_MEASURE = """
import json, time
from skfem_textile import Condition, Fabric, Full, LoadStepper, Macro, OnePoint, Ply
from skfem_textile.scenes import strip
from skfem_textile.mesh.splitting import split

seconds = {}
for name, size, formulation in (
    ("one point", (100, 150), OnePoint()),
    ("2×2 points", (60, 90), Full()),
    ("macro-elements", (50, 75), Macro()),
):
    scene = strip("aligned", size)
    mesh = split(scene.mesh) if name == "macro-elements" else scene.mesh
    ply = Ply(mesh, Fabric(1e4, 0.5), formulation)
    conditions = {"clamp": Condition("bottom"), "pull": Condition("top", (1.0, 1.0))}
    stepper = LoadStepper(ply, conditions, 2, solver="cholmod")
    began = time.process_time()
    result = stepper.run()
    seconds[name] = (time.process_time() - began) / result.linear_solves
print(json.dumps(seconds))
"""


class Settings(NamedTuple):
    """Settings of the user.

    Parameters
    ----------
    most
        Maximum number of elements.
    solver
        The linear solver of `whole_strip`.
    before, after
        Two checkouts of this project, for `by_turns`.
    """

    most: int = 1_000_000
    solver: str = "auto"
    before: Path | None = None
    after: Path | None = None


def seconds(function: Callable[..., Any], *arguments: Any) -> tuple[Any, float]:
    """The result of a function, and its run time in s."""
    start = perf_counter()
    result = function(*arguments)
    return result, perf_counter() - start


def strip_of(elements: int, **more: Any) -> Scene:
    """The strip with about this number of elements."""
    across = (elements / 1.5) ** 0.5
    return strip(size=(round(across), round(1.5 * across)), **more)


def spread(times: Sequence[float]) -> dict[str, float]:
    """Median, smallest and largest value."""
    return {"median": median(times), "least": min(times), "most": max(times)}


class Iteration:
    """Newton iterations of a ply near a displacement, in timed parts."""

    def __init__(self, ply: Ply, scene: Scene, solver: str) -> None:
        start = perf_counter()
        constraints = Constraints(ply.basis, scene.conditions)
        self.problem = Problem(ply, constraints, partial(ChosenSolver, solver))
        self.system = self.problem.system
        self.set_up = perf_counter() - start
        self.ply = ply
        self.u = scene.displacement(ply.nodes, _LOAD_FACTOR).T.ravel()

    def round(self) -> list[float]:
        """Times of assembly, factorisation and solution in s."""
        ply, system = self.ply, self.system
        u = self.u = (1 + 1e-9) * self.u  # avoids cached strains
        times = [perf_counter()]
        f = ply.residual(u)
        K = reduced(system, ply.stiffness(u))
        times.append(perf_counter())
        factors = system.solver.factorise(K.upper.data)
        assert factors.definite
        times.append(perf_counter())
        factors.solve(-f[self.problem.constraints.free])
        times.append(perf_counter())
        return np.diff(times).tolist()


def _this_library(element: str, solver: str, scene: Scene) -> Callable[[], list[float]]:
    ply = Ply(scene.mesh, Fabric(_E, _G), ELEMENTS[element])
    return Iteration(ply, scene, SOLVERS[solver]).round


def _other_code(rival: Rival, scene: Scene) -> Callable[[], list[float]]:
    shape, share = rival.shape, iter(1 + 1e-9 * np.arange(1, 100))
    task = Task(scene, shape.element, shape.rule, _E, _G)
    system = rival.system(task) if not isinstance(rival, Dolfinx) else None
    u = scene.displacement(scene.mesh.p, _LOAD_FACTOR).T.ravel()

    def one_round() -> list[float]:
        """Times of assembly, and of factorisation with solution, in s."""
        moved = next(share) * u  # avoids cached factors
        if system:
            return [*one_iteration(system, moved)]
        return [*rival.iterations(task, moved, _WARM)[-1]]

    return one_round


def iteration(settings: Settings) -> Row:
    """One Newton iteration on 60 000 quadrilaterals, compared with other codes.

    Residual, tangent, factorisation and solution at one displacement.  Each code runs
    in a separate process with warm-up.  The codes alternate in each round.
    """
    elements = min(_SIZE, settings.most)
    codes, missing = _codes()
    times: dict[str, list[list[float]]] = {name: [] for name in codes}
    for _ in range(_ROUNDS):
        for name, rows in times.items():
            rows += in_new_process(_timed, name, elements)
    stock = {e: median(t[-1] for t in times[f"{e}: scikit-fem"]) for e in ELEMENTS}
    results = {}
    for name, rows in sorted(times.items()):
        *parts, total = zip(*rows, strict=True)
        results[name] = {
            "seconds": spread(total),
            "parts": [median(part) for part in parts],
            "stock_over_this": stock[name.partition(":")[0]] / median(total),
        }
    return {
        "elements": elements,
        "rounds": _ROUNDS,
        "missing": missing,
        "codes": results,
        "ratios": _ratios(results),
    }


def _codes() -> tuple[dict[str, tuple[Any, ...]], dict[str, str]]:
    """Constructors of the installed codes by name, and reasons for missing ones."""
    codes: dict[str, tuple[Any, ...]] = {}
    missing = {}
    for element in ELEMENTS:
        for solver in SOLVERS:
            name = f"{element}: skfem_textile, {solver}"
            try:
                check_solver(SOLVERS[solver])
            except ValueError as error:
                missing[name] = str(error)
            else:
                codes[name] = _this_library, element, solver
    for rival in RIVALS:
        name = f"{rival.shape.name}: {rival.code}"
        if needed := rival.missing():
            missing[name] = f"needs {needed}"
        else:
            codes[name] = _other_code, rival
    return codes, missing


def _timed(name: str, elements: int) -> list[list[float]]:
    """Times of two iterations of one code, after others for warm-up."""
    make, *arguments = _codes()[0][name]
    one_round = make(*arguments, strip_of(elements))
    rounds = [one_round() for _ in range(_WARM + 2)][_WARM:]
    return [[*parts, sum(parts)] for parts in rounds]


def _ratios(codes: dict[str, Row]) -> dict[str, float]:
    """Time ratios of the installed codes."""
    ratios = {}
    for rival, solver in product(("DOLFINx", "FElupe with Pardiso"), SOLVERS):
        names = f"Q4, 2×2: {rival}", f"Q4, 2×2: skfem_textile, {solver}"
        if all(name in codes for name in names):
            one, other = (codes[name]["seconds"]["median"] for name in names)
            ratios[f"{rival} over skfem_textile, {solver}"] = one / other
    for element in ELEMENTS:
        if code := codes.get(f"{element}: skfem_textile, cholmod"):
            assembly, factorisation, _ = code["parts"]
            ratios[f"assembly over factorisation, {element}"] = assembly / factorisation
    return ratios


def scaling(settings: Settings) -> Row:
    """Time and peak memory against the number of elements, for each linear solver.

    The meshes have 10⁴ to 10⁶ jittered quadrilaterals.  The times are for the set-up
    (bases, pattern, ordering, symbolic factorisation), for one iteration and, in
    another process, for the whole load in one step.  Exponents belong to power laws.
    """
    sizes = [size for size in _SIZES if size <= settings.most]
    names = ("rslab", *(n for n in _OPTIONAL if find_spec(LINEAR_SOLVERS[n].package)))
    solvers = {}
    for name in names:
        rows = [_at_size(size, name) for size in sizes]
        solvers[name] = {"sizes": rows, "exponents": exponents(rows)}
    return {"solvers": solvers}


def _at_size(size: int, solver: str) -> Row:
    row = in_new_process(_iteration_at, size, solver)
    return row | in_new_process(_step_at, size, solver)


def _iteration_at(size: int, solver: str) -> Row:
    """Times of each part in s at one size, and peak memory in GiB."""
    scene = strip_of(size)
    ply, built = seconds(Ply, scene.mesh, Fabric(_E, _G), OnePoint(4.0))
    iterations = Iteration(ply, scene, solver)
    rounds = [iterations.round() for _ in range(1 + _ROUNDS_OF_SIZE)]
    assembly, factorisation, solution = map(median, zip(*rounds[1:], strict=True))
    return {
        "elements": ply.mesh.nelements,
        "unknowns": int(ply.basis.N),
        "once": built + iterations.set_up,
        "assembly": assembly,
        "factorisation": factorisation,
        "solution": solution,
        "iteration": assembly + factorisation + solution,
        "peak_GiB": peak(),
    }


def _step_at(size: int, solver: str) -> Row:
    """Whole load in one step: time in s, linear solves and peak memory in GiB."""
    scene = strip_of(size, jitter=0.3)
    ply = Ply(scene.mesh, Fabric(1e4), Full())
    result = LoadStepper(ply, scene.conditions, steps=1, solver=solver).run()
    return {
        "step": result.wall_time_s,
        "linear_solves": result.linear_solves,
        "step_peak_GiB": peak(),
    }


def peak() -> float:
    """Peak memory of this process in GiB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20


def exponents(rows: list[Row]) -> dict[str, float]:
    """Exponents of power laws of the number of elements, for each timed part."""
    n = np.log([row["elements"] for row in rows])
    return {
        part: float(np.polyfit(n, np.log([row[part] for row in rows]), 1)[0])
        for part in PARTS
    }


def factorisation(settings: Settings) -> Row:
    """Direct solvers on a definite and an indefinite tangent of macro-elements.

    The tangents belong to one mesh, stretched and compressed; random displacements
    buckle the compressed one.  Each solver runs in a new process.
    """
    elements = min(_OF_FACTORISATION, settings.most)
    solvers = [k for k, offer in LINEAR_SOLVERS.items() if find_spec(offer.package)]
    rows = [in_new_process(_factorised, name, elements) for name in solvers]
    return {"elements": elements, "solvers": rows}


def _factorised(solver: str, elements: int) -> Row:
    """Times in s, accuracy and peak memory of one solver."""
    scene = strip_of(elements, jitter=0.3)
    ply = Ply(split(scene.mesh), Fabric(_E, _G), Macro())
    constraints = Constraints(ply.basis, scene.conditions)
    before = peak()
    system, set_up = seconds(
        lambda: Problem(ply, constraints, solver_named(solver)).system
    )
    rng = np.random.default_rng(0)
    row: Row = {"solver": solver, "set_up": set_up}
    b = rng.standard_normal(len(constraints.free))
    moved = scene.displacement(ply.nodes, _LOAD_FACTOR).T.ravel()
    buckled = -moved + 1e-3 * rng.standard_normal(moved.size)
    for name, u in (("definite", moved), ("indefinite", buckled)):
        K = reduced(system, ply.stiffness(u)).upper
        A = K + triu(K, 1).T

        def solution(data: Any = K.data) -> Any:
            factors = system.solver.factorise(data)
            return factors.negative_pivots, factors.solve(b)

        solution()
        times = []
        for _ in range(_ROUNDS_OF_SIZE):
            (negative, x), time = seconds(solution)
            times.append(time)
        backward = np.abs(A @ x - b).max() / (abs(A).sum(1).max() * np.abs(x).max())
        row[name] = {
            "seconds": median(times),
            "negative_eigenvalues": negative,
            "backward_error": float(backward),
        }
    row["ratio"] = row["indefinite"]["seconds"] / row["definite"]["seconds"]
    return row | {"GiB": peak() - before}


def iterative(settings: Settings) -> Row:
    """Conjugate gradients compared with direct solvers, on successively larger plies.

    Both solve one system with a definite tangent.  The times of the direct solver are
    for ordering with analysis, factorisation and solution; the times of conjugate
    gradients for set-up and solution to 10⁻⁸.  The preconditioner is smoothed
    aggregation (pyamg), given the rigid-body modes.
    """
    if find_spec("pyamg") is None:
        return {"missing": "skipped, needs pyamg: pip install pyamg", "sizes": []}
    sizes = [size for size in _OF_ITERATIVE if size <= settings.most]
    return {
        "sizes": [_both_ways(n, E_over_G) for E_over_G in (2e4, 2.0) for n in sizes]
    }


def _both_ways(size: int, E_over_G: float) -> Row:
    """Times and iterations on one mesh."""
    import pyamg

    scene = strip_of(size)
    ply = Ply(scene.mesh, Fabric(E_over_G * _G, _G), OnePoint(8 * _G))
    iterations = Iteration(ply, scene, "auto")
    system, u = iterations.system, iterations.u
    free = iterations.problem.constraints.free
    b, K = -ply.residual(u)[free], reduced(system, ply.stiffness(u))
    system.solver.factorise(K.upper.data)  # selects the solver for large matrices
    factors, factorised = seconds(system.solver.factorise, K.upper.data)
    assert factors.definite
    x, solved = seconds(factors.solve, b)

    A = (K.upper + K.upper.T).tocsr()
    A.setdiag(K.upper.diagonal())
    X, Y = ply.nodes[:, free // 2]
    along_x = free % 2 == 0
    rigid = np.stack([along_x, ~along_x, np.where(along_x, -Y, X)], axis=1) * 1.0
    levels, set_up = seconds(pyamg.smoothed_aggregation_solver, A, rigid)
    iterates: list[None] = []
    options = {
        "rtol": 1e-8,
        "maxiter": _MOST_ITERATIONS,
        "M": levels.aspreconditioner(),
        "callback": lambda _: iterates.append(None),
    }
    (y, info), iterated = seconds(lambda: cg(A, b, **options))
    return {
        "elements": ply.mesh.nelements,
        "E_over_G": E_over_G,
        "direct": {
            "analysis": iterations.set_up,
            "factorisation": factorised,
            "solution": solved,
        },
        "iterative": {"set_up": set_up, "solution": iterated},
        "iterations": len(iterates),
        "converged": info == 0,
        "difference": float(np.abs(x - y).max() / np.abs(x).max()),
        "iterative_over_direct": (set_up + iterated) / (factorised + solved),
    }


def overhead(settings: Settings) -> Row:
    """Overhead of the load stepper and of the corner checks.

    Time per linear solve in s, and fraction of each part, on each mesh.
    """
    sizes = [size for size in _OF_OVERHEAD if size[0] * size[1] <= settings.most]
    return {"sizes": [_shares(size) for size in sizes]}


def _shares(size: tuple[int, int]) -> Row:
    scene = strip(size=size)
    ply = Ply(scene.mesh, Fabric(1e4, 0.5), OnePoint(100.0))
    result = LoadStepper(ply, scene.conditions, steps=4).run()
    total = result.wall_time_s
    remainder = total - result.assembly_time_s - result.solve_time_s
    moved = [(1 + 1e-9 * i) * result.u for i in range(9)]  # avoids cached values
    corners = median(seconds(ply.corners.area_ratio, u)[1] for u in moved)
    return {
        "elements": ply.mesh.nelements,
        "linear_solves": result.linear_solves,
        "seconds_of_a_solve": total / result.linear_solves,
        "assembly": result.assembly_time_s / total,
        "factorisation_and_solution": result.solve_time_s / total,
        "rest": remainder / total,
        "every_corner_once": corners * result.linear_solves / total,
    }


def whole_strip(settings: Settings) -> Row:
    """The strip on 60 000 quadrilaterals, compared with plain Newton in scikit-fem.

    Both load the same ply to 62.5°, with 2×2 points, for which the equilibrium is
    unique.  Plain Newton takes the required number of equal steps.  This library starts
    with one.
    """
    scene = strip_of(min(_SIZE, settings.most), jitter=0.3)

    def own() -> Any:
        ply = Ply(scene.mesh, Fabric(_E), Full())
        return LoadStepper(ply, scene.conditions, 1, solver=settings.solver).run()

    own()  # warm-up
    runs = [seconds(own) for _ in range(_REPEATS)]
    result, times = runs[0][0], [took for _, took in runs]
    task = Task(scene, QUAD4.element, QUAD4.rule, _E, 0.0)
    (u, _, solves), took = seconds(
        lambda: loaded(Plain(QUAD4).system(task), task.values(_STEPS))
    )
    return {
        "elements": scene.mesh.nelements,
        "own": spread(times) | {"linear_solves": result.linear_solves},
        "stock": {"seconds": took, "linear_solves": solves, "steps": _STEPS},
        "stock_over_own": took / median(times),
        "largest_difference_mm": float(np.abs(u - result.u).max()),
    }


def by_turns(settings: Settings) -> Row:
    """One Newton iteration in two alternating checkouts of this project.

    Measures the minimum CPU time of a linear solve with assembly for each checkout, and
    their ratio.
    """
    checkouts = compared(settings)
    turns = [
        [in_checkout(checkout, _MEASURE) for checkout in checkouts.values()]
        for _ in range(_TURNS)
    ]
    rows = []
    for name in turns[0][0]:
        before, after = (min(turn[i][name] for turn in turns) for i in range(2))
        rows.append({"formulation": name, "before": before, "after": after})
    return {"commits": [*checkouts], "turns": rows}


def compared(settings: Settings) -> dict[str, Path]:
    """Two checkouts by their commits.

    Raises
    ------
    ValueError
        If a checkout has changes, or both are at the same commit.
    """
    checkouts = {}
    for checkout in (settings.before, settings.after):
        assert checkout
        at = provenance.commit(checkout)
        if at["commit"] is None or at["changed"]:
            raise ValueError(f"{checkout} is not an unchanged checkout of this project")
        checkouts[at["commit"][:8]] = checkout
    if len(checkouts) < 2:
        raise ValueError(f"{settings.before} and {settings.after} are the same commit")
    return checkouts


def two_commits(results: Row) -> dict[str, Column]:
    """Columns of times in two checkouts, and of their ratio."""
    before, after = results["commits"]
    return {
        f"commit {before}, s": "{before:.3g}",
        f"commit {after}, s": "{after:.3g}",
        "ratio": lambda row: f"{row['before'] / row['after']:.3g}",
    }


def in_checkout(checkout: Path, script: str, *arguments: str) -> Any:
    """JSON that a script prints in a new process with a checkout of this project."""
    child = subprocess.run(
        [sys.executable, "-c", script, *arguments],
        env={**os.environ, "PYTHONPATH": os.path.abspath(checkout)},
        cwd=checkout,
        capture_output=True,
        text=True,
        check=True,
    )
    return json.loads(child.stdout)
