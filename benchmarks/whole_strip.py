"""The whole strip on 60 000 quadrilaterals, beside plain Newton in scikit-fem.

Both load the same ply, one point and the hourglass energy with the same C_s, to 62.5°:
plain Newton in the equal steps that it needs, this library from one step on.  Prints
times and their ratio.
"""

from common import options, seconds, spread, strip_of, write  # isort: skip  (sets the threads)

from statistics import median

import numpy as np

from skfem_textile import Fabric, LoadStepper, OnePoint, Ply
from skfem_textile.studies.rivals.newton import loaded
from skfem_textile.studies.rivals.plain import QUAD4_CENTRE, Plain
from skfem_textile.studies.rivals.task import Task

E, G = 1e4, 0.0

#: C_s in N/mm, and the same as a multiple of that of `Plain`, which is 10⁻⁴ E.
C_S = 10.0
MULTIPLE = C_S / (1e-4 * E)


def own(scene, solver):
    """The end of the load by this library."""
    ply = Ply(scene.mesh, Fabric(E, G), OnePoint(C_S))
    return LoadStepper(ply, scene.conditions, steps=1, solver=solver).run()


def stock(scene, steps):
    """The end of the load by plain Newton: displacement, forces, iterations."""
    task = Task(scene, QUAD4_CENTRE.element, QUAD4_CENTRE.rule, E, G)
    return loaded(Plain(QUAD4_CENTRE, MULTIPLE).system(task), task.values(steps))


def main():
    """Measure, print and write."""
    chosen = options(__doc__, "whole_strip", solver="auto", steps=20, size=60_000)
    scene = strip_of(chosen.size, jitter=0.3)
    own(scene, chosen.solver)  # to be warm
    runs = [seconds(own, scene, chosen.solver) for _ in range(5)]
    result, times = runs[0][0], [took for _, took in runs]
    print(f"skfem_textile: {median(times):.2f} s, {result.linear_solves} solves")
    (u, _, solves), took = seconds(stock, scene, chosen.steps)
    off = float(np.abs(u - result.u).max())
    print(
        f"scikit-fem, plain Newton in {chosen.steps} steps: {took:.1f} s, {solves} "
        f"solves; {took / median(times):.0f} times as long, {off:.1e} mm apart"
    )
    found = {
        "elements": scene.mesh.nelements,
        "own": spread(times) | {"linear_solves": result.linear_solves},
        "stock": {"seconds": took, "linear_solves": solves, "steps": chosen.steps},
        "stock_over_own": took / median(times),
        "largest_difference_mm": off,
    }
    head = ["", "seconds", "linear solves"]
    rows = [
        ["skfem_textile, one step", f"{median(times):.2f}", result.linear_solves],
        [f"scikit-fem, {chosen.steps} steps of plain Newton", f"{took:.0f}", solves],
        ["ratio", f"{took / median(times):.0f}", ""],
    ]
    write(found, chosen.out, head, rows)


if __name__ == "__main__":
    main()
