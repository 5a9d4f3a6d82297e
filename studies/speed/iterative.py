"""Conjugate gradients beside direct solvers, on larger and larger plies.

Both solve one system with a definite tangent.  The direct solver is timed for order and
analysis, factorisation and solution.  Conjugate gradients are timed for set-up and
solution to 10⁻⁸; their smoothed aggregation (pyamg) knows the rigid motions.
"""

from functools import partial
from importlib.util import find_spec

import numpy as np
from scipy.sparse.linalg import cg

from skfem_textile import Fabric, OnePoint, Ply
from skfem_textile.solve.conditions import Constraints
from skfem_textile.solve.linear import ChosenSolver
from skfem_textile.solve.problem import Problem
from skfem_textile.solve.tangent import reduced

from ..common.tables import markdown_table
from ..study import Row
from .measuring import Settings, seconds, strip_of

TABLES = ("iterative.md",)

_SIZES = 10_000, 30_000, 100_000, 300_000

_MOST_ITERATIONS = 500


def measured(settings: Settings) -> Row:
    """Seconds and iterations on every mesh, with stiff and with soft fibres."""
    if find_spec("pyamg") is None:
        return {"missing": "skipped, needs pyamg: pip install pyamg", "sizes": []}
    sizes = [size for size in _SIZES if size <= settings.most]
    return {"sizes": [_on_mesh(n, E_over_G) for E_over_G in (2e4, 2.0) for n in sizes]}


def _on_mesh(size: int, E_over_G: float) -> Row:
    """Seconds and iterations on one mesh."""
    import pyamg

    scene = strip_of(size)
    G = 0.5
    ply = Ply(scene.mesh, Fabric(E_over_G * G, G), OnePoint(8 * G))
    constraints = Constraints(ply.basis, scene.conditions)
    problem = Problem(ply, constraints, partial(ChosenSolver, "auto"))
    system, analysed = seconds(lambda: problem.system)
    u = scene.displacement(ply.nodes, 0.02).T.ravel()
    b, K = -ply.residual(u)[system.free], reduced(system, ply.stiffness(u))
    system.solver.factorise(K.upper.data)  # a large one chooses the solver by it
    factors, factorised = seconds(system.solver.factorise, K.upper.data)
    assert factors.definite
    x, solved = seconds(factors.solve, b)

    A = (K.upper + K.upper.T).tocsr()
    A.setdiag(K.upper.diagonal())
    X, Y = ply.nodes[:, system.free // 2]
    along_x = system.free % 2 == 0
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
            "analysis": analysed,
            "factorisation": factorised,
            "solution": solved,
        },
        "iterative": {"set_up": set_up, "solution": iterated},
        "iterations": len(iterates),
        "converged": info == 0,
        "difference": float(np.abs(x - y).max() / np.abs(x).max()),
        "iterative_over_direct": (set_up + iterated) / (factorised + solved),
    }


def tables(results: Row) -> dict[str, str]:
    """A line for each mesh and stiffness."""
    if "missing" in results:
        return {"iterative.md": f"{results['missing']}\n"}
    lines = [
        [
            f"{row['E_over_G']:g}",
            row["elements"],
            row["iterations"],
            f"{row['iterative_over_direct']:.1f}",
        ]
        for row in results["sizes"]
    ]
    head = ["E/G", "elements", "iterations", "iterative / direct"]
    return {"iterative.md": markdown_table(head, lines)}
