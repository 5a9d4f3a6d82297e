"""Cost of a Newton iteration against the number of elements, and peak memory.

From 10³ to 10⁶ jittered quadrilaterals, each size in a process of its own, on one
thread: what is done once (bases, pattern, order of elimination, symbolic analysis) and
one iteration.  Prints the exponents of power laws through the sizes from 10⁴ on.
"""

import json
import resource
import subprocess
import sys
from statistics import median

from common import options, seconds, strip_of, write  # isort: skip  (sets the threads)

import numpy as np

from skfem_textile import Fabric, OnePoint, Ply
from skfem_textile.conditions import Constraints
from skfem_textile.problem import Problem

SIZES = (1_000, 3_000, 10_000, 30_000, 100_000, 300_000, 1_000_000)


def one_size(size, solver, rounds):
    """Seconds of one size, by what takes them, and the peak of the memory in GiB."""
    scene = strip_of(size)
    ply, built = seconds(Ply, scene.mesh, Fabric(1e4, 0.5), OnePoint(4.0))
    constraints, held = seconds(Constraints, ply.basis, scene.conditions)
    problem = Problem(ply, constraints, solver)
    system, analysed = seconds(lambda: problem.system)
    u = scene.displacement(ply.nodes, 0.02).T.ravel()
    parts = []
    for _ in range(1 + rounds):
        u = (1 + 1e-9) * u
        f, forces = seconds(ply.residual, u)
        blocks, stiffness = seconds(ply.stiffness, u)
        K, reduced = seconds(system.reduced, blocks)
        factors, factorised = seconds(system.solver.factorise, K.upper.data)
        _, solved = seconds(factors.solve, -f[system.free])
        assert factors.definite
        parts.append((forces + stiffness + reduced, factorised, solved))
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
        "peak_GiB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20,
    }


def main():
    """Measure every size, print and write."""
    chosen = options(
        __doc__, "scaling", solver="auto", rounds=3, size=0, largest=SIZES[-1]
    )
    if chosen.size:  # in a process of its own
        print(json.dumps(one_size(chosen.size, chosen.solver, chosen.rounds)))
        return
    rows = []
    print("elements  once   assembly + factorisation + solution = iteration (s)  GiB")
    for size in (n for n in SIZES if n <= chosen.largest):
        command = [sys.executable, __file__, "--size", str(size)]
        command += ["--solver", chosen.solver, "--rounds", str(chosen.rounds)]
        said = subprocess.run(command, check=True, capture_output=True, text=True)
        rows.append(row := json.loads(said.stdout.splitlines()[-1]))
        print(
            "{elements:8} {once:6.2f} {assembly:8.4f} + {factorisation:.4f} + "
            "{solution:.4f} = {iteration:.4f}  {peak_GiB:.2f}".format(**row),
            flush=True,
        )
    found = {"solver": chosen.solver, "sizes": rows, "exponents": exponents(rows)}
    for name, exponent in found["exponents"].items():
        print(f"exponent of {name}: {exponent:.2f}")
    names = ("once", "assembly", "factorisation", "solution", "iteration")
    head = ["elements", *(f"{name}, s" for name in names), "peak, GiB"]
    table = [
        [row["elements"], *(f"{row[n]:.3g}" for n in names), f"{row['peak_GiB']:.2f}"]
        for row in rows
    ]
    fitted = [f"{found['exponents'][name]:.2f}" for name in names]
    write(found, chosen.out, head, [*table, ["exponent from 10⁴ on", *fitted, ""]])


def exponents(rows):
    """Of power laws through the sizes from 10⁴ elements on, by what takes the time."""
    large = [row for row in rows if row["elements"] > 9_000] or rows
    n = np.log([row["elements"] for row in large])
    return {
        part: float(np.polyfit(n, np.log([row[part] for row in large]), 1)[0])
        for part in ("assembly", "factorisation", "solution", "iteration", "once")
    }


if __name__ == "__main__":
    main()
