"""Fibre directions: in each element, along a reference curve, and by accident."""

from .connectivity import directions_warning, warn_of_directions
from .curve import AlongCurve
from .on_mesh import directions_of
from .per_element import FibreDirections

__all__ = [
    "AlongCurve",
    "FibreDirections",
    "directions_of",
    "directions_warning",
    "warn_of_directions",
]
