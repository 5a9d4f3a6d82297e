"""Mechanics of woven reinforcements on scikit-fem, free of tension locking."""

from . import forms as forms
from .cli import interruption as interruption
from .fabric import (
    Asymmetric,
    BiaxialLaw,
    CrimpInterchange,
    CrimpToe,
    Fabric,
    Law,
    Linear,
    Locking,
    Polynomial,
    Pretensioned,
    Sin2,
    Tabulated,
    TensionOnly,
)
from .fabric.files import read_law, write_law
from .forms import Forms, hourglass_rate, out_of_plane, shear_continuity
from .lazy import __getattr__ as __getattr__
from .mesh.bases import (
    CENTRE,
    GAUSS,
    ElementQuad1Fluctuation,
    HourglassBasis,
    JumpBasis,
    MacroBasis,
    MeanBasis,
    quad_basis,
    triangle_basis,
)
from .mesh.checks import MeshError
from .mesh.splitting import split
from .ply import Ply
from .ply.formulations import Full, Macro, OnePoint, Quadratic
from .ply.kernels.kernel_forms import hourglass, mean_tension, shear, tension
from .ply.loads import BodyForce, Force, Pressure, Traction
from .ply.parameters import AccumulatedMoment, HeldStabilisation, TermParameters, Values
from .ply.terms import FormTerm, Load, MatrixTerm, Term, VectorTerm
from .solve.checkpoint import CheckpointError
from .solve.conditions import Condition
from .solve.interval import ErrorInterval
from .solve.newton import Newton, PlainNewton
from .solve.result import Result, StepError
from .solve.search import equilibrium_near
from .solve.states import Iteration, State, UserError, Verdict
from .solve.stepper import LoadStepper
from .solve.surface import OnSurface, Surface
from .solve.tolerance import Round, ToleranceResult, ToleranceStepper

__version__ = "0.3.0"

__all__ = [
    "CENTRE",
    "GAUSS",
    "AccumulatedMoment",
    "Asymmetric",
    "BiaxialLaw",
    "BodyForce",
    "CheckpointError",
    "Condition",
    "CrimpInterchange",
    "CrimpToe",
    "ElementQuad1Fluctuation",
    "ErrorInterval",
    "Fabric",
    "Force",
    "FormTerm",
    "Forms",
    "Full",
    "HeldStabilisation",
    "Holder",
    "HourglassBasis",
    "Iteration",
    "JumpBasis",
    "Law",
    "Linear",
    "Load",
    "LoadStepper",
    "Locking",
    "Macro",
    "MacroBasis",
    "MatrixTerm",
    "MeanBasis",
    "MeshError",
    "Newton",
    "OnSurface",
    "OnePoint",
    "Outline",
    "PlainNewton",
    "Ply",
    "Polynomial",
    "Pressure",
    "Pretensioned",
    "Quadratic",
    "Result",
    "Round",
    "Sin2",
    "State",
    "StepError",
    "Surface",
    "Tabulated",
    "TensionOnly",
    "Term",
    "TermParameters",
    "ToleranceResult",
    "ToleranceStepper",
    "Tool",
    "Traction",
    "UserError",
    "Values",
    "VectorTerm",
    "Verdict",
    "along_edges",
    "drape",
    "equilibrium_near",
    "fit_to_fibres",
    "forms",
    "hourglass",
    "hourglass_rate",
    "mean_tension",
    "mesh_along_fibres",
    "mesh_outline",
    "out_of_plane",
    "quad_basis",
    "read_law",
    "shear",
    "shear_continuity",
    "singular_fibres",
    "split",
    "tension",
    "triangle_basis",
    "write_law",
]
