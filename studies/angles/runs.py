"""One run of a ply, and its loads over those of fibres that do not stretch."""

import numpy as np

from skfem_textile.ply import Ply
from skfem_textile.ply.terms import Formulation
from skfem_textile.scenes import Scene
from skfem_textile.solve.result import Result
from skfem_textile.solve.stepper import LoadStepper

from .cases import ANGLES, STEPS, Specimen


def stepper(scene: Scene, specimen: Specimen, formulation: Formulation) -> LoadStepper:
    """The load stepper of a ply in a scene."""
    ply = Ply(scene.mesh, specimen.fabric(scene), formulation)
    return LoadStepper(ply, scene.conditions, STEPS)


def loads_over_inextensible(
    scene: Scene, specimen: Specimen, result: Result
) -> dict[int, float]:
    """The load over that of fibres that do not stretch, by shear angle in degrees.

    It is nan where the run did not get to.
    """
    assert scene.load is not None
    loads = dict.fromkeys(ANGLES, np.nan)
    for state in result.states[1:]:
        t = state.load_factor
        reached = [angle for angle in ANGLES if abs(angle - t * ANGLES[-1]) < 1e-9]
        for angle in reached:
            load = scene.reaction(state)[1] / scene.load(specimen.shear_law, t)
            loads[angle] = float(load)
    return loads
