"""Conjugate gradients beside direct solvers, on larger and larger plies.

Of one tangent, definite, with a right-hand side: order and analysis, factorisation and
solution by the direct solver; set-up and solution to 10⁻⁸ by conjugate gradients, with
smoothed aggregation (pyamg) that is told the rigid motions.  On one thread.
"""

from importlib.util import find_spec

from common import options, seconds, strip_of, write  # isort: skip  (sets the threads)

import numpy as np
from scipy.sparse.linalg import cg

from skfem_textile import Fabric, OnePoint, Ply
from skfem_textile.solve.conditions import Constraints
from skfem_textile.solve.problem import Problem

SIZES, MOST = (10_000, 30_000, 100_000, 300_000), 500


def one_size(size, E_over_G):
    """Seconds and iterations on one mesh."""
    import pyamg

    scene = strip_of(size)
    G = 0.5
    ply = Ply(scene.mesh, Fabric(E_over_G * G, G), OnePoint(8 * G))
    constraints = Constraints(ply.basis, scene.conditions)
    problem = Problem(ply, constraints)
    system, analysed = seconds(lambda: problem.system)
    u = scene.displacement(ply.nodes, 0.02).T.ravel()
    b, K = -ply.residual(u)[system.free], system.reduced(ply.stiffness(u))
    factors, factorised = seconds(system.solver.factorise, K.upper.data)
    assert factors.definite
    x, solved = seconds(factors.solve, b)

    A = (K.upper + K.upper.T).tocsr()
    A.setdiag(K.upper.diagonal())
    X, Y = ply.nodes[:, system.free // 2]
    along_x = system.free % 2 == 0
    rigid = np.stack([along_x, ~along_x, np.where(along_x, -Y, X)], axis=1) * 1.0
    levels, set_up = seconds(pyamg.smoothed_aggregation_solver, A, rigid)
    count = []
    (y, info), iterated = seconds(
        lambda: cg(
            A,
            b,
            rtol=1e-8,
            maxiter=MOST,
            M=levels.aspreconditioner(),
            callback=count.append,
        )
    )
    return {
        "elements": ply.mesh.nelements,
        "E_over_G": E_over_G,
        "direct": {
            "analysis": analysed,
            "factorisation": factorised,
            "solution": solved,
        },
        "iterative": {"set_up": set_up, "solution": iterated},
        "iterations": len(count),
        "converged": info == 0,
        "difference": float(np.abs(x - y).max() / np.abs(x).max()),
        "iterative_over_direct": (set_up + iterated) / (factorised + solved),
    }


def main():
    """Measure every size, print and write."""
    chosen = options(__doc__, "iterative", largest=SIZES[-1])
    if find_spec("pyamg") is None:
        print("skipped, needs pyamg: pip install pyamg")
        return
    rows = []
    for E_over_G in (2e4, 2.0):
        for size in (n for n in SIZES if n <= chosen.largest):
            rows.append(row := one_size(size, E_over_G))
            print(
                f"E/G = {E_over_G:g}, {row['elements']} elements: "
                "{iterations} iterations, converged: {converged}; "
                "{iterative_over_direct:.1f} times as long as direct".format(**row),
                flush=True,
            )
    head = ["E/G", "elements", "iterations", "iterative / direct"]
    table = [
        [
            f"{row['E_over_G']:g}",
            row["elements"],
            row["iterations"],
            f"{row['iterative_over_direct']:.1f}",
        ]
        for row in rows
    ]
    write({"sizes": rows}, chosen.out, head, table)


if __name__ == "__main__":
    main()
