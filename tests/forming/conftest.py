"""A small hemisphere that is formed, completely and half way."""

import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import (
    Condition,
    Fabric,
    Holder,
    LoadStepper,
    Newton,
    Ply,
    StepError,
    Tool,
    Traction,
    drape,
)

SIDE, RADIUS, GAP = 60.0, 30.0, 0.3
MIRRORS = {"left": "mirror", "bottom": "mirror"}


def quarter(motion, cells=6):
    """Quarter of a ply over a hemispherical punch, on a plate that holds it down."""
    x = np.linspace(0, SIDE, cells + 1)
    mesh = MeshQuad.init_tensor(x, x).with_defaults()
    t = np.linspace(0, 2 * np.pi, 41)
    ring = np.hstack([r * np.array([np.cos(t), np.sin(t)]) for r in (200.0, 38.0)])
    punch = Tool(drape.Sphere(RADIUS, (0, 0, -RADIUS - GAP / 2)), motion, name="punch")
    plate = drape.Plane((0, 0, GAP / 2))
    die = Tool(plate, side=-1, outline=ring, name="die")
    holder = Holder(plate, gap=GAP, side=-1, outline=ring, name="holder")
    pull = [
        Traction(edge, force, factor=1.0, name=edge)
        for edge, force in (("right", (0.2, 0, 0)), ("top", (0, 0.2, 0)))
    ]
    return Ply(
        mesh,
        Fabric(1e4, 0.1, bending=(5.0, 5.0)),
        terms=[*pull, punch, die, holder],
        dimension=3,
        fibre_ends=MIRRORS,
    ), {
        "x": Condition("left", (0.0, None, None)),
        "y": Condition("bottom", (None, 0.0, None)),
    }


@pytest.fixture(scope="session")
def hemisphere():
    """Formed to 15 mm in three steps."""
    return LoadStepper(*quarter((0.0, 0.0, 15.0)), steps=3).run()


@pytest.fixture(scope="session")
def stopped():
    """Run that stops at 5 of 35 mm: 20 iterations are too few for a step of 30 mm."""

    def motion(t):
        return 0.0, 0.0, 10 * t if t <= 0.5 else 5 + 60 * (t - 0.5)

    few = Newton(most=2)
    with pytest.raises(StepError) as caught:
        LoadStepper(*quarter(motion, 4), steps=2, max_halvings=0, method=few).run()
    return caught.value
