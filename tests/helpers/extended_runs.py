"""Bias extensions with each formulation whose terms have history variables."""

from skfem_textile import Fabric, LoadStepper, Macro, OnePoint, Ply, Quadratic, Sin2
from skfem_textile.scenes import bias_extension

FORMULATIONS = {
    "macro": Macro(),
    "one point": OnePoint(),
    "rate": OnePoint(1.0, "rate"),
    "mean": Quadratic(80.0),
}


def stepper(name, checkpoint=None, **options):
    scene = bias_extension(size=(2, 4))
    fabric = Fabric(1e4, Sin2(0.5), scene.warp, scene.weft)
    ply = Ply(scene.mesh, fabric, FORMULATIONS[name])
    options |= {"checkpoint": checkpoint, "solver": "superlu"}
    return LoadStepper(ply, scene.conditions, 2, **options)
