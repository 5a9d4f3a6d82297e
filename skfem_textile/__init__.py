"""Mechanics of woven reinforcements on scikit-fem, free of tension locking."""

from . import interruption as interruption  # first: it answers Ctrl-C while others load
from .checkpoint import CheckpointError
from .conditions import Condition
from .continuity import JumpBasis, shear_continuity
from .elements import (
    CENTRE,
    GAUSS,
    ElementQuad1Fluctuation,
    HourglassBasis,
    MeanBasis,
    quad_basis,
    triangle_basis,
)
from .fabric import Fabric, Law, Linear, Sin2
from .forms import Forms, shear, tension
from .formulations import Full, Macro, OnePoint, Quadratic
from .hourglass import (
    AccumulatedMoment,
    HeldStabilisation,
    hourglass,
    hourglass_rate,
)
from .macro import MacroBasis
from .mean_tension import mean_tension
from .meshes import MeshError
from .ply import Ply
from .result import Iteration, Result, State, StepError
from .stepper import LoadStepper
from .strategies import Descent, Mixed, Newton
from .verdict import Verdict

__version__ = "0.1.0"

__all__ = [
    "CENTRE",
    "GAUSS",
    "AccumulatedMoment",
    "CheckpointError",
    "Condition",
    "Descent",
    "ElementQuad1Fluctuation",
    "Fabric",
    "Forms",
    "Full",
    "HeldStabilisation",
    "HourglassBasis",
    "Iteration",
    "JumpBasis",
    "Law",
    "Linear",
    "LoadStepper",
    "Macro",
    "MacroBasis",
    "MeanBasis",
    "MeshError",
    "Mixed",
    "Newton",
    "OnePoint",
    "Ply",
    "Quadratic",
    "Result",
    "Sin2",
    "State",
    "StepError",
    "Verdict",
    "hourglass",
    "hourglass_rate",
    "mean_tension",
    "quad_basis",
    "shear",
    "shear_continuity",
    "tension",
    "triangle_basis",
]
