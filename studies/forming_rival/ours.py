"""The hemisphere in this library, with tools as constraints.

Contact is judged at the nodes, as by the other codes.
"""

from time import process_time
from typing import Any

import numpy as np
from skfem import MeshQuad

from skfem_textile import (
    Condition,
    Fabric,
    LoadStepper,
    OnePoint,
    Ply,
    Tool,
    Traction,
)
from skfem_textile.drape import Die, Plane, Sphere

from ..common.rivals.course import Course, draw_in, ends_of
from ..common.rivals.forming import Forming
from ..common.rivals.nodes import contact_at_nodes
from ..common.running import errors_only, run


def ply_of(case: Forming) -> Ply:
    """The ply between its tools; at the load factor 1 the punch is at its depth."""
    with contact_at_nodes():
        return _ply_of(case)


def _ply_of(case: Forming) -> Ply:
    line = np.linspace(0.0, case.side, case.parts + 1)
    half, q = case.gap / 2, case.edge_tension
    rub: Any = {"friction": case.friction, "elastic_slip": case.slip}
    sphere = Sphere(case.radius, (0.0, 0.0, -case.radius - half))
    die = Die(case.radius + case.clearance, case.fillet, (0.0, 0.0, half))
    return Ply(
        MeshQuad.init_tensor(line, line).with_defaults(),
        Fabric(case.E, case.G, (1, 0), (0, 1), bending=(case.D, case.D)),
        OnePoint(case.C_s),
        [
            Traction("right", (q, 0.0, 0.0), factor=1.0),
            Traction("top", (0.0, q, 0.0), factor=1.0),
            Tool(sphere, motion=(0.0, 0.0, case.depth), name="punch", **rub),
            Tool(die, name="die", **rub),
            Tool(Plane((0.0, 0.0, -half)), name="holder", **rub),
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


def ours(case: Forming, steps: int) -> Course:
    """Form a ply with this library.

    Parameters
    ----------
    case, steps
        See `forming.dolfinx`; the penalty has no influence.
    """
    ply = ply_of(case)
    times = [process_time()]
    stepper = LoadStepper(
        ply, held(), steps, on_step=lambda state: times.append(process_time())
    )
    with errors_only():
        result, failure = run(stepper)
    ends, travels = ends_of(ply.nodes.T), case.travels(steps)
    solves = np.cumsum([state.linear_solves for state in result.states])
    seconds = np.subtract(times, times[0])
    rows = [
        [travel, state.reactions["punch"][2], *draw_in(state.u, ends), *cost]
        for state, *cost in zip(result.states, solves, seconds, strict=True)
        if np.isclose(travel := case.depth * state.load_factor, travels).any()
    ]
    return Course.of(np.array(rows).reshape(-1, 6), failure)
