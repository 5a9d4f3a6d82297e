"""The case of this folder, and the same case with half the element size, with timing.

``OMP_NUM_THREADS=1 python examples/hole/half_size.py`` runs both on one core, in a few
minutes.
"""

from dataclasses import replace
from pathlib import Path
from time import process_time

from skfem_textile.cases import case_from_file
from skfem_textile.scenes import Case

CASE = Path(__file__).with_name("hole.toml")


def force(case: Case) -> float:
    """Return the final force in N, and print it with the CPU time."""
    start = process_time()
    result = case.run()
    N = case.scene.reaction(result.states[-1])[1]
    print(
        f"{case.scene.mesh.nelements:6} triangles, {result.ply.basis.N:6} unknowns: "
        f"{N:.3f} N in {process_time() - start:.0f} s with {result.solver.name}"
    )
    return float(N)


def main():
    case = case_from_file(CASE)
    finer = replace(case.scene, mesh=case.scene.mesh.refined())
    coarse, fine = force(case), force(replace(case, scene=finer))
    print(f"difference {100 * abs(coarse / fine - 1):.2f} %")
    assert abs(coarse / fine - 1) < 0.02


if __name__ == "__main__":
    main()
