"""Public names, which the package imports on first use."""

from .fabric import (
    Direction as Direction,
    Fabric as Fabric,
    Family as Family,
    unit_vectors as unit_vectors,
)
from .law import (
    BiaxialLaw as BiaxialLaw,
    Law as Law,
    Linear as Linear,
    Slopes as Slopes,
    TwoLaws as TwoLaws,
    is_zero as is_zero,
)
from .laws.bending import (
    Bilinear as Bilinear,
)
from .laws.biaxial import (
    CrimpedYarns as CrimpedYarns,
    CrimpInterchange as CrimpInterchange,
    Softening as Softening,
)
from .laws.friction import (
    WithFriction as WithFriction,
    along as along,
)
from .laws.polynomial import (
    Polynomial as Polynomial,
)
from .laws.shear import (
    Locking as Locking,
    Sin2 as Sin2,
    TangentShear as TangentShear,
)
from .laws.tabulated import (
    Tabulated as Tabulated,
)
from .laws.tension import (
    Asymmetric as Asymmetric,
    CrimpToe as CrimpToe,
    Pretensioned as Pretensioned,
    TensionOnly as TensionOnly,
)
from .yarns import (
    Yarns as Yarns,
    friction_part as friction_part,
)
