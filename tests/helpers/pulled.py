"""A square that is clamped at its bottom and pulled at its top, for tests of steps."""

import numpy as np
from skfem import MeshQuad

from skfem_textile import Condition, Fabric, Full, Newton, Ply
from skfem_textile.solve.states import NoEquilibriumError

CLAMP = {"clamp": Condition("bottom")}


def pulled(value, **fabric):
    mesh = MeshQuad().refined(2).with_defaults()
    ply = Ply(mesh, Fabric(**{"tension": 10.0, "shear": 1.0, **fabric}), Full())
    return ply, CLAMP | {"pull": Condition("top", value, direction=(0, 1))}


class ShortSteps(Newton):
    """Fails where the conditions move by more than 0.2, or late in the run."""

    def solve(self, attempt, start):
        if attempt.fixed_values.max() - np.abs(start.u).max() > 0.2:
            raise NoEquilibriumError("too long")
        return super().solve(attempt, start)


def load_factors(result):
    return [state.load_factor for state in result.states]
