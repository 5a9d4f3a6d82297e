"""Problems of a ply in space with exact answers, and how far a run is from them."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.optimize import brentq
from scipy.sparse.linalg import spsolve
from skfem import Mesh

from skfem_textile import (
    BodyForce,
    Condition,
    Fabric,
    Full,
    LoadStepper,
    Macro,
    OnePoint,
    Ply,
    Quadratic,
    StepError,
    Traction,
)
from skfem_textile.scenes.elastica import buckled, hanging
from skfem_textile.scenes.rectangle import rectangle
from skfem_textile.solve.conditions import Constraints
from skfem_textile.solve.linear import solver_named
from skfem_textile.solve.problem import Problem
from skfem_textile.solve.tangent import Tangent

#: Length and width of strips, and side of squares, in mm.
LENGTH, WIDTH = 100.0, 20.0

#: Formulations by name, and element edges over those of the mesh that is given.
FORMULATIONS: Mapping[str, tuple[Any, int]] = {
    "one point": (OnePoint(), 1),
    "macro": (Macro(), 2),
    "quadratic": (Quadratic(), 1),
}

#: Cantilevers by name: force at the end P L²/D and weight w L³/D.
CANTILEVERS = {"force 1": (1.0, 0.0), "force 10": (10.0, 0.0), "weight 8": (0.0, 8.0)}

# Fibre stiffness of strips in N/mm, where it is not varied, and share of the length by
# which a strip is shortened.
_FIBRES, _SHORTENING = 1e4, 0.2

# Span of a sheet that hangs between two edges over its length, and its weight in N/mm².
_SPAN, _WEIGHT = 0.8, 1e-3

# Halvings of an interval that holds a critical tension.
_HALVINGS = 16


def strip(n: int, jitter: float, formulation: str) -> tuple[Mesh, Any]:
    """A mesh with n element edges along a strip after any split, and a formulation."""
    chosen, halves = FORMULATIONS[formulation]
    size = n // halves, max(n // 16, 2) // halves
    return rectangle(LENGTH, WIDTH, size, "irregular", jitter, 1), chosen


def cantilever(
    load: str, n: int, jitter: float, formulation: str, D: float, E_over_G: float
) -> dict[str, Any]:
    """The tip of a cantilever in one load step, off by shares of its length."""
    force, weight = CANTILEVERS[load]
    mesh, chosen = strip(n, jitter, formulation)
    loads: list[Any] = []
    if force:
        loads.append(Traction("right", (0.0, 0.0, -force * D / LENGTH**2)))
    if weight:
        loads.append(BodyForce((0.0, 0.0, -weight * D / LENGTH**3)))
    fabric = Fabric(_FIBRES, _FIBRES / E_over_G, bending=(D, D))
    ends: Any = {"left": "clamped"}
    ply = Ply(mesh, fabric, chosen, loads, dimension=3, fibre_ends=ends)
    found, result = _run(ply, {"left": Condition("left")}, 1)
    if result is None:
        return found
    tip = ply.nodes[0] > LENGTH - 1e-6
    x, _, z = ply.nodal(result.u)[:, tip].mean(axis=1)
    exact = hanging(weight, force)
    return found | {
        "off_x": float(1 + x / LENGTH - exact.x[-1]),
        "off_z": float(z / LENGTH - exact.z[-1]),
    }


def shortened(
    n: int, jitter: float, formulation: str, D: float, E_over_G: float
) -> dict[str, Any]:
    """Force and height of a strip that buckles, off by shares of the exact ones."""
    mesh, chosen = strip(n, jitter, formulation)
    push = BodyForce((0.0, 0.0, 1e-3 * D / LENGTH**3), factor=1.0)
    fabric = Fabric(_FIBRES, _FIBRES / E_over_G, bending=(D, D))
    ply = Ply(mesh, fabric, chosen, [push], dimension=3)
    conditions = {
        "left": Condition("left"),
        "right": Condition("right", (-_SHORTENING * LENGTH, 0.0, 0.0)),
    }
    found, result = _run(ply, conditions, 4)
    if result is None:
        return found
    exact = buckled(_SHORTENING)
    force = -result.states[-1].reactions["right"][0] / WIDTH
    z = ply.nodal(result.u)[2]
    height = np.abs(z).max()
    return found | {
        "mirrored": bool(z.max() < height),
        "off_x": float(force * LENGTH**2 / D / exact.force - 1),
        "off_z": float(height / LENGTH / exact.height - 1),
    }


def hanging_sheet(
    n: int, jitter: float, formulation: str, D: float, E_over_G: float
) -> dict[str, Any]:
    """Sag and pull of a sheet without bending stiffness between two edges."""
    mesh, chosen = strip(n, jitter, formulation)
    load = BodyForce((0.0, 0.0, -_WEIGHT), factor=1.0)
    fabric = Fabric(_FIBRES, _FIBRES / E_over_G, bending=(D, D))
    ply = Ply(mesh, fabric, chosen, [load], dimension=3)
    conditions = {
        "left": Condition("left"),
        "right": Condition("right", ((_SPAN - 1) * LENGTH, 0.0, 0.0)),
    }
    found, result = _run(ply, conditions, 4)
    if result is None:
        return found
    c = brentq(lambda c: 2 * c * np.sinh(_SPAN / 2 / c) - 1, 0.05, 10.0)
    sag = c * (np.cosh(_SPAN / 2 / c) - 1)
    pull = result.states[-1].reactions["right"][0] / (_WEIGHT * WIDTH * LENGTH)
    return found | {
        "off_x": float(pull / c - 1),
        "off_z": float(-ply.nodal(result.u)[2].min() / LENGTH / sag - 1),
    }


def _run(
    ply: Ply, conditions: dict[str, Condition], steps: int
) -> tuple[dict[str, Any], Any]:
    """What a run tells, and its result; None where it is refused."""
    try:
        result = LoadStepper(ply, conditions, steps, solver="superlu").run()
    except StepError as error:
        return {"outcome": "refused", "said": str(error)}, None
    told = {
        "outcome": "converged",
        "linear_solves": result.linear_solves,
        "load_steps": len(result.states) - 1,
        "path_resolved": result.path_resolved,
    }
    return told, result


def plate(degrees: float, n: int, jitter: float, formulation: str) -> dict[str, Any]:
    """Largest error of the deflection of a simply supported square, over its largest.

    Under p sin(πx/L) sin(πy/L), w = p/(c D (π/L)⁴) sin sin with c = 2 for fibres along
    the sides and 4 at 45°.
    """
    mesh = rectangle(LENGTH, LENGTH, (n, n), "irregular", jitter, 1)
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    fabric = Fabric(_FIBRES, 1.0, (c, s), (-s, c), bending=(1.0, 1.0))
    ply = Ply(mesh, fabric, FORMULATIONS[formulation][0], dimension=3)
    (K,) = (term.matrix for term in ply.terms if term.name == "bending")  # type: ignore[attr-defined]
    k = np.pi / LENGTH

    def pressure(x):
        return np.stack([0 * x[0], 0 * x[0], np.sin(k * x[0]) * np.sin(k * x[1])])

    f = BodyForce(pressure).on(ply.basis).vector[2::3]
    X = ply.nodes
    free = np.flatnonzero((X.min(axis=0) > 1e-9) & (X.max(axis=0) < LENGTH - 1e-9))
    w = np.zeros(X.shape[1])
    w[free] = spsolve(K[2::3, 2::3][free][:, free].tocsc(), f[free])
    share = 2 if degrees == 0 else 4
    return {"off_z": float(np.abs(w * share * k**4 - pressure(X)[2]).max())}


def critical(where: str, n: int, formulation: str, D: float) -> dict[str, Any]:
    """The tension at which fibres along x, compressed evenly, are no more stable.

    ``in plane``: ends held and z held, T = −(G + D (π/L)²).  ``out of plane``: all
    edges held in position, T = −2 D (π/L)².
    """
    E, G, k = 1e5, 0.1, np.pi / LENGTH
    chosen, halves = FORMULATIONS[formulation]
    m = n // halves
    mesh = rectangle(LENGTH, LENGTH, (m, m), "irregular", 0.0, 1)
    ply = Ply(mesh, Fabric(E, G, bending=(D, D)), chosen, dimension=3)
    if where == "in plane":
        conditions = {name: Condition(name) for name in ("left", "right")}
        conditions["plane"] = Condition(lambda X: X[0] > -1, (None, None, 0.0))
        exact = -(G + D * k**2)
    else:
        sides = ("left", "right", "bottom", "top")
        conditions = {name: Condition(name) for name in sides}
        exact = -2 * D * k**2
    constraints = Constraints(ply.basis, conditions)
    problem = Problem(ply, constraints, solver_named("superlu")).at(1.0)
    low, high = 2 * exact, 0.0
    for _ in range(_HALVINGS):
        u, middle = ply.basis.zeros(), (low + high) / 2
        u[::3] = np.expm1(middle / E) * ply.nodes[0]
        stable = Tangent(problem, u, ply.parameters_at_rest).definite
        low, high = (low, middle) if stable else (middle, high)
    return {"exact": exact, "off_x": float(high / exact - 1)}


def zero_modes(formulation: str, D: float) -> dict[str, Any]:
    """Motions of a free flat patch of 4×4 elements that no stiffness meets."""
    chosen = {"one point, C_s = 0": OnePoint(0.0), "full": Full()}
    made: Any = chosen.get(formulation) or FORMULATIONS[formulation][0]
    m = 2 if formulation == "macro" else 4
    mesh = rectangle(10.0, 10.0, (m, m), "irregular", 0.0, 1)
    ply = Ply(mesh, Fabric(1e3, 1.0, bending=(D, D)), made, dimension=3)
    values = np.linalg.eigvalsh(ply.tangent(ply.basis.zeros()).toarray())
    zero = np.abs(values) < 1e-9 * values[-1]
    return {"unknowns": ply.basis.N, "modes": int(zero.sum())}
