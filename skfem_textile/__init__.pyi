"""Public names, which the package imports on first use."""

from . import drape as drape, forms as forms
from .fabric import (
    Asymmetric as Asymmetric,
    BiaxialLaw as BiaxialLaw,
    Bilinear as Bilinear,
    CrimpInterchange as CrimpInterchange,
    CrimpToe as CrimpToe,
    Fabric as Fabric,
    Law as Law,
    Linear as Linear,
    Locking as Locking,
    Polynomial as Polynomial,
    Pretensioned as Pretensioned,
    Sin2 as Sin2,
    Tabulated as Tabulated,
    TensionOnly as TensionOnly,
    WithFriction as WithFriction,
    Yarns as Yarns,
)
from .fabric.files import read_law as read_law, write_law as write_law
from .contact import Holder as Holder, Stack as Stack, Tool as Tool
from .forms import (
    Forms as Forms,
    hourglass as hourglass,
    hourglass_rate as hourglass_rate,
    mean_tension as mean_tension,
    out_of_plane as out_of_plane,
    shear as shear,
    shear_continuity as shear_continuity,
    tension as tension,
)
from .forms.fields import FibreFields as FibreFields, fibre_fields as fibre_fields
from .mesh.bases import (
    CENTRE as CENTRE,
    GAUSS as GAUSS,
    ElementQuad1Fluctuation as ElementQuad1Fluctuation,
    HourglassBasis as HourglassBasis,
    JumpBasis as JumpBasis,
    MacroBasis as MacroBasis,
    MeanBasis as MeanBasis,
    quad_basis as quad_basis,
    triangle_basis as triangle_basis,
)
from .mesh.checks import MeshError as MeshError
from .mesh.splitting import split as split
from .ply import Ply as Ply
from .ply.amount import Programme as Programme
from .ply.clamps import Clamp as Clamp
from .ply.formulations import (
    Full as Full,
    Macro as Macro,
    OnePoint as OnePoint,
    Quadratic as Quadratic,
)
from .ply.loads import (
    BodyForce as BodyForce,
    Force as Force,
    Pressure as Pressure,
    Traction as Traction,
)
from .ply.parameters import (
    AccumulatedMoment as AccumulatedMoment,
    HeldStabilisation as HeldStabilisation,
    TermParameters as TermParameters,
    Values as Values,
)
from .ply.slip import slip_index as slip_index
from .ply.terms import (
    FormTerm as FormTerm,
    Load as Load,
    MatrixTerm as MatrixTerm,
    Term as Term,
    VectorTerm as VectorTerm,
)
from .outlines import (
    Outline as Outline,
    along_edges as along_edges,
    fit_to_fibres as fit_to_fibres,
    fitted as fitted,
    mesh_along_fibres as mesh_along_fibres,
    mesh_outline as mesh_outline,
    singular_fibres as singular_fibres,
)
from .solve.states import CheckpointError as CheckpointError
from .solve.conditions import Condition as Condition
from .solve.interval import ErrorInterval as ErrorInterval
from .solve.newton import Newton as Newton, PlainNewton as PlainNewton
from .solve.result import Result as Result, StepError as StepError
from .solve.search import equilibrium_near as equilibrium_near
from .solve.states import (
    Iteration as Iteration,
    State as State,
    UserError as UserError,
    Verdict as Verdict,
)
from .solve.stepper import LoadStepper as LoadStepper
from .solve.on_surface import OnSurface as OnSurface
from .surfaces.surface import Surface as Surface
from .solve.tolerance import (
    Round as Round,
    ToleranceResult as ToleranceResult,
    ToleranceStepper as ToleranceStepper,
)

__version__: str
