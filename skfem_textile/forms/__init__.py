"""Every term of the energy as plain scikit-fem forms: the definition."""

from .continuity import shear_continuity
from .corners import corner_resistance
from .form import Forms
from .hourglass import hourglass, hourglass_rate
from .isotropic import isotropic_hourglass
from .mean_tension import mean_tension
from .out_of_plane import out_of_plane
from .shear import shear
from .tension import tension

__all__ = [
    "Forms",
    "corner_resistance",
    "hourglass",
    "hourglass_rate",
    "isotropic_hourglass",
    "mean_tension",
    "out_of_plane",
    "shear",
    "shear_continuity",
    "tension",
]
