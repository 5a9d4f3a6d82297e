"""Mechanics of woven reinforcements on scikit-fem, free of tension locking."""

from .conditions import Condition
from .elements import CENTRE, GAUSS, ElementQuad1Fluctuation, HourglassBasis, quad_basis
from .fabric import Fabric, Law, Linear
from .forms import Forms, shear, tension
from .formulations import Full, OnePoint
from .hourglass import AccumulatedMoment, hourglass, hourglass_rate
from .meshes import MeshError
from .ply import Ply
from .result import Result, State
from .stepper import LoadStepper, StepError

__version__ = "0.1.0"

__all__ = [
    "CENTRE",
    "GAUSS",
    "AccumulatedMoment",
    "Condition",
    "ElementQuad1Fluctuation",
    "Fabric",
    "Forms",
    "Full",
    "HourglassBasis",
    "Law",
    "Linear",
    "LoadStepper",
    "MeshError",
    "OnePoint",
    "Ply",
    "Result",
    "State",
    "StepError",
    "hourglass",
    "hourglass_rate",
    "quad_basis",
    "shear",
    "tension",
]
