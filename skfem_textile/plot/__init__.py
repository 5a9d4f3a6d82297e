"""Pictures of meshes and results, drawn off screen."""

from .before import mesh_and_fibres
from .pictures import (
    animation,
    contact_sheet,
    fibre_directions,
    fibre_strain,
    shear_angle,
)

__all__ = [
    "animation",
    "contact_sheet",
    "fibre_directions",
    "fibre_strain",
    "mesh_and_fibres",
    "shear_angle",
]
