"""One Newton iteration on 60 000 quadrilaterals, beside other codes.

Residual, tangent, factorisation and solution at one displacement, on one thread, in
warm processes of their own, by turns, round after round.  Prints medians and ratios.
"""

import json
import subprocess
import sys
from functools import partial
from statistics import median
from time import perf_counter

from common import options, spread, strip_of, write, write_table  # isort: skip  (sets the threads)

import numpy as np

from skfem_textile import Fabric, Full, OnePoint, Ply
from skfem_textile.solve.conditions import Constraints
from skfem_textile.solve.linear import check_solver
from skfem_textile.solve.problem import Problem
from skfem_textile.studies.rivals.newton import one_iteration
from skfem_textile.studies.rivals.plain import QUAD4_CENTRE, Plain
from skfem_textile.studies.rivals.rival import QUAD4
from skfem_textile.studies.rivals.task import Task
from skfem_textile.studies.rivals.with_dolfinx import Dolfinx
from skfem_textile.studies.rivals.with_felupe import FElupe
from skfem_textile.studies.rivals.with_native import Native

E, G, LOAD_FACTOR = 1e4, 0.5, 0.02

#: Elements, as the rivals call them, and as formulations with the same energy.
ELEMENTS = {"Q4, one point": OnePoint(8 * G), "Q4, 2×2": Full()}

#: This library with each of its solvers.
OWN = {"SciPy only": "superlu", "pardiso": "pardiso", "cholmod": "cholmod"}

RIVALS = (
    *(Plain(QUAD4_CENTRE, C_s=1.0), Plain(QUAD4)),
    *(FElupe(QUAD4), FElupe(QUAD4, "pypardiso"), Dolfinx(QUAD4), Native(QUAD4)),
)


class Own:
    """This library, with one of its solvers."""

    def __init__(self, formulation, solver, scene, u):
        ply = Ply(scene.mesh, Fabric(E, G), formulation)
        constraints = Constraints(ply.basis, scene.conditions)
        self._problem, self._u = Problem(ply, constraints, solver), u

    def round(self):
        """Seconds of assembly, factorisation and solution."""
        ply, system = self._problem.ply, self._problem.system
        u = self._u = (1 + 1e-9) * self._u  # or the ply would remember its strains
        times = [perf_counter()]
        f = ply.residual(u)
        K = system.reduced(ply.stiffness(u))
        times.append(perf_counter())
        factors = system.solver.factorise(K.upper.data)
        assert factors.definite
        times.append(perf_counter())
        factors.solve(-f[system.free])
        times.append(perf_counter())
        return np.diff(times).tolist()


class Other:
    """Another code."""

    def __init__(self, rival, scene, u):
        shape, self._rival, self._u = rival.shape, rival, u
        self._task = Task(scene, shape.element, shape.rule, E, G)
        inside = not isinstance(rival, Dolfinx)
        self._system = rival.system(self._task) if inside else None

    def round(self):
        """Seconds of assembly, and of factorisation and solution together."""
        self._u = (1 + 1e-9) * self._u  # or factors might be kept
        if self._system:
            return one_iteration(self._system, self._u)
        return self._rival.iterations(self._task, self._u, 1)[0]  # has one before


def contestants():
    """Who takes part, by name: what makes it; and why others do not."""
    found, missing = {}, {}
    for element, formulation in ELEMENTS.items():
        for name, solver in OWN.items():
            name = f"{element}: skfem_textile, {name}"
            try:
                check_solver(solver)
            except ValueError as error:
                missing[name] = str(error)
            else:
                found[name] = partial(Own, formulation, solver)
    for rival in RIVALS:
        name = f"{rival.shape.name}: {rival.code}"
        if needed := rival.missing():
            missing[name] = f"needs {needed}"
        else:
            found[name] = partial(Other, rival)
    return found, missing


def timed(make, size):
    """Two iterations of one contestant, after one to be warm."""
    scene = strip_of(size)
    u = scene.displacement(scene.mesh.p, LOAD_FACTOR).T.ravel()
    contestant = make(scene, u)
    rows = [contestant.round() for _ in range(3)][1:]
    return [[*parts, sum(parts)] for parts in rows]


def main():
    """Measure, print and write."""
    chosen = options(__doc__, "iteration", size=60_000, rounds=4, code="")
    there, missing = contestants()
    if chosen.code:  # in a process of its own
        print(json.dumps(timed(there[chosen.code], chosen.size)))
        return
    times = {name: [] for name in there}
    for _ in range(chosen.rounds):
        for name, rows in times.items():
            command = [sys.executable, __file__, "--code", name]
            command += ["--size", str(chosen.size)]
            said = subprocess.run(
                command, check=True, stdout=subprocess.PIPE, text=True
            )
            rows += json.loads(said.stdout.splitlines()[-1])
    stock = {e: median(t[-1] for t in times[f"{e}: scikit-fem"]) for e in ELEMENTS}
    found = {"elements": chosen.size, "rounds": chosen.rounds, "missing": missing}
    found["codes"] = {}
    print(
        f"{chosen.size} elements, {chosen.rounds} rounds: medians in ms, stock / code"
    )
    for name, rows in sorted(times.items()):
        columns = list(zip(*rows, strict=True))
        total = median(columns[-1])
        faster = stock[name.partition(":")[0]] / total
        found["codes"][name] = {
            "seconds": spread(columns[-1]),
            "parts": [median(column) for column in columns[:-1]],
            "stock_over_this": faster,
        }
        shown = " + ".join(f"{1e3 * median(c):.0f}" for c in columns[:-1])
        print(f"{name:50} {shown:>18} = {1e3 * total:5.0f}  {faster:6.2f} x")
    for name, why in missing.items():
        print(f"{name:50} {why}")
    found["ratios"] = ratios(found["codes"])
    for name, ratio in found["ratios"].items():
        print(f"{name}: {ratio:.2f}")
    head = ["code", "assembly", "factorisation", "solution", "all, ms", "stock / this"]
    write(found, chosen.out, head, lines(found["codes"]))
    write_table(
        chosen.out.with_name("ratios.md"),
        ["", "ratio"],
        [[name, f"{ratio:.2f}"] for name, ratio in found["ratios"].items()],
    )


def ratios(codes):
    """What the codes take beside one another, where all of them are there."""
    own, found = "Q4, 2×2: skfem_textile, cholmod", {}
    for rival in ("DOLFINx", "FElupe with Pardiso"):
        pair = [codes.get(name) for name in (f"Q4, 2×2: {rival}", own)]
        if all(pair):
            one, other = (code["seconds"]["median"] for code in pair)
            found[f"{rival} over skfem_textile with cholmod"] = one / other
    for element in ELEMENTS:
        if code := codes.get(f"{element}: skfem_textile, cholmod"):
            assembly, factorisation, _ = code["parts"]
            found[f"assembly over factorisation, {element}"] = assembly / factorisation
    return found


def lines(codes):
    """Lines of the table."""
    for name, code in codes.items():
        parts = [f"{1e3 * part:.0f}" for part in code["parts"]]
        if len(parts) == 2:
            parts.append("in that")
        total = f"{1e3 * code['seconds']['median']:.0f}"
        yield [name, *parts, total, f"{code['stock_over_this']:.2f}"]


if __name__ == "__main__":
    main()
