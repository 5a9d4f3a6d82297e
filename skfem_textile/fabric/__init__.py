"""What a ply is made of: fibre directions, and laws of tension and shear."""

from .fabric import Direction, Fabric, Family, Law, Linear, Sin2, is_zero, unit_vectors

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
