"""A short run on a mesh that was read."""

import contextlib

import numpy as np
from skfem import Mesh, MeshTri

from skfem_textile import (
    Condition,
    Fabric,
    LoadStepper,
    Macro,
    OnePoint,
    Ply,
    Quadratic,
    StepError,
)
from skfem_textile.mesh.splitting import was_split

# Displacement of the pulled end, as a share of the length of the mesh.
_PULL = 0.02


def run(mesh: Mesh) -> None:
    """Clamp the low end of the mesh and pull the high one, in two steps.

    Raises
    ------
    ValueError
        If the library refuses the mesh or the conditions.
    """
    formulation = OnePoint()
    if isinstance(mesh, MeshTri):
        formulation = Quadratic()
    elif was_split(mesh):
        formulation = Macro()
    ply = Ply(mesh, Fabric(100.0, 1.0), formulation)
    x = mesh.p
    axis = int(np.argmax(np.ptp(x, axis=1)))
    low, size = x[axis].min(), np.ptp(x[axis])
    ends = {
        "low": Condition(lambda X: X[axis] <= low + 0.1 * size),
        "high": Condition(
            lambda X: X[axis] >= low + 0.9 * size,
            _PULL * size,
            direction=np.eye(2)[axis],
        ),
    }
    with contextlib.suppress(StepError):
        LoadStepper(ply, ends, steps=2, max_halvings=1).run()
