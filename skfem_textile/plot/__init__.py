"""Pictures of results, drawn off screen."""

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
    "shear_angle",
]
