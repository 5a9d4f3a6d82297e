"""All energies once more, straight from their definitions: loops in plain numpy.

Nothing here comes from the library; `test_independent` holds the library against it.

A motion is given by the current positions ``x`` of the nodes, shape (2, n_nodes, m): m
motions at once, of which every energy gives m values.  All formulas are analytic, so
that ``x`` may be complex: forces are differences along the imaginary axis.
"""

from .corners import corner_stiffness, corners
from .derivatives import derivative, imaginary_moves
from .elements import Cloth, polygon
from .kinematics import smallest_det_F
from .laws import Biaxial, Law, interchange
from .stabilisation import (
    automatic_hourglass,
    continuity,
    hourglass,
    isotropic,
    rate,
)
from .tension_and_shear import (
    macro_tension,
    quadratic_mean_tension,
    shear,
    tension,
)

__all__ = [
    "Biaxial",
    "Cloth",
    "Law",
    "automatic_hourglass",
    "continuity",
    "corner_stiffness",
    "corners",
    "derivative",
    "hourglass",
    "imaginary_moves",
    "interchange",
    "isotropic",
    "macro_tension",
    "polygon",
    "quadratic_mean_tension",
    "rate",
    "shear",
    "smallest_det_F",
    "tension",
]
