"""What a ply is made of: fibre directions, and laws of tension and shear."""

from .fabric import Direction, Fabric, Family, unit_vectors
from .law import Law, Linear, is_zero
from .laws.sin2 import Sin2

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
