"""Public names, which the package imports on first use."""

from .meshing import along_edges as along_edges
from .cells import CORNER as CORNER
from .fibres import (
    SingularFibre as SingularFibre,
    SingularFibres as SingularFibres,
    singular_fibres as singular_fibres,
)
from .fitting import (
    Fitted as Fitted,
    FittedMesh as FittedMesh,
    fit_to_fibres as fit_to_fibres,
    fitted as fitted,
)
from .meshing import (
    SINGULAR as SINGULAR,
    mesh_along_fibres as mesh_along_fibres,
    mesh_outline as mesh_outline,
)
from .outline import Outline as Outline
