"""Public names, which the package imports on first use."""

from .bias_extension import (
    bias_extension as bias_extension,
)
from .scene import (
    Case as Case,
)
from .drape import (
    drape as drape,
)
from .forming import (
    double_dome_forming as double_dome_forming,
    forming as forming,
    hemisphere_forming as hemisphere_forming,
)
from .processes import (
    in_phases as in_phases,
)
from .scene import (
    Scene as Scene,
)
from .samples import (
    Samples as Samples,
    run_samples as run_samples,
)
from .simple_shear import (
    simple_shear as simple_shear,
)
from .specimen import (
    specimen as specimen,
)
from .strip import (
    strip as strip,
)
from .strips_in_space import (
    buckling as buckling,
    cantilever as cantilever,
)
from .tools import (
    cylinder as cylinder,
    double_dome as double_dome,
    hemisphere as hemisphere,
    saddle as saddle,
)
from .trellis import (
    picture_frame as picture_frame,
    trellis as trellis,
)
