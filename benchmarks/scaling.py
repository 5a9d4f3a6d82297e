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

from common import options, seconds, strip_of, write, write_table  # isort: skip  (sets the threads)

import numpy as np

from skfem_textile import Fabric, LoadStepper, OnePoint, Ply
from skfem_textile.solve.conditions import Constraints
from skfem_textile.solve.problem import Problem

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
        "peak_GiB": _peak(),
    }


def whole_step(size, solver):
    """The whole load in one step: seconds, linear solves and the peak of the memory."""
    scene = strip_of(size, jitter=0.3)
    ply = Ply(scene.mesh, Fabric(1e4), OnePoint(10.0))
    result = LoadStepper(ply, scene.conditions, steps=1, solver=solver).run()
    return {
        "elements": ply.mesh.nelements,
        "seconds": result.wall_time_s,
        "linear_solves": result.linear_solves,
        "peak_GiB": _peak(),
    }


def _peak():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20


def main():
    """Measure every size, print and write."""
    defaults = {"solver": "auto", "rounds": 3, "largest": SIZES[-1]}
    chosen = options(__doc__, "scaling", **defaults, size=0, whole=0)
    if chosen.size:  # in a process of its own
        print(json.dumps(one_size(chosen.size, chosen.solver, chosen.rounds)))
        return
    if chosen.whole:
        print(json.dumps(whole_step(chosen.whole, chosen.solver)))
        return
    rows = []
    print("elements  once   assembly + factorisation + solution = iteration (s)  GiB")
    for size in (n for n in SIZES if n <= chosen.largest):
        rows.append(row := apart(chosen, "--size", size))
        print(
            "{elements:8} {once:6.2f} {assembly:8.4f} + {factorisation:.4f} + "
            "{solution:.4f} = {iteration:.4f}  {peak_GiB:.2f}".format(**row),
            flush=True,
        )
    step = apart(chosen, "--whole", chosen.largest)
    print(
        "one load step to 62.5° on {elements} elements: {seconds:.1f} s, {solves} "
        "linear solves, {peak_GiB:.2f} GiB".format(**step)
    )
    found = {"solver": chosen.solver, "sizes": rows, "exponents": exponents(rows)}
    found["step"] = step
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
    head = ["elements", "seconds of a step to 62.5°", "linear solves", "peak, GiB"]
    line = [step["elements"], f"{step['seconds']:.0f}", step["linear_solves"]]
    line.append(f"{step['peak_GiB']:.2f}")
    write_table(chosen.out.with_name("step.md"), head, [line])


def apart(chosen, what, size):
    """What this script finds in a process of its own."""
    command = [sys.executable, __file__, what, str(size)]
    command += ["--solver", chosen.solver, "--rounds", str(chosen.rounds)]
    said = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
    return json.loads(said.stdout.splitlines()[-1])


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
