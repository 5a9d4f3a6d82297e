"""What the load stepper costs beside assembly and factorisation, and corners beside it.

Prints one line per mesh; ``python benchmarks/overhead.py 300x200`` runs one size.
"""

import sys
from statistics import median

import common

from skfem_textile import Fabric, LoadStepper, OnePoint, Ply
from skfem_textile.scenes import strip


def overhead(size):
    """Share of the run that is neither assembly nor factorisation and solution."""
    scene = strip(size=size)
    ply = Ply(scene.mesh, Fabric(1e4, 0.5), OnePoint(100.0))
    result = LoadStepper(ply, scene.conditions, steps=4).run()
    whole = result.wall_time_s
    rest = whole - result.assembly_time_s - result.solve_time_s
    moved = [(1 + 1e-9 * i) * result.u for i in range(9)]  # no answer is there twice
    look = median(common.seconds(ply.corners.area_ratio, u)[1] for u in moved)
    print(
        f"{size[0]}x{size[1]}: {result.linear_solves} linear solves, "
        f"{whole / result.linear_solves:.3f} s each, "
        f"assembly {result.assembly_time_s / whole:.1%}, "
        f"factorisation and solution {result.solve_time_s / whole:.1%}, "
        f"the rest {rest / whole:.1%}; to look at every corner once takes "
        f"{look * result.linear_solves / whole:.2%} of a linear solve with its assembly"
    )


if __name__ == "__main__":
    sizes = sys.argv[1:] or ["20x30", "60x100", "200x300"]
    for size in sizes:
        overhead(tuple(int(n) for n in size.split("x")))
