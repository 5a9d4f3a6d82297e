"""Public names, which the package imports on first use."""

from .bands import (
    Fit as Fit,
)
from .bending import (
    BendingCurve as BendingCurve,
    CantileverTest as CantileverTest,
    read_bending as read_bending,
    read_cantilever as read_cantilever,
)
from .choice import (
    Choice as Choice,
)
from .fitting import (
    FabricFit as FabricFit,
    fit_tests as fit_tests,
)
from .preparing import (
    Preparation as Preparation,
    Prepared as Prepared,
    prepare as prepare,
)
from .reading import (
    Format as Format,
    Recording as Recording,
    read_recordings as read_recordings,
)
from .regression import (
    JointFit as JointFit,
)
from .simulation import (
    BiasExtension as BiasExtension,
    PictureFrame as PictureFrame,
    ShearTest as ShearTest,
    Simulation as Simulation,
)
from .specimens import (
    Specimen as Specimen,
    Zeros as Zeros,
    read_specimens as read_specimens,
)
from .tensile import (
    BiaxialCurve as BiaxialCurve,
    Strip as Strip,
    read_biaxial as read_biaxial,
    read_strips as read_strips,
)
from .tests_file import (
    read_tests as read_tests,
)
from .validation import (
    LoadBand as LoadBand,
    Prediction as Prediction,
    Validation as Validation,
    load_band as load_band,
    predict as predict,
    validate as validate,
)
