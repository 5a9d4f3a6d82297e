"""Outlines of plies, and fibres across which the shear angle may jump."""

from ..mesh.requirements import require

require("a mesh of an outline", "outlines", "shapely")

from .along import along_edges
from .cells import CORNER
from .fibres import SingularFibre, SingularFibres, singular_fibres
from .fitting import FittedMesh, fit_to_fibres
from .meshing import SINGULAR, mesh_along_fibres, mesh_outline
from .outline import Outline

__all__ = [
    "CORNER",
    "SINGULAR",
    "FittedMesh",
    "Outline",
    "SingularFibre",
    "SingularFibres",
    "along_edges",
    "fit_to_fibres",
    "mesh_along_fibres",
    "mesh_outline",
    "singular_fibres",
]
