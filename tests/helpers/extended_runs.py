"""Bias extensions with each formulation whose terms have history variables."""

import pytest

from skfem_textile import Fabric, LoadStepper, Macro, OnePoint, Ply, Quadratic, Sin2
from skfem_textile.scenes import bias_extension

FORMULATIONS = {
    "macro": Macro(),
    "one point": OnePoint(),
    "rate": OnePoint(1.0, "rate"),
    "mean": Quadratic(80.0),
}


def stepper(name, folder=None, **options):
    scene = bias_extension(size=(2, 4))
    fabric = Fabric(1e4, Sin2(0.5), scene.warp, scene.weft)
    ply = Ply(scene.mesh, fabric, FORMULATIONS[name])
    return LoadStepper(
        ply, scene.conditions, 2, checkpoint=folder, solver="superlu", **options
    )


def interrupted(name, folder):
    """Interrupt a run half-way and leave its checkpoint."""

    def interrupt(state):
        if state.load_factor >= 0.5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        stepper(name, folder, on_step=interrupt).run()
