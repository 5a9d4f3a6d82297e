"""Definition of every energy term as plain scikit-fem forms."""

from .corners import corner_resistance
from .form import Forms
from .hourglass import (
    hourglass,
    hourglass_rate,
    isotropic_hourglass,
    out_of_plane,
)
from .shear import shear, shear_continuity
from .tension import mean_tension, tension

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
