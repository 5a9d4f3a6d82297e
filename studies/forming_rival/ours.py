"""The hemisphere in this library, with penalty tools."""

import numpy as np
from numpy import ndarray
from skfem import MeshQuad

from skfem_textile import Condition, Fabric, OnePoint, Ply, Traction
from skfem_textile.drape import Plane, Sphere
from skfem_textile.solve.search import equilibrium_near
from skfem_textile.solve.states import NoEquilibriumError
from skfem_textile.solve.stepper import DEFAULT_WARN_ONLY

from ..common.rivals.course import Course, formed
from ..common.rivals.forming import Forming
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


def held() -> dict[str, Condition]:
    """Planes of symmetry."""
    return {
        "x = 0": Condition("left", (0.0, None, None)),
        "y = 0": Condition("bottom", (None, 0.0, None)),
    }


def punch_of(ply: Ply) -> PenaltyTerm:
    """The punch, which is the first of the tools."""
    return next(term for term in ply.terms if isinstance(term, PenaltyTerm))


def ours(case: Forming, travels: ndarray) -> Course:
    """Form a ply with this library.

    Parameters
    ----------
    case, travels
        See `forming.dolfinx`.
    """
    ply = ply_of(case)
    punch = punch_of(ply)

    def search(u: ndarray, travel: float) -> tuple[ndarray | None, int]:
        before = punch.tangents
        try:
            with errors_only():
                state = equilibrium_near(
                    ply, held(), u, travel, warn_only=DEFAULT_WARN_ONLY
                )
        except NoEquilibriumError:
            return None, punch.tangents - before
        return state.u, state.linear_solves

    return Course.of(*formed(ply.nodes.T, search, punch.push, travels))
