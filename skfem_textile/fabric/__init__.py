"""What a ply is made of: fibre directions, and laws of tension and shear."""

from .directions import Direction, unit_vectors
from .fabric import Fabric, Family
from .law import Law
from .laws import Linear, Sin2, is_zero

__all__ = [
    "Direction",
    "Fabric",
    "Family",
    "Law",
    "Linear",
    "Sin2",
    "is_zero",
    "unit_vectors",
]
