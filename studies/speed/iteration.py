"""One Newton iteration on 60 000 quadrilaterals, beside other codes.

Residual, tangent, factorisation and solution at one displacement.  Each code has a warm
process.  The processes take turns in each round.
"""

from functools import partial
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np
from numpy import ndarray

from skfem_textile import Fabric, Full, OnePoint, Ply
from skfem_textile.ply.terms import Formulation
from skfem_textile.scenes import Scene
from skfem_textile.solve.conditions import Constraints
from skfem_textile.solve.linear import ChosenSolver, check_solver
from skfem_textile.solve.problem import Problem
from skfem_textile.solve.tangent import reduced

from ..common.rivals.newton import one_iteration
from ..common.rivals.plain import QUAD4_CENTRE, Plain
from ..common.rivals.rival import QUAD4, InProcess, Rival
from ..common.rivals.task import Task
from ..common.rivals.with_dolfinx import Dolfinx
from ..common.rivals.with_felupe import FElupe
from ..common.rivals.with_native import Native
from ..common.tables import markdown_table
from ..common.workers import in_new_process
from ..study import Row
from .measuring import Settings, spread, strip_of

TABLES = ("iteration.md",)

_SIZE, _ROUNDS = 60_000, 4

_E, _G, _LOAD_FACTOR = 1e4, 0.5, 0.02

#: Elements, as the rivals call them, and as formulations with the same energy.
ELEMENTS: dict[str, Formulation] = {
    "Q4, one point": OnePoint(8 * _G),
    "Q4, 2×2": Full(),
}

#: This library with each of its solvers.
SOLVERS = {"SciPy only": "superlu", "pardiso": "pardiso", "cholmod": "cholmod"}

RIVALS: tuple[Rival, ...] = (
    *(Plain(QUAD4_CENTRE, C_s=1.0), Plain(QUAD4)),
    *(FElupe(QUAD4), FElupe(QUAD4, "pypardiso"), Dolfinx(QUAD4), Native(QUAD4)),
)


class _ThisLibrary:
    """The library, with one of its solvers."""

    def __init__(self, element: str, solver: str, scene: Scene, u: ndarray) -> None:
        ply = Ply(scene.mesh, Fabric(_E, _G), ELEMENTS[element])
        constraints = Constraints(ply.basis, scene.conditions)
        solver_of_pattern = partial(ChosenSolver, SOLVERS[solver])
        self._ply, self._problem = ply, Problem(ply, constraints, solver_of_pattern)
        self._u = u

    def round(self) -> list[float]:
        """Seconds of assembly, factorisation and solution."""
        ply, system = self._ply, self._problem.system
        u = self._u = (1 + 1e-9) * self._u  # else the ply would keep its strains
        times = [perf_counter()]
        f = ply.residual(u)
        K = reduced(system, ply.stiffness(u))
        times.append(perf_counter())
        factors = system.solver.factorise(K.upper.data)
        assert factors.definite
        times.append(perf_counter())
        factors.solve(-f[system.free])
        times.append(perf_counter())
        return np.diff(times).tolist()


class _OtherCode:
    """Another code."""

    def __init__(self, rival: Rival, scene: Scene, u: ndarray) -> None:
        shape, self._rival, self._u = rival.shape, rival, u
        self._task = Task(scene, shape.element, shape.rule, _E, _G)
        self._system = None
        if isinstance(rival, InProcess):
            self._system = rival.system(self._task)

    def round(self) -> list[float]:
        """Seconds of assembly, and of factorisation and solution together."""
        self._u = (1 + 1e-9) * self._u  # else factors might be kept
        if self._system:
            return [*one_iteration(self._system, self._u)]
        return [*self._rival.iterations(self._task, self._u, 1)[0]]  # has one before


def measured(settings: Settings) -> Row:
    """Seconds of each code, beside those of stock scikit-fem."""
    elements = min(_SIZE, settings.most)
    codes, missing = _codes()
    times: dict[str, list[list[float]]] = {name: [] for name in codes}
    for _ in range(_ROUNDS):
        for name, rows in times.items():
            rows += in_new_process(_timed, name, elements)
    stock = {e: median(t[-1] for t in times[f"{e}: scikit-fem"]) for e in ELEMENTS}
    results = {}
    for name, rows in sorted(times.items()):
        *parts, whole = zip(*rows, strict=True)
        results[name] = {
            "seconds": spread(whole),
            "parts": [median(part) for part in parts],
            "stock_over_this": stock[name.partition(":")[0]] / median(whole),
        }
    return {
        "elements": elements,
        "rounds": _ROUNDS,
        "missing": missing,
        "codes": results,
        "ratios": _ratios(results),
    }


def _codes() -> tuple[dict[str, tuple[Any, ...]], dict[str, str]]:
    """What makes each installed code, by name; and why others are missing."""
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
                codes[name] = _ThisLibrary, element, solver
    for rival in RIVALS:
        name = f"{rival.shape.name}: {rival.code}"
        if needed := rival.missing():
            missing[name] = f"needs {needed}"
        else:
            codes[name] = _OtherCode, rival
    return codes, missing


def _timed(name: str, elements: int) -> list[list[float]]:
    """Two iterations of one code, after a first one to warm up."""
    scene = strip_of(elements)
    u = scene.displacement(scene.mesh.p, _LOAD_FACTOR).T.ravel()
    make, *given = _codes()[0][name]
    code = make(*given, scene, u)
    rounds = [code.round() for _ in range(3)][1:]
    return [[*parts, sum(parts)] for parts in rounds]


def _ratios(codes: dict[str, Row]) -> dict[str, float]:
    """Ratios of the times, if all the codes are there."""
    own, ratios = "Q4, 2×2: skfem_textile, cholmod", {}
    for rival in ("DOLFINx", "FElupe with Pardiso"):
        pair = [codes[name] for name in (f"Q4, 2×2: {rival}", own) if name in codes]
        if len(pair) == 2:
            one, other = (code["seconds"]["median"] for code in pair)
            ratios[f"{rival} over skfem_textile with cholmod"] = one / other
    for element in ELEMENTS:
        if code := codes.get(f"{element}: skfem_textile, cholmod"):
            assembly, factorisation, _ = code["parts"]
            ratios[f"assembly over factorisation, {element}"] = assembly / factorisation
    return ratios


def tables(results: Row) -> dict[str, str]:
    """A line for each code."""
    lines = []
    for name, code in results["codes"].items():
        parts = [f"{1e3 * part:.0f}" for part in code["parts"]]
        if len(parts) == 2:
            parts.append("in that")
        whole = f"{1e3 * code['seconds']['median']:.0f}"
        lines.append([name, *parts, whole, f"{code['stock_over_this']:.2f}"])
    head = ["code", "assembly", "factorisation", "solution", "all, ms", "stock / this"]
    return {"iteration.md": markdown_table(head, lines)}
