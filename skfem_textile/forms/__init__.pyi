"""Public names, which the package imports on first use."""

from .in_plane import (
    corner_resistance as corner_resistance,
)
from .form import (
    Forms as Forms,
)
from .hourglass import (
    hourglass as hourglass,
    hourglass_rate as hourglass_rate,
    isotropic_hourglass as isotropic_hourglass,
    out_of_plane as out_of_plane,
)
from .in_plane import (
    shear as shear,
    shear_continuity as shear_continuity,
)
from .in_plane import (
    mean_tension as mean_tension,
    tension as tension,
)
