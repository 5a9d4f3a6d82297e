"""What tests of bending share: a square, inclined fibres, formulations."""

import numpy as np
import pytest

from skfem_textile import Full, Macro, OnePoint, Quadratic
from skfem_textile.scenes.rectangle import rectangle

FORMULATIONS = {
    "one point": OnePoint(),
    "full": Full(),
    "macro": Macro(),
    "quadratic": Quadratic(),
}
every_formulation = pytest.mark.parametrize(
    "formulation", FORMULATIONS.values(), ids=FORMULATIONS
)

SIDE, D = 100.0, 10.0


def inclined(degrees):
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return {"warp": (c, s), "weft": (-s, c)}


def square(n, jitter=0.0, side=SIDE):
    return rectangle(side, side, (n, n), "irregular", jitter, 1)
