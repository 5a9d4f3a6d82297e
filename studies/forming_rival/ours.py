"""The hemisphere in this library, with penalty tools."""

from time import perf_counter

import numpy as np
from numpy import ndarray
from skfem import MeshQuad

from skfem_textile import Condition, Fabric, OnePoint, Ply, Traction
from skfem_textile.drape import Plane, Sphere
from skfem_textile.solve.search import equilibrium_near
from skfem_textile.solve.states import NoEquilibriumError
from skfem_textile.solve.stepper import DEFAULT_WARN_ONLY

from ..common.rivals.forming import SHORTEST, Course, Forming
from ..common.running import errors_only
from .penalty import Die, Penalty, PenaltyTerm, Spring


def ply_of(case: Forming) -> Ply:
    """The ply between its tools; the load factor is the travel of the punch in mm."""
    line = np.linspace(0.0, case.side, case.parts + 1)
    half = case.gap / 2
    die = Die(half, case.opening, case.fillet)
    holder = Plane((0.0, 0.0, -half))

    def punch(travel: float) -> Sphere:
        return Sphere(case.radius, (0.0, 0.0, travel - case.radius - half))

    k, q = case.penalty, case.edge_tension
    return Ply(
        MeshQuad.init_tensor(line, line).with_defaults(),
        Fabric(case.E, case.G, (1, 0), (0, 1), bending=(case.D, case.D)),
        OnePoint(case.C_s),
        [
            Traction("right", (q, 0.0, 0.0), factor=1.0),
            Traction("top", (0.0, q, 0.0), factor=1.0),
            Penalty("punch", punch, k),
            Penalty("die", lambda t: die, k),
            Penalty("holder", lambda t: holder, k),
            Spring(case.spring),
        ],
        dimension=3,
        fibre_ends={"left": "mirror", "bottom": "mirror"},
    )


def ours(case: Forming, travels: ndarray) -> Course:
    """Form a ply with this library; a step that fails is halved.

    Parameters
    ----------
    case, travels
        See `forming.dolfinx`.
    """
    start = perf_counter()
    ply = ply_of(case)
    held = {
        "x = 0": Condition("left", (0.0, None, None)),
        "y = 0": Condition("bottom", (None, 0.0, None)),
    }
    (punch,) = (term for term in ply.terms if term.name == "punch")
    assert isinstance(punch, PenaltyTerm)
    ends = [
        np.isclose(ply.nodes.T, end).all(axis=1)
        for end in ((case.side, 0.0), (case.side, case.side))
    ]
    u, at, solves, failure, rows = ply.basis.zeros(), 0.0, 0, "", []
    for travel in travels:
        whole = step = travel - at
        while at < travel and not failure:
            to = min(at + step, travel)
            try:
                with errors_only():
                    state = equilibrium_near(
                        ply, held, u, to, warn_only=DEFAULT_WARN_ONLY
                    )
            except NoEquilibriumError as error:
                step /= 2
                if step < SHORTEST * whole:
                    failure = str(error)
            else:
                u, at, solves = state.u, to, solves + state.linear_solves
        if failure:
            break
        force = punch.forces(u, at)[2].sum()
        draw_in = [np.hypot(*ply.nodal(u)[:2, end][:, 0]) for end in ends]
        rows.append([at, force, *draw_in, solves, perf_counter() - start])
    return Course.of(np.reshape(rows, (-1, 6)), failure)
